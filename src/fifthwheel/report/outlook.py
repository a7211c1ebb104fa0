"""An outlook on a terminal: what the logs can tell, what would help, what is wrong with them."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from fifthwheel.report.conclusion import Conclusion
from fifthwheel.report.facts import unit_of
from fifthwheel.report.numbers import about, relative, with_sigma
from fifthwheel.report.terminal import COLOURS, Page

if TYPE_CHECKING:
    from rich.console import Console

    from fifthwheel.identify.outlook import Outlook, Prospect
    from fifthwheel.identify.remedies import Remedy

ROUGH = 0.15
"""A parameter that is told to no better than this part of its value is told roughly."""

WORDS = {"converged": "can be told", "not_excited": "not excited", "not_identifiable": "not identifiable"}
"""Verdict -> word, before a fit."""


def show_outlook(outlook: "Outlook", console: "Console | None" = None) -> None:
    """Print what the logs can tell of each parameter, what would help, and what is wrong with the logs."""
    page = Page(console)
    errors = [f"{log}: {f.message}" for log, f in outlook.findings if f.severity == "error"]
    doubts = [f"{log}: {f.message}" for log, f in outlook.findings if f.severity != "error"]
    page.headline(_conclude(outlook, wrong=bool(errors)))
    page.lists(("Wrong with the logs", errors))
    table = page.table("Parameter", "Value:>", "Known\nbefore:>", "Told by\nlogs:>", "Verdict")
    for p in outlook.parameters:
        before, told = (f"±{relative(p.value, sigma)}" for sigma in (p.prior, p.sigma))
        cells = (
            p.name,
            with_sigma(p.value, None, p.unit),
            before,
            told if can_be_told(p) else "–",
            word(p.verdict, _part(p)),
        )
        page.row(table, *cells, style=COLOURS[p.verdict])
    page.show(table)
    page.lists(
        (
            "What would help",
            [f"{p.name}: {_start(p)} {_changes(p)}" for p in outlook.parameters if p.remedies],
        ),
        ("Hard to tell apart", list(_confused(outlook))),
        ("Beware", [*outlook.cautions, *doubts]),
        ("Notes", (*outlook.notes, *_explained(outlook), BOUND)),
    )


BOUND = (
    "Reckoned at the values of the vehicle file, from the sensors' noise and from what the file knows only roughly; "
    "what the model itself errs comes on top."
)


def can_be_told(prospect: "Prospect") -> bool:
    """Whether a fit would learn it."""
    return prospect.verdict == "converged"


def word(verdict: str, part: float) -> str:
    """A verdict before the fit; `part` is the sigma as a part of the value."""
    return "roughly" if verdict == "converged" and part > ROUGH else WORDS[verdict]


def _part(prospect: "Prospect") -> float:
    return prospect.sigma / abs(prospect.value)


def _conclude(outlook: "Outlook", *, wrong: bool) -> Conclusion:
    logs = outlook.logs[0] if len(outlook.logs) == 1 else f"{len(outlook.logs)} logs"
    told, rough = (
        sum(map(can_be_told, outlook.parameters)),
        sum(can_be_told(p) and _part(p) > ROUGH for p in outlook.parameters),
    )
    count = len(outlook.parameters)
    if not told:
        still = all(p.verdict == "not_excited" for p in outlook.parameters)
        text = f"{logs} can tell no parameter" + (": the truck is not moved enough." if still else ".")
    else:
        coarse = f", {rough} of them roughly" if rough else ""
        text = f"{logs} can tell {told} of {count} parameters{coarse}."
    if wrong:
        text += " Something is wrong with the data; cure that first, the rest takes them as they are."
    return Conclusion(good=told == count and not wrong, headline=text)


def _start(prospect: "Prospect") -> str:
    return relative(prospect.value, prospect.sigma) if can_be_told(prospect) else "not told"


def _changes(prospect: "Prospect") -> str:
    """ "-> 12 % if semitrailer.roll_axis_height were known (--hold), -> 9 % with one more lane change"."""
    return ", ".join(f"-> {relative(prospect.value, remedy.sigma)} {in_words(remedy)}" for remedy in prospect.remedies)


def in_words(remedy: "Remedy") -> str:
    """A change as the end of a sentence."""
    if remedy.known:
        return f"if {' and '.join(remedy.known)} were known ({_how(remedy.known)})"
    words = []
    if remedy.channel:
        words.append(f"{remedy.channel} logged")
    if remedy.drive == "again":
        words.append("the same driven once more")
    elif remedy.drive:
        words.append("one more lane change")
    return f"with {' and '.join(words)}"


def _how(known: "tuple[str, ...]") -> str:
    """How a parameter or a sensor's error is made known."""
    sensors = [name for name in known if name.endswith((".gain", ".offset", ".delay"))]
    return "calibrate it" if len(sensors) == len(known) else "--hold" if not sensors else "--hold, calibrate"


def _confused(outlook: "Outlook") -> Iterator[str]:
    """What is told roughly or not at all, since it can hardly be told from something else."""
    for p in outlook.parameters:
        if p.confused_with and p.remedies:
            yield f"{p.name} from {', '.join(p.confused_with)}"


def _explained(outlook: "Outlook") -> Iterator[str]:
    """What the words above mean in numbers."""
    remedies = [remedy for p in outlook.parameters for remedy in p.remedies]
    if any(remedy.drive == "lane_change" for remedy in remedies):
        yield f"One more lane change: that of SAE J2179, 1.5 m sideways within 61 m, at {3.6 * outlook.speed:.0f} km/h."
    yield from explained(remedies)
    found: dict[str, list[float]] = {}
    for noise in outlook.noise.values():
        for name, variance in noise.items():
            found.setdefault(name, []).append(variance)
    told = [f"{name} {about(float(np.sqrt(np.mean(v))), unit_of(name))}" for name, v in found.items()]
    yield f"Noise of a sample, one sigma: {', '.join(told)}."


def explained(remedies: "Sequence[Remedy]") -> Iterator[str]:
    """What is meant by known, if something should be."""
    if any("--hold" in in_words(remedy) for remedy in remedies):
        yield "Known (--hold): measured, written into the vehicle file, and held there with --hold NAME."
