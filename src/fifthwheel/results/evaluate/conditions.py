"""General conditions of a test of a heavy vehicle that its log shows, after ISO 15037-2:2002.

The standard gives a frequency range of 0 to 2 Hz and a bandwidth of the measuring system of at least 5 Hz. The limits
of speed, yaw rate and steer angle below are ours. A log does not show track, wind, load and tyres.
"""

import numpy as np

from fifthwheel.base.formatting import approximate
from fifthwheel.results.evaluate.evaluation import Condition, MethodResult
from fifthwheel.results.evaluate.motion import MeasuredMotion
from fifthwheel.results.evaluate.repetitions import ENTRY, smoothed

SAMPLING = 20.0
"""Sampling rate, Hz: four times the bandwidth of 5 Hz."""
SPEED = 2 / 3.6
"""Largest deviation of the speed from its mean, m/s."""
STRAIGHT = float(np.radians(0.5))
"""Largest mean and standard deviation of the yaw rate before the first steering, rad/s; and mean steer angle, rad."""


def conditions(motion: MeasuredMotion, findings: MethodResult) -> tuple[Condition, ...]:
    """The conditions, met or not."""
    deviation = float(np.abs(motion.speed - motion.speed.mean()).max())
    constant = findings.has_constant_speed
    needed, found = f"at least {SAMPLING:g} Hz", f"{motion.rate:.3g} Hz"
    result = [Condition("sampling rate", needed, found, motion.rate >= 0.99 * SAMPLING)]
    needed = f"within {3.6 * SPEED:g} km/h of its mean" if constant else "not in this test"
    found = f"{3.6 * motion.speed.mean():.1f} km/h, within {3.6 * deviation:.1f} km/h"
    result.append(Condition("steady speed", needed, found, deviation <= SPEED if constant else None))
    for values in list(motion.outputs("yaw_rate").values())[:1]:
        largest = float(np.abs(motion.speed * smoothed(values, motion.rate)).max())
        found = f"up to {approximate(largest, 'm/s^2')}, speed × yaw rate of the first unit"
        result.append(Condition("lateral acceleration", "to be reported", found, None))
    return (*result, *_entry(motion, findings.start))


def _entry(motion: MeasuredMotion, start: float | None) -> list[Condition]:
    """Straight entry and offsets before the first steering."""
    rates = motion.outputs("yaw_rate")
    needed = f"{ENTRY:g} s, yaw rate of {approximate(STRAIGHT, 'rad/s')} at most"
    offset = f"steer angle and yaw rate of {approximate(STRAIGHT, 'rad')} and {approximate(STRAIGHT, 'rad/s')} at most"
    if start is None or not rates:
        return [Condition("straight entry", "not in this test", "–", None)]
    before = (motion.time >= start - ENTRY) & (motion.time < start)
    duration = start - motion.time[0]
    if before.sum() < 3:
        return [Condition("straight entry", needed, "no samples before the steering", False)]
    rate = smoothed(next(iter(rates.values())), motion.rate)[before]
    mean, spread, steer = float(rate.mean()), float(rate.std()), round(float(motion.steer[before].mean()), 6)
    found = f"{min(duration, ENTRY):.1f} s, {approximate(spread, 'rad/s')} rms about its mean"
    offsets = f"{approximate(steer, 'rad')} and {approximate(mean, 'rad/s')}"
    return [
        Condition("straight entry", needed, found, bool(duration >= 0.95 * ENTRY) and spread <= STRAIGHT),
        Condition("offsets before the test", offset, offsets, max(abs(mean), abs(steer)) <= STRAIGHT),
    ]
