"""What to beware of in an identification."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from fifthwheel.report import facts
from fifthwheel.report.numbers import about, digits, kmh, percent, with_sigma

if TYPE_CHECKING:
    from fifthwheel.identify import Common, Estimate, Identification, SensorError
    from fifthwheel.report.facts import Drive

ROUGH = 0.15
"""A parameter with a greater relative sigma is known roughly only."""
UNUSUAL = 2.5
"""A sensor's error beyond so many standard deviations of its prior is worth a look."""
UNUSUAL_GAIN = 0.1
"""A gain that is so far from 1, and by twice its sigma, is one too: the ratio can be measured."""
TELLING = 3.0
"""Sigmas from which a delay is no chance."""
SHORT = 0.02
"""s; a delay below changes little."""
POOR = 0.9
"""A channel of which less is explained, though its noise would allow more, is predicted poorly."""
NOTHING = 0.05
"""A channel of which less is explained, while others are explained, has nothing to do with the truck."""
HARD = 3.0
"""Sideways acceleration above which a linear truck is a rough picture, m/s^2."""


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
        signal, _, word = error.name.rpartition(".")
        value = with_sigma(error.value, error.sigma, error.unit)
        if word == "delay" and abs(error.value) > max(TELLING * error.sigma, SHORT):
            yield (
                f"{signal} seems to be {value} late, and stiffnesses stand or fall with that. Check it; where one "
                "clock stamps all channels, say so (--sensor steer_delay=5ms) and identify again."
            )
            continue
        if not unusual(identification.settings, error):
            continue
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
    moving = {fit.log for fit in identification.fits if fit.explained > 0.5}
    for fit in identification.fits:
        share = facts.share(fit)
        if fit.log in moving and fit.explained < NOTHING:
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
