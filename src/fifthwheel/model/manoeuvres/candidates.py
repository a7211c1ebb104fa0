"""Candidate manoeuvres of the experiment design, repeated to the left and to the right in turn."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from fifthwheel.base.formatting import approximate, fixed
from fifthwheel.base.types import Array
from fifthwheel.model.manoeuvres.accelerations import DECAY_TIME, bend, inverse_steer, swept_sine, trapezoid
from fifthwheel.model.manoeuvres.courses import LaneChange
from fifthwheel.truck import Vehicle

KINDS = {
    "lane_change": "lane change",
    "sweep": "sweep, sine from 0.2 to 1.2 Hz within 16 s",
    "random": "random steer, 0.1 to 1 Hz, for 16 s",
    "bend": "bend, entry within 1 s, 6 s constant, exit within 1 s",
}
"""Kind of a manoeuvre in words; a lane change also has a frequency."""


@dataclass(frozen=True, kw_only=True)
class CandidateManoeuvre:
    """A manoeuvre at a speed, of unit size: the largest lateral acceleration of the first unit's CoG is 1 m/s^2."""

    kind: str
    """lane_change, sweep, random or bend."""
    frequency: float | None
    """Frequency of a lane change, Hz; None for all others."""
    speed: float
    """m/s."""
    period: float
    """Time from the start of a repetition to the start of the next, s."""
    acceleration: Callable[[Array], Array]
    """Lateral acceleration (N,), m/s^2, at the time (N,), s; zero from `period` on."""

    def offset(self, size: float) -> float | None:
        """Lateral offset of a lane change of a size in m/s^2, m; None for other manoeuvres."""
        return None if self.frequency is None else size / (2 * np.pi * self.frequency**2)

    def instruction(self, size: float, *, left: bool) -> str:
        """What a driver does at a size in m/s^2: "88 km/h: lane change to the left, 1.5 m within 2.5 s"."""
        name, side = KINDS[self.kind].partition(",")[0], "left" if left else "right"
        if self.frequency is not None:
            text = f"{name} to the {side}, {self.offset(size):.1f} m within {1 / self.frequency:.1f} s"
        elif self.kind == "bend":
            text = f"{name} to the {side}, radius {fixed(self.speed**2 / size, -1)} m, 8 s"
        else:
            text = f"{KINDS[self.kind]}, first to the {side}, up to {approximate(size, 'm/s^2')}"
        return f"{3.6 * self.speed:.0f} km/h: {text}"

    def steer(self, vehicle: Vehicle, rate: float) -> Array:
        """Steer angle (N,), rad, of the first steered axle for one repetition and its decay; sampling rate in Hz."""
        time = np.arange(round((self.period + DECAY_TIME) * rate)) / rate
        return inverse_steer(vehicle, self.speed, time, self.acceleration(time))

    def repeated(self, steer: Array, count: int, rate: float) -> Array:
        """Steer angle, rad, of `count` repetitions, to the left and to the right in turn.

        The model is linear, so the steer angles (N,) of the single repetitions add.
        """
        size = round(self.period * rate)
        total = np.zeros((count - 1) * size + len(steer))
        for k in range(count):
            total[k * size :][: len(steer)] += (-1) ** k * steer
        return total[: count * size]


def candidate_manoeuvres(speed: float, frequencies: tuple[float, ...]) -> list[CandidateManoeuvre]:
    """All candidates at a speed, m/s: lane changes of the given frequencies, Hz, a sweep, random steer and a bend."""
    lane_changes = [_lane_change(speed, frequency) for frequency in frequencies]
    others = [
        CandidateManoeuvre(kind=kind, frequency=None, speed=speed, period=period, acceleration=acceleration)
        for kind, period, acceleration in (
            ("sweep", 20.0, _short_sweep),
            ("random", 20.0, _short_random),
            ("bend", 14.0, bend),
        )
    ]
    return lane_changes + others


def _lane_change(speed: float, frequency: float) -> CandidateManoeuvre:
    """The lane change of SAE J2179 with another frequency, Hz, and a peak of 1 m/s^2."""
    lane_change = LaneChange(offset=1 / (2 * np.pi * frequency**2), length=speed / frequency)
    return CandidateManoeuvre(
        kind="lane_change",
        frequency=frequency,
        speed=speed,
        period=lane_change.period(speed),
        acceleration=partial(lane_change.acceleration, speed=speed, count=1),
    )


def _short_sweep(time: Array) -> Array:
    """Swept sine of 1 m/s^2 from 0.2 to 1.2 Hz, from 1 to 17 s, (N,); it needs the width of about one lane."""
    return swept_sine(time - 1.0, 0.2, 1.2, 16.0) * trapezoid(time - 1.0, 0.0, 16.0, 1.0)


def _short_random(time: Array) -> Array:
    """Sines from 2/16 to 1 Hz with random phases, always the same, from 1 to 17 s, (N,); largest value 1 m/s^2."""
    phase = np.random.default_rng(0).uniform(0, 2 * np.pi, 15)
    sines = np.sin(2 * np.pi * np.outer(time - 1.0, np.arange(2, 17) / 16.0) + phase)
    wave = sines.sum(axis=1) * trapezoid(time - 1.0, 0.0, 16.0, 1.0)
    return np.asarray(wave / np.abs(wave).max())
