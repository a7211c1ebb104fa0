"""What to do next, after an identification."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from fifthwheel.report import facts
from fifthwheel.report.cautions import POOR, roughly, unusual
from fifthwheel.report.numbers import listed, percent, relative

if TYPE_CHECKING:
    from fifthwheel.identify import Estimate, Identification
    from fifthwheel.identify.outlook import Outlook
    from fifthwheel.report.facts import Drive

WIDE = 0.05
"""A relative sigma from which it is told what it comes from."""
MOSTLY = 0.5
"""A part of a variance that is worth naming."""
HARDLY = 0.5
"""Sideways acceleration up to which a log counts as straight, m/s^2."""
LANE_CHANGE = "1.5 m sideways within 60 m at 80 to 90 km/h, about 1.5 m/s²"


def next_steps(
    identification: "Identification", drives: "Sequence[Drive]", outlook: "Outlook | None" = None
) -> list[str]:
    """What to do, the most useful first; with an outlook also what it would bring."""
    poor = [
        f.log for f in identification.fits if not f.identified_on and f.explained < POOR and not facts.share(f).by_noise
    ]
    steps = []
    if poor:
        steps.append(f"Identify on {listed(poor)} too: what was found does not carry over to it well.")
    steps += [*_for_excitation(identification, drives), *_for_roll(identification), *_reckoned(identification, outlook)]
    steps += _for_confusion(identification)
    if any(e.verdict == "at_bound" for e in identification.parameters):
        steps.append(
            "A parameter at its bound mostly means a wrong vehicle file or log: check masses, axle positions and the "
            "CoG, then sign, unit and ratio of the steer angle and the gyros."
        )
    moving = [e.name for e in identification.parameters if e.verdict == "not_converged"]
    if moving:
        steps.append(
            "Parameters that are provisional may trade against each other: add another log of the same truck, allow "
            f"more passes, or hold one whose value is known otherwise (such as {moving[0]}). Where the log is not "
            "explained either, check the signals' signs, units and places first."
        )
    for error in identification.sensors:
        if error.name.endswith(".gain") and unusual(identification.settings, error):
            signal = error.name.removesuffix(".gain")
            steps.append(
                f"Measure the ratio from the logged {signal} to the angle of the road wheels and correct it where "
                "columns are mapped to signals."
                if signal.startswith("steer.")
                else f"Calibrate {signal}, and correct its gain where columns are mapped to signals."
            )
    if all(fit.identified_on for fit in identification.fits) and any(
        e.verdict == "converged" for e in identification.parameters
    ):
        steps.append("Keep one log back and have it only predicted (validate): that is the proof of what was found.")
    return steps


def _for_excitation(identification: "Identification", drives: "Sequence[Drive]") -> Iterator[str]:
    elsewhere = {estimate.name for estimate, _, _ in owed(identification)}  # more driving would not help
    missing = [
        e
        for e in identification.parameters
        if (roughly(e) and e.name not in elsewhere) or (e.verdict == "not_excited" and e.sigma is not None)
    ]
    if not missing:
        return
    used = {log.name for log in identification.logs}
    peaks = [d.acceleration for d in drives if d.name in used and np.isfinite(d.acceleration)]
    if peaks and max(peaks) < HARDLY:
        yield (
            f"Drive two lane changes or more ({LANE_CHANGE}) and add that log: these logs reach only "
            f"{max(peaks):.2f} m/s² sideways, as good as straight."
        )
        return
    tyres = [e.name for e in missing if e.name.endswith("cornering_stiffness")]
    if tyres:
        yield (
            f"For {listed(tyres)}: add a log with a lane change ({LANE_CHANGE}), or bends at another speed; one speed "
            "alone does not tell the axles and the steering ratio apart."
        )
    inertias = [e.name for e in missing if e.name.endswith("yaw_inertia")]
    if inertias:
        yield f"For {listed(inertias)}: add quick lane changes or a slalom (0.3 to 0.5 Hz); slow bends hide it."
    heights = [e.name for e in missing if e.name.endswith("payload.height")]
    if heights:
        yield f"For {listed(heights)}: add lane changes that make the truck lean ({LANE_CHANGE})."


def _for_roll(identification: "Identification") -> Iterator[str]:
    for estimate in identification.parameters:
        untold = estimate.verdict == "not_identifiable" and not estimate.confused_with
        if untold or (estimate.verdict == "not_excited" and estimate.sigma is None):
            unit = estimate.name.split(".")[0]
            yield (
                f"Log the roll rate of the {unit} (roll_rate.{unit}) and identify again: without it nothing tells "
                f"{estimate.name}, the CoG height and the roll inertia."
            )


def _for_confusion(identification: "Identification") -> Iterator[str]:
    """What to hold or to measure, so that something else can be told, or told better."""
    for estimate in identification.parameters:
        if estimate.verdict == "not_identifiable" and estimate.confused_with:
            other = estimate.confused_with[0]
            if other in identification.initial_vehicle.parameters():
                yield f"To tell {estimate.name}, hold {other} at a value that is known otherwise."
            else:
                yield f"To tell {estimate.name}, calibrate what {other} is about, or add a drive of another kind."
    for estimate, name, part in owed(identification):
        rough = next(e for e in identification.rough if e.name == name)
        known = percent((rough.sigma or 0.0) / abs(rough.value))
        yield (
            f"{percent(part)} of the variance of {estimate.name} comes from {name}, known to ±{known}: "
            "measure that, or say how well it is known (--consider)."
        )


def debts(identification: "Identification", name: str) -> list[tuple[str, float]]:
    """What was only considered, and which part of a parameter's variance comes from each; the greatest first."""
    told = identification.covariance
    if told is None or name not in told.names:
        return []
    i, P = told.names.index(name), told.covariance
    kept = [e for e in identification.rough if e.verdict == "held"]
    kept += [e for e in identification.parameters if e.verdict in ("not_excited", "not_identifiable")]
    considered = [e.name for e in kept if e.name in told.names]
    parts = {other: P[i, j] ** 2 / (P[i, i] * P[j, j]) for other in considered if (j := told.names.index(other)) != i}
    return sorted(((other, float(part)) for other, part in parts.items()), key=lambda pair: -pair[1])


def owed(identification: "Identification") -> "Iterator[tuple[Estimate, str, float]]":
    """Parameters with a wide sigma that is mostly due to one thing that was only considered, and which part of it."""
    rough = {e.name for e in identification.rough}
    for estimate in identification.parameters:
        if estimate.verdict != "converged" or not estimate.sigma or estimate.sigma < WIDE * abs(estimate.value):
            continue
        for worst, part in debts(identification, estimate.name)[:1]:
            if part > MOSTLY and worst in rough:
                yield estimate, worst, part


def _reckoned(identification: "Identification", outlook: "Outlook | None") -> list[str]:
    """What a change would bring for parameters that the logs did not tell, by reckoning; of those that they told more
    poorly than noise alone explains, noise alone does not tell what would help."""
    if outlook is None:
        return []
    untold = {e.name for e in identification.parameters if e.verdict in ("not_excited", "not_identifiable")}
    changes: dict[str, list[str]] = {}
    for prospect in outlook.parameters:
        if prospect.name not in untold:
            continue
        for remedy in prospect.remedies:
            if remedy.known:
                continue
            words = [f"{remedy.channel} logged"] if remedy.channel else []
            if remedy.drive == "lane_change":
                words.append(f"one lane change (SAE J2179) at {3.6 * outlook.speed:.0f} km/h")
            elif remedy.drive:
                words.append("the same drive once more")
            told = f"{prospect.name} to ±{relative(prospect.value, remedy.sigma)}"
            changes.setdefault(" and ".join(words), []).append(told)
    return [f"By reckoning, {change} would tell {listed(names)}, at best." for change, names in changes.items()]
