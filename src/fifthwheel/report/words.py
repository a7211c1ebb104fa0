"""An identification in words: what is known, what is not, what to beware of, what to do next."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fifthwheel.report import advice, facts
from fifthwheel.report.numbers import about, percent, relative, with_sigma

if TYPE_CHECKING:
    from fifthwheel.identify import Estimate, Identification
    from fifthwheel.logs import Record
    from fifthwheel.observe import States

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
    return ("≈", "converged, rough") if advice.roughly(estimate) else MARKS[estimate.verdict]


@dataclass(frozen=True, kw_only=True)
class Conclusion:
    """What a reader should take away, a sentence each."""

    good: bool
    """Whether nothing is left to do."""
    headline: str
    found: tuple[str, ...] = ()
    unknown: tuple[str, ...] = ()
    cautions: tuple[str, ...] = ()
    next_steps: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def spoken(name: str) -> str:
    """A path as words: "semitrailer.cog_height" -> "semitrailer CoG height"."""
    return name.replace(".", " ").replace("_", " ").replace("cog", "CoG")


def conclude(identification: "Identification", records: "Sequence[Record]" = ()) -> Conclusion:
    """The identification in words; with the records also how they were driven."""
    sought = [e for e in identification.parameters if e.verdict != "held"]
    known = [e for e in sought if e.verdict == "converged"]
    drives = facts.driven(identification, records)
    cautions = [
        *advice.value_cautions(identification),
        *advice.sensor_cautions(identification),
        *advice.fit_cautions(identification),
        *advice.drive_cautions(identification, drives),
    ]
    return Conclusion(
        good=len(known) == len(sought),
        headline=_headline(identification, known, sought),
        found=(*[_found(identification, e) for e in known], *_found_derived(identification), *_proof(identification)),
        unknown=tuple(_together(identification)),
        cautions=tuple(cautions),
        next_steps=tuple(advice.next_steps(identification, drives)),
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
    rough = sum(advice.roughly(e) for e in known)
    coarse = f", {rough} of them roughly" if rough else ""
    if len(known) == len(sought):
        return f"All {len(sought)} parameters are known from {logs}{coarse}."
    return f"{len(known)} of {len(sought)} parameters are known from {logs}{coarse}; {len(sought) - len(known)} not."


def _found(identification: "Identification", estimate: "Estimate") -> str:
    text = f"{spoken(estimate.name)}: {with_sigma(estimate.value, estimate.sigma, estimate.unit)}"
    if estimate.sigma is not None and estimate.value:
        text += f" (±{relative(estimate.value, estimate.sigma)}{', roughly' if advice.roughly(estimate) else ''})"
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
        if all(facts.share(fit).by_noise for fit in own):
            told.append(f"{log}, which was only predicted, is matched as well as its sensors' noise allows.")
        elif all(fit.explained >= advice.POOR or facts.share(fit).by_noise for fit in own):
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


def conclude_states(states: "Sequence[States]", records: "Sequence[Record]") -> Conclusion:
    """States alone in words."""
    found, cautions, steps = [], [], []
    for one in states:
        shares = facts.status_shares(one)
        good = shares.get(facts.WORDS["OK"], 0.0)
        rest = "; ".join(f"{percent(part)} {word}" for word, part in shares.items() if word != facts.WORDS["OK"])
        found.append(f"{one.name}: reliable in {_of_samples(good)}{f' ({rest})' if rest else ''}.")
        differences = [
            (name, facts.reference_rms(one, facts.record_of(one, records), name), facts.unit_of(name))
            for name in one.values
        ]
        told = [f"{n} {about(rms, unit)}" for n, rms, unit in differences if rms is not None]
        if told:
            found.append(f"{one.name}: rms difference from the reference: {', '.join(told)}.")
        warned = list(_innovation_cautions(one))
        cautions += warned
        if warned:
            steps.append(
                f"Check the vehicle file against this truck, or identify it from {one.name} first; if it was, give the "
                "identification.json too, which holds the sensors' zeros, gains and delays."
            )
        if good < 0.5:
            steps.append(f"Cut {one.name} to where the truck drives, or map the missing channels.")
    whole = float(np.mean(np.concatenate([np.asarray(s.status) == 0 for s in states]))) if states else 0.0
    return Conclusion(
        good=whole > 0.95 and not cautions,
        headline=(
            "The truck of the vehicle file does not fit what was measured: do not rely on these states."
            if cautions
            else f"States are reliable in {_of_samples(whole)} of "
            f"{'1 log' if len(states) == 1 else f'{len(states)} logs'}."
        ),
        found=tuple(found),
        cautions=tuple(cautions),
        next_steps=tuple(dict.fromkeys(steps)),
        notes=tuple(dict.fromkeys(f"{r.name}: {note}" for r in records for note in r.notes)),
    )


def _innovation_cautions(states: "States") -> "Sequence[str]":
    told = []
    for name in states.innovation:
        size, out = innovation_size(states, name)
        if np.isfinite(size) and size > 1.5:
            told.append(
                f"{states.name}: innovations of {name} are {size:.1f} times what the filter expects; "
                "vehicle file or sensor noise do not fit, and the bands are too narrow."
            )
        if out > 0.02:
            told.append(f"{states.name}: {percent(out)} of {name} lie outside the gate and were not used.")
    return told


def innovation_size(states: "States", name: str) -> tuple[float, float]:
    """Root mean square of a channel's used, normalised innovations (1 is as expected), and the part not used."""
    values = facts.normalised(states, name)
    out = facts.rejected(states, name)
    seen = np.isfinite(values)
    used = seen & ~out
    size = float(np.sqrt(np.mean(values[used] ** 2))) if used.any() else float("nan")
    return size, float(out.sum() / max(seen.sum(), 1))


def _of_samples(part: float) -> str:
    return "all samples" if part == 1 else f"{percent(part, of_whole=True)} of the samples"


def _sentence(text: str) -> str:
    return text[0].upper() + text[1:] + "."
