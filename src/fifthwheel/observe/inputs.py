"""Speed and steer angles of an observer: an implausible value counts as missing, a missing one keeps its last value.

`HeldInputs` processes one sample at a time, `held_inputs` a record; both give the same result. Both are causal.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from fifthwheel._types import Array
from fifthwheel.checks.samples import LIMITS
from fifthwheel.names import SignalName
from fifthwheel.observe.settings import ObserverSettings
from fifthwheel.record import Record

SHORTEST = 0.01
"""s; the change of this time is plausible within any shorter time, because of noise and repeated samples."""


def magnitude(name: str) -> float:
    """Largest magnitude of a signal of a heavy vehicle, SI."""
    return LIMITS[SignalName.of(name).quantity].magnitude


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
    """The last plausible speed and steer angles, and when each was measured.

    Args:
        names: of the inputs.
        settings: hold and largest rates of change.
    """

    def __init__(self, names: Sequence[str], settings: ObserverSettings) -> None:
        self.hold = settings.hold
        self.values = [math.nan] * len(names)
        self.times = [-math.inf] * len(names)  # s
        self._limits = [(i, n, magnitude(n), largest_rate(n, settings)) for i, n in enumerate(names)]

    def update(self, time: float, sample: Mapping[str, float | None]) -> bool:
        """Take the plausible inputs of a sample; whether every input is then at most `hold` seconds old."""
        fresh, values, times, hold = True, self.values, self.times, self.hold
        for i, name, largest, rate in self._limits:
            value, age = sample.get(name), time - times[i]
            # the magnitude of a value that is NaN or infinite is not below the largest one
            if value is not None and abs(value) <= largest and follows(value, values[i], age, rate, hold):
                values[i], times[i] = float(value), time
            elif not age <= hold:
                fresh = False
        return fresh


def held_inputs(record: Record, names: Sequence[str], settings: ObserverSettings) -> tuple[Array, NDArray[np.bool_]]:
    """Inputs (N, k), with the last value where one is missing, and whether all are at most `hold` seconds old (N,)."""
    columns, fresh = [], np.ones(len(record.time), dtype=bool)
    for name in names:
        values = record.signals[name]
        present = plausible(name, record.time, values, settings)
        last = np.maximum.accumulate(np.where(present, np.arange(len(values)), -1))
        age = record.time - record.time[np.maximum(last, 0)]
        fresh &= (last >= 0) & (age <= settings.hold)
        columns.append(np.where(last >= 0, values[np.maximum(last, 0)], np.nan))
    return np.column_stack(columns), fresh


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
