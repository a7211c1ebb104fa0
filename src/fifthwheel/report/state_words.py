"""States in words: whether they can be relied on, and what to do where they cannot."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from fifthwheel.report import facts
from fifthwheel.report.conclusion import Conclusion
from fifthwheel.report.numbers import about, percent
from fifthwheel.report.whiteness import LOUD

if TYPE_CHECKING:
    from fifthwheel.logs import Record
    from fifthwheel.observe import States


def conclude_states(states: "Sequence[States]", records: "Sequence[Record]") -> Conclusion:
    """States alone in words."""
    found, cautions, steps, strange = [], [], [], []
    for one in states:
        shares = facts.status_shares(one)
        good = shares.get(facts.WORDS["OK"], 0.0)
        rest = "; ".join(f"{percent(part)} {word}" for word, part in shares.items() if word != facts.WORDS["OK"])
        warned = list(innovation_cautions(one, "vehicle file"))
        doubt = ", but they do not fit the truck of the vehicle file" if warned else ""
        there = f"{_of_samples(good)}{f' ({rest})' if rest else ''}"
        found.append(f"{one.name}: inputs and measurements are there in {there}{doubt}.")
        differences = [
            (name, facts.reference_rms(one, facts.record_of(one, records), name), facts.unit_of(name))
            for name in one.values
        ]
        told = [f"{n} {about(rms, unit)}" for n, rms, unit in differences if rms is not None]
        if told:
            found.append(f"{one.name}: rms difference from the reference: {', '.join(told)}.")
        cautions += warned
        if warned:
            strange.append(one.name)
            steps.append(
                f"Check the vehicle file against this truck, or identify it from {one.name} first; if it was, give the "
                "identification.json too, which holds the sensors' zeros, gains and delays."
            )
        if good < 0.5:
            steps.append(f"Cut {one.name} to where the truck drives, or map the missing channels.")
    return Conclusion(
        good=_whole(states) > 0.95 and not cautions,
        headline=_states_headline(states, strange),
        found=tuple(found),
        cautions=tuple(cautions),
        next_steps=tuple(dict.fromkeys(steps)),
        notes=tuple(dict.fromkeys(f"{r.name}: {note}" for r in records for note in r.notes)),
    )


def _states_headline(states: "Sequence[States]", strange: Sequence[str]) -> str:
    logs = "1 log" if len(states) == 1 else f"{len(states)} logs"
    if not strange:
        return f"States are reliable in {_of_samples(_whole(states))} of {logs}."
    where = "" if len(states) == 1 else f" in {', '.join(strange)}"
    return f"The truck of the vehicle file does not fit what was measured{where}: do not rely on these states."


def _whole(states: "Sequence[States]") -> float:
    """Part of all samples at which nothing was missing."""
    return float(np.mean(np.concatenate([np.asarray(s.status) == 0 for s in states]))) if states else 0.0


def innovation_cautions(states: "States", blamed: str) -> list[str]:
    """Channels that do not fit; `blamed` is what may be wrong besides the noise."""
    told = []
    for name in states.innovation:
        size, out = innovation_size(states, name)
        if np.isfinite(size) and size > LOUD:
            told.append(
                f"{states.name}: innovations of {name} are {size:.1f} times what the filter expects; "
                f"{blamed} or sensor noise do not fit, and the states' bands are too narrow."
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
