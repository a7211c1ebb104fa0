"""Speed and steer angles of an observer: an implausible value counts as missing, a missing one keeps its last value.

The derivative of the speed, if the model has it as an input, is computed from the plausible speeds. `HeldInputs`
processes one sample at a time, `held_inputs` a record; both give the same result. Both are causal.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from fifthwheel._types import Array
from fifthwheel.checks.samples import limit_of
from fifthwheel.dynamics import SPEED_RATE
from fifthwheel.dynamics.speed_rate import SpeedRate, speed_rates
from fifthwheel.observe.settings import ObserverSettings
from fifthwheel.record import Record

SHORTEST = 0.01
"""s; the change of this time is plausible within any shorter time, because of noise and repeated samples."""


def magnitude(name: str) -> float:
    """Largest magnitude of a signal of a heavy vehicle, SI."""
    limit = limit_of(name)
    return limit.magnitude if limit else math.inf


def largest_rate(name: str, settings: ObserverSettings) -> float:
    """Largest rate of change of an input, SI per second."""
    return settings.max_acceleration if name == "speed" else settings.max_steer_rate


def follows(value: float, last: float, age: float, rate: float, hold: float) -> bool:
    """Whether a value can follow the last plausible one.

    Args:
        value, last: SI; `last` is NaN before the first plausible value.
        age: time since the last plausible value, s.
        rate: largest rate of change, SI per second.
        hold: age beyond which every value is plausible, s: the last one is outdated, or was the wrong one.
    """
    return abs(value - last) <= rate * max(SHORTEST, age) or not age <= hold


class HeldInputs:
    """The last plausible speed and steer angles, when each was measured, and the derivative of the speed.

    Args:
        names: of the inputs of the model; `SPEED_RATE` is the last one, if it is one.
        settings: hold, largest rates of change and the time constant of the derivative.
    """

    def __init__(self, names: Sequence[str], settings: ObserverSettings) -> None:
        measured = measured_inputs(names)
        self.hold = settings.hold
        self.values = [math.nan] * len(measured) + [0.0] * (len(names) - len(measured))
        self.times = [-math.inf] * len(measured)  # s
        self.speed_rate = SpeedRate(settings.speed_smoothing, settings.max_gap) if SPEED_RATE in names else None
        self._limits = [(i, n, magnitude(n), largest_rate(n, settings)) for i, n in enumerate(measured)]

    def update(self, time: float, sample: Mapping[str, float | None]) -> bool:
        """Take the plausible inputs of a sample; whether every input is then at most `hold` seconds old."""
        fresh, values, times, hold = True, self.values, self.times, self.hold
        for i, name, largest, rate in self._limits:
            value, age = sample.get(name), time - times[i]
            # the magnitude of a value that is NaN or infinite is not below the largest one
            if value is not None and abs(value) <= largest and follows(value, values[i], age, rate, hold):
                values[i], times[i] = float(value), time
                if self.speed_rate and name == "speed":
                    values[-1] = self.speed_rate.update(age, values[i])
            elif not age <= hold:
                fresh = False
        return fresh


def measured_inputs(names: Sequence[str]) -> tuple[str, ...]:
    """The inputs that are signals of a log: speed and steer angles."""
    return tuple(name for name in names if name != SPEED_RATE)


def held_inputs(record: Record, names: Sequence[str], settings: ObserverSettings) -> tuple[Array, NDArray[np.bool_]]:
    """Inputs (N, k), with the last value where one is missing, and whether all are at most `hold` seconds old (N,).

    Arguments as in `HeldInputs`.
    """
    columns, derived, fresh = list[Array](), list[Array](), np.ones(len(record.time), dtype=bool)
    for name in measured_inputs(names):
        values = record.signals[name]
        present = plausible(name, record.time, values, settings)
        last = np.maximum.accumulate(np.where(present, np.arange(len(values)), -1))
        age = record.time - record.time[np.maximum(last, 0)]
        fresh &= (last >= 0) & (age <= settings.hold)
        columns.append(np.where(last >= 0, values[np.maximum(last, 0)], np.nan))
        if name == "speed" and SPEED_RATE in names:
            rates = speed_rates(record.time[present], values[present], settings.speed_smoothing, settings.max_gap)
            derived.append(np.append(0.0, rates)[np.cumsum(present)])
    return np.column_stack([*columns, *derived]), fresh


def plausible(name: str, time: Array, values: Array, settings: ObserverSettings) -> NDArray[np.bool_]:
    """Which values (N,) of an input are plausible."""
    rate, hold, present = largest_rate(name, settings), settings.hold, within_magnitude(name, values)
    indices = np.flatnonzero(present)
    steps = np.diff(time[indices])
    jumps = np.abs(np.diff(values[indices])) > rate * np.maximum(SHORTEST, steps)
    if not (jumps & (steps <= hold)).any():
        return present
    last, last_time = math.nan, -math.inf
    samples = zip(indices.tolist(), time[indices].tolist(), values[indices].tolist(), strict=True)
    for i, at, value in samples:
        if follows(value, last, at - last_time, rate, hold):
            last, last_time = value, at
        else:
            present[i] = False
    return present


def within_magnitude(name: str, values: Array) -> NDArray[np.bool_]:
    """Which values (N,) a heavy vehicle can reach; False where missing."""
    return np.asarray(np.abs(values) <= magnitude(name))
