"""A plan on a terminal: what to drive, what it would tell, and what stands in the way."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from fifthwheel.report.conclusion import Conclusion
from fifthwheel.report.numbers import about, fixed, percent
from fifthwheel.report.outlook import BOUND, explained, in_words, word
from fifthwheel.report.terminal import COLOURS, Page

if TYPE_CHECKING:
    from rich.console import Console

    from fifthwheel.identify.proposal import Plan, Proposal, Shortfall

KINDS = {
    "lane_change": "lane change",
    "sweep": "sweep, sine from 0.2 to 1.2 Hz within 16 s",
    "random": "random steer, 0.1 to 1 Hz, for 16 s",
    "bend": "bend, in within 1 s, 6 s along it, out within 1 s",
}
"""Kind of a manoeuvre in words; a lane change has its frequency besides."""


def show_plan(plan: "Plan", console: "Console | None" = None) -> None:
    """Print the drive that is proposed, what it would tell of each parameter, other drives, and what is in the way."""
    page = Page(console)
    page.headline(Conclusion(good=plan.met, headline=_headline(plan)))
    page.lists(("Drive", list(_steps(plan.best))))
    table = page.table("Parameter", "Wanted:>", "Told:>", "Verdict")
    for name, sigma in plan.best.sigma.items():
        wanted = f"±{percent(plan.wants[name])}" if name in plan.wants else ""
        verdict = plan.best.verdicts[name]
        told = f"±{percent(sigma)}" if verdict == "converged" else "–"
        page.row(table, name, wanted, told, word(verdict, sigma), style=COLOURS[verdict])
    page.show(table)
    changes = [remedy for shortfall in plan.unmet for remedy in shortfall.remedies]
    others = [f"{_summary(one)}: {_worst(plan, one)}" for one in plan.alternatives]
    page.lists(
        ("What stands in the way", [_obstacle(shortfall) for shortfall in plan.unmet]),
        ("Or drive", others),
        ("Notes", (*plan.notes, *explained(changes), f"With {', '.join(plan.channels)} at {plan.rate:.0f} Hz.", BOUND)),
    )


def _headline(plan: "Plan") -> str:
    best = plan.best
    if plan.met:
        return f"{fixed(best.duration, 0)} s of driving tell all that is wanted."
    missed = len(plan.unmet)
    return f"No drive tells all that is wanted, {missed} of {len(plan.wants)} fall short; nearest comes this one."


def _summary(one: "Proposal") -> str:
    """ "4 x lane change of 0.4 Hz at 88 km/h, 1.5 m/s², 32 s"."""
    kind = KINDS[one.kind].partition(",")[0]
    if one.frequency:
        kind += f" of {one.frequency:g} Hz"
    speed = f"{3.6 * one.speed:.0f} km/h"
    return f"{one.repetitions} x {kind} at {speed}, {about(one.acceleration, 'm/s^2')}, {fixed(one.duration, 0)} s"


def _steps(one: "Proposal") -> Iterator[str]:
    """What the driver is to be told."""
    sides = "" if one.repetitions == 1 else ", to the left and to the right in turn"
    every = "" if one.repetitions == 1 else f", one every {fixed(one.duration / one.repetitions, 1)} s"
    kind = KINDS[one.kind] + (f" of {one.frequency:g} Hz" if one.frequency else "")
    yield f"{one.repetitions} x {kind}{sides}{every}, at a steady {3.6 * one.speed:.0f} km/h."
    if one.offset and one.frequency:
        length, time = one.speed / one.frequency, 1 / one.frequency
        yield f"Each goes {one.offset:.1f} m sideways within {fixed(length, 0)} m, {fixed(time, 1)} s."
    if one.kind == "bend":
        yield f"Along the bend the radius is {fixed(one.speed**2 / one.leading, -1)} m."
    degrees = np.degrees(np.abs(one.steer).max())
    yield (
        f"Lateral acceleration of any unit up to {about(one.acceleration, 'm/s^2')}, "
        f"road-wheel angle up to {degrees:.1f} deg; begin and end straight."
    )


def _worst(plan: "Plan", one: "Proposal") -> str:
    """ "semitrailer.yaw_inertia 1.9 %": what it tells least of, beside what is wanted."""
    name = max(plan.wants, key=lambda wanted: one.sigma[wanted] / plan.wants[wanted])
    return f"{name} {percent(one.sigma[name])}"


def _obstacle(shortfall: "Shortfall") -> str:
    start = percent(shortfall.sigma) if shortfall.verdict == "converged" else "not told"
    text = f"{shortfall.name}: {start}, {percent(shortfall.wanted)} wanted"
    if not shortfall.remedies:
        return f"{text}; nothing single would bring it down by a tenth"
    changes = ", ".join(f"-> {percent(remedy.sigma)} {in_words(remedy)}" for remedy in shortfall.remedies)
    return f"{text}; {changes}"
