"""What to beware of in an identification, and what to do next."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from fifthwheel.report import facts
from fifthwheel.report.numbers import about, digits, percent, with_sigma

if TYPE_CHECKING:
    from fifthwheel.identify import Common, Estimate, Identification, SensorError
    from fifthwheel.report.facts import Drive

ROUGH = 0.15
"""A parameter with a greater relative sigma is known roughly only."""
WIDE = 0.05
"""A relative sigma from which it is told what it comes from."""
MOSTLY = 0.5
"""A part of a variance that is worth naming."""
UNUSUAL = 2.5
"""A sensor's error beyond so many standard deviations of its prior is worth a look."""
UNUSUAL_GAIN = 0.1
"""A gain that is so far from 1, and by twice its sigma, is one too: the ratio can be measured."""
POOR = 0.9
"""A channel of which less is explained, though its noise would allow more, is predicted poorly."""
NOTHING = 0.05
"""A channel of which less is explained, while others are explained, has nothing to do with the truck."""
HARDLY = 0.5
"""Sideways acceleration up to which a log counts as straight, m/s^2."""
HARD = 3.0
"""Sideways acceleration above which a linear truck is a rough picture, m/s^2."""

LANE_CHANGE = "1.5 m sideways within 60 m at 80 to 90 km/h, about 1.5 m/s²"


def roughly(estimate: "Estimate") -> bool:
    """Whether a known parameter has a wide sigma."""
    if estimate.verdict != "converged" or estimate.sigma is None:
        return False
    return estimate.sigma > ROUGH * abs(estimate.value)


def sensor_prior(settings: "Common", name: str) -> tuple[float, float]:
    """Mean and standard deviation that a sensor's error was given beforehand."""
    signal, _, word = name.rpartition(".")
    if word == "gain":
        steered = signal.startswith("steer.")
        return 1.0, settings.steer_gain_prior if steered else getattr(settings, "rate_gain_prior", UNUSUAL_GAIN)
    if word == "delay":
        return 0.0, settings.steer_delay_prior
    if signal.startswith("steer."):
        return 0.0, settings.steer_offset_prior
    return 0.0, settings.articulation_offset_prior if signal.startswith("articulation.") else settings.rate_offset_prior


def unusual(settings: "Common", error: "SensorError") -> bool:
    """Whether a sensor's error is far from what was expected, for a gain from 1."""
    mean, sigma = sensor_prior(settings, error.name)
    if error.name.startswith("steer.") and error.name.endswith(".gain"):
        return abs(error.value - mean) > max(UNUSUAL_GAIN, 2 * error.sigma)
    return abs(error.value - mean) > UNUSUAL * sigma


def sensor_cautions(identification: "Identification") -> Iterator[str]:
    """Sensors whose errors are suspicious."""
    for error in identification.sensors:
        if not unusual(identification.settings, error):
            continue
        signal, _, word = error.name.rpartition(".")
        value = with_sigma(error.value, error.sigma, error.unit)
        where = f" in {error.log}" if error.log else ""
        if word == "gain" and not signal.startswith("steer."):
            yield f"{signal} seems to show {value} times what there is; check its calibration or its unit."
        elif word == "gain":
            yield (
                f"{signal} seems to turn the wheels {value} times as far as logged: a wrong steering ratio looks "
                "like a wrong tyre stiffness, so stiffnesses and this gain stand or fall together."
            )
        elif word == "delay":
            yield f"{signal} seems to be {value} late; check that all channels have the same clock."
        else:
            yield f"{signal} has a zero of {value}{where}, more than such a sensor usually has."


def value_cautions(identification: "Identification") -> Iterator[str]:
    """Stiffnesses and inertias that are much further from the vehicle file than was assumed."""
    prior = identification.settings.prior
    for estimate in identification.parameters:
        if estimate.verdict != "converged" or estimate.name.endswith(".payload.height"):
            continue
        times = estimate.value / estimate.initial
        if times > 0 and abs(np.log(times)) > UNUSUAL * prior:
            yield (
                f"{estimate.name} is {digits(times, 2)} times the vehicle file's, ±{percent(prior)} was assumed: check "
                "masses, axle positions and the steer angle, and believe it only when another log agrees."
            )


def fit_cautions(identification: "Identification") -> Iterator[str]:
    """Channels that the identified truck predicts poorly, and channels with many outliers."""
    moving = any(fit.explained > 0.5 for fit in identification.fits)
    for fit in identification.fits:
        share = facts.share(fit)
        if moving and fit.explained < NOTHING:
            yield (
                f"Next to nothing of {fit.signal} in {fit.log} follows from how the truck was driven: check that this "
                "column is what it is called, and do not believe what rests on it."
            )
            continue
        if fit.explained >= POOR or share.by_noise:
            continue
        kind = "" if fit.identified_on else " (predicted only)"
        limit = f", sensor noise about {about(share.noise, facts.unit_of(fit.signal))}"
        yield (
            f"Of {fit.signal} in {fit.log}{kind} only {percent(max(fit.explained, 0.0), of_whole=True)} is explained; "
            f"residual {about(fit.rms, facts.unit_of(fit.signal))} rms{limit if np.isfinite(share.noise) else ''}."
        )
    for log in identification.logs:
        for name, part in log.rejected.items():
            if part > 0.05:
                yield f"{percent(part)} of {name} in {log.name} lie outside the gate and were not used."


def drive_cautions(identification: "Identification", drives: "Sequence[Drive]") -> Iterator[str]:
    """Logs that leave what the linear model, or the identification, covers."""
    used = {log.name for log in identification.logs}
    seen = [d.speed for d in drives if d.name in used and np.isfinite(d.speed[0])]
    for drive in drives:
        if drive.acceleration > HARD:
            yield (
                f"{drive.name} reaches {drive.acceleration:.1f} m/s² sideways; tyres and suspensions are linear here, "
                f"which holds to about {HARD:g} m/s²."
            )
        if drive.name in used or not seen or not np.isfinite(drive.speed[0]):
            continue
        low, high = min(s[0] for s in seen), max(s[1] for s in seen)
        if drive.speed[0] < 0.8 * low or drive.speed[1] > 1.2 * high:
            yield (
                f"{drive.name} is driven at {kmh(drive.speed)}, the truck was identified at {kmh((low, high))}: "
                "a prediction there is an extrapolation."
            )


def next_steps(identification: "Identification", drives: "Sequence[Drive]") -> list[str]:
    """What to do, the most useful first."""
    poor = [
        f.log for f in identification.fits if not f.identified_on and f.explained < POOR and not facts.share(f).by_noise
    ]
    steps = []
    if poor:
        steps.append(f"Identify on {_listed(poor)} too: what was found does not carry over to it well.")
    steps += [*_for_excitation(identification, drives), *_for_roll(identification), *_for_confusion(identification)]
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
            f"For {_listed(tyres)}: add a log with a lane change ({LANE_CHANGE}), or bends at another speed; one speed "
            "alone does not tell the axles and the steering ratio apart."
        )
    inertias = [e.name for e in missing if e.name.endswith("yaw_inertia")]
    if inertias:
        yield f"For {_listed(inertias)}: add quick lane changes or a slalom (0.3 to 0.5 Hz); slow bends hide it."
    heights = [e.name for e in missing if e.name.endswith("payload.height")]
    if heights:
        yield f"For {_listed(heights)}: add lane changes that make the truck lean ({LANE_CHANGE})."


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


def owed(identification: "Identification") -> "Iterator[tuple[Estimate, str, float]]":
    """Parameters with a wide sigma that is mostly due to one thing that was only considered, and which part of it."""
    told = identification.covariance
    if told is None:
        return
    places = {name: i for i, name in enumerate(told.names)}
    considered = [e.name for e in identification.rough if e.verdict == "held"]
    for estimate in identification.parameters:
        if estimate.verdict != "converged" or not estimate.sigma or estimate.sigma < WIDE * abs(estimate.value):
            continue
        i = places[estimate.name]
        parts = {
            name: told.covariance[i, j] ** 2 / (told.covariance[i, i] * told.covariance[j, j])
            for name, j in places.items()
            if name in considered
        }
        worst = max(parts, key=lambda name: parts[name], default=None)
        if worst is not None and parts[worst] > MOSTLY:
            yield estimate, worst, float(parts[worst])


def kmh(speed: tuple[float, float]) -> str:
    """A range of speeds, m/s, as "40 to 46 km/h"."""
    if not np.isfinite(speed[0]):
        return "–"
    low, high = (f"{3.6 * value:.0f}" for value in speed)
    return f"{low} km/h" if low == high else f"{low} to {high} km/h"


def _listed(names: Sequence[str]) -> str:
    names = list(dict.fromkeys(names))
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
