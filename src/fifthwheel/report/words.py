"""An identification in words: what is known, what is not, what to beware of, what to do next."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from fifthwheel.report import advice, cautions, facts
from fifthwheel.report.conclusion import Conclusion
from fifthwheel.report.numbers import about, percent, relative, with_sigma
from fifthwheel.report.state_words import innovation_cautions

if TYPE_CHECKING:
    from fifthwheel.identify import Estimate, Identification
    from fifthwheel.identify.outlook import Outlook
    from fifthwheel.logs import Record
    from fifthwheel.observe import States

_MOVES = 0.5
"""Of a channel that is explained in a log in which the truck moves."""

MARKS = {
    "converged": ("✓", "converged"),
    "not_converged": ("…", "not converged"),
    "not_excited": ("?", "not excited"),
    "not_identifiable": ("∥", "not identifiable"),
    "at_bound": ("!", "at bound"),
    "held": ("=", "held"),
}
"""Verdict -> mark and word."""


def mark(estimate: "Estimate") -> tuple[str, str]:
    """Mark and word for an estimate's verdict."""
    return ("≈", "converged, rough") if cautions.roughly(estimate) else MARKS[estimate.verdict]


def spoken(name: str) -> str:
    """A path as words: "semitrailer.cog_height" -> "semitrailer CoG height"."""
    return name.replace(".", " ").replace("_", " ").replace("cog", "CoG")


def conclude(
    identification: "Identification",
    records: "Sequence[Record]" = (),
    outlook: "Outlook | None" = None,
    states: "Sequence[States]" = (),
) -> Conclusion:
    """The identification in words.

    Args:
        records: the logs, for how they were driven.
        outlook: at the identified vehicle, for what a change would bring.
        states: of the identified truck, for whether they fit what was measured.
    """
    sought = [e for e in identification.parameters if e.verdict != "held"]
    known = [e for e in sought if e.verdict == "converged"]
    drives = facts.driven(identification, records)
    beware = [
        *cautions.value_cautions(identification),
        *cautions.sensor_cautions(identification),
        *cautions.fit_cautions(identification),
        *cautions.drive_cautions(identification, drives),
        *[text for one in states for text in innovation_cautions(one, "truck")],
    ]
    return Conclusion(
        good=len(known) == len(sought),
        headline=_headline(identification, known, sought),
        found=(*[_found(identification, e) for e in known], *_found_derived(identification), *_proof(identification)),
        unknown=tuple(_together(identification)),
        cautions=tuple(beware),
        next_steps=tuple(advice.next_steps(identification, drives, outlook)),
        notes=identification.notes,
    )


def _headline(identification: "Identification", known: "Sequence[Estimate]", sought: "Sequence[Estimate]") -> str:
    used = len(identification.logs)
    logs = "1 log" if used == 1 else f"{used} logs"
    if not sought:
        return "Every parameter was held; nothing was identified."
    if not known:
        if all(e.verdict == "not_excited" for e in sought):
            return f"No parameter is known from {logs}: the truck was not moved enough."
        return f"No parameter is known from {logs}."
    rough = sum(cautions.roughly(e) for e in known)
    coarse = f", {rough} of them roughly" if rough else ""
    if len(known) == len(sought):
        return f"All {len(sought)} parameters are known from {logs}{coarse}."
    return f"{len(known)} of {len(sought)} parameters are known from {logs}{coarse}; {len(sought) - len(known)} not."


def _found(identification: "Identification", estimate: "Estimate") -> str:
    text = f"{spoken(estimate.name)}: {with_sigma(estimate.value, estimate.sigma, estimate.unit)}"
    if estimate.sigma is not None and estimate.value:
        text += f" (±{relative(estimate.value, estimate.sigma)}{', roughly' if cautions.roughly(estimate) else ''})"
    before = identification.initial_vehicle.parameters().get(estimate.name)
    if before:
        change = estimate.value / before - 1
        where = f"{percent(abs(change))} {'above' if change > 0 else 'below'}" if abs(change) >= 5e-4 else "as in"
        text += f", {where} the vehicle file"
    return _sentence(text)


def _found_derived(identification: "Identification") -> list[str]:
    return [
        _sentence(f"from it, {spoken(e.name)}: {with_sigma(e.value, e.sigma, e.unit)}")
        for e in identification.derived
        if e.verdict == "converged"
    ]


def _proof(identification: "Identification") -> list[str]:
    """Logs that were only predicted, and well."""
    told = []
    for log in dict.fromkeys(fit.log for fit in identification.fits if not fit.identified_on):
        own = [fit for fit in identification.fits if fit.log == log]
        noise = all(facts.share(fit).by_noise for fit in own)
        if noise and max(fit.explained for fit in own) < _MOVES:
            told.append(f"{log}, which was only predicted, proves nothing: the truck hardly moves in it.")
        elif noise:
            told.append(f"{log}, which was only predicted, is matched as well as its sensors' noise allows.")
        elif all(fit.explained >= cautions.POOR or facts.share(fit).by_noise for fit in own):
            worst = min(fit.explained for fit in own if not facts.share(fit).by_noise)
            told.append(f"{log}, which was only predicted, is explained to {percent(worst, of_whole=True)} or more.")
    return told


def _unknown(estimate: "Estimate") -> str:
    name, held = spoken(estimate.name), with_sigma(estimate.value, None, estimate.unit)
    if estimate.verdict == "held":
        return _sentence(f"{name}: held at {held}, as asked for")
    if estimate.verdict == "at_bound":
        return _sentence(f"{name}: ran into the edge of what is allowed, {held}; that is no finding")
    text = with_sigma(estimate.value, estimate.sigma, estimate.unit)
    return _sentence(f"{name}: {text} is provisional, it was still moving at the end or does not explain the log")


def _not_excited(identification: "Identification", estimate: "Estimate") -> str:
    stands = _stands(identification, estimate)
    if estimate.sigma is None:
        return f"not sought, no roll rate of the {estimate.name.split('.')[0]} was logged; {stands}"
    prior = estimate.prior if estimate.prior is not None else estimate.sigma
    of_value = not estimate.name.endswith(".payload.height")
    needed = identification.settings.excited * prior

    def size(sigma: float) -> str:
        return f"±{percent(sigma / abs(estimate.initial))}" if of_value else f"±{about(sigma, estimate.unit)}"

    return (
        f"not excited, the logs do not bring it from the {size(prior)} assumed beforehand under the {size(needed)} "
        f"that count as known; {stands}"
    )


def _not_identifiable(identification: "Identification", estimate: "Estimate") -> str:
    stands = _stands(identification, estimate)
    if estimate.confused_with:
        others = " and ".join(spoken(name) for name in estimate.confused_with)
        return f"not identifiable, the logs cannot tell it from {others}; {stands}"
    unit = estimate.name.split(".")[0]
    return f"not identifiable, no channel of the logs tells enough of it (a roll rate of the {unit} would); {stands}"


def _stands(identification: "Identification", estimate: "Estimate") -> str:
    given = identification.initial_vehicle.parameters().get(estimate.name)
    if given is not None and not np.isclose(given, estimate.value, rtol=1e-6):
        began, file = (with_sigma(value, None, estimate.unit) for value in (estimate.value, given))
        return f"the value shown, {began}, is where the search began, the vehicle file has {file}"
    return "the value shown is the vehicle file's"


def _together(identification: "Identification") -> list[str]:
    """What is not known, those together of which the same is to be said."""
    told: dict[str, list[str]] = {}
    for estimate in identification.parameters:
        if estimate.verdict in ("not_excited", "not_identifiable"):
            why = _not_excited if estimate.verdict == "not_excited" else _not_identifiable
            told.setdefault(why(identification, estimate), []).append(spoken(estimate.name))
    plain = ("converged", "not_excited", "not_identifiable")
    sentences = [_unknown(e) for e in identification.parameters if e.verdict not in plain]
    return [*sentences, *[_sentence(f"{', '.join(names)}: {text}") for text, names in told.items()]]


def _sentence(text: str) -> str:
    return text[0].upper() + text[1:] + "."
