"""Live samples as signals: the signal map of a log, applied sample by sample."""

import math
from collections import deque
from collections.abc import Iterable, Mapping

import numpy as np

from fifthwheel.base.arguments import expect, expect_names
from fifthwheel.base.errors import SignalError
from fifthwheel.base.units import factor, quantity
from fifthwheel.data.channels import is_input, split_header
from fifthwheel.data.logs.assemble import SAME_INSTANT, full_turn, interpolated
from fifthwheel.data.logs.row_time import time_column
from fifthwheel.data.logs.signal_map import SignalMap, SignalSource
from fifthwheel.data.logs.source import Column, find_column
from fifthwheel.data.record.full_turns import Unwrapped

_SOURCE = "live samples"
_MEMORY = 2.0
"""Samples of an input are kept for this time beyond the latency, s; they show its typical step."""


class LiveMap:
    """Applies a signal map to live samples: units, signs, gains, offsets and delays as for a file.

    A delayed signal belongs to an earlier instant. A sample is therefore returned when all its signals are there, and
    later by the largest delay of the map. As in a file, a measurement stays at its instant, an input (speed, steer) is
    interpolated at the instants of the others, and an angle that jumps by a full turn is made continuous. Nothing is
    decimated.

    Args:
        signal_map: the map.
        columns: names of the values in a sample, with or without a [unit]; columns with the name of a signal need no
            map.

    Raises:
        SignalError: a mapped column or the time is not among the columns, or a channel has timestamps of its own.

    Example:
        >>> import fifthwheel as fw
        >>> signal_map = fw.SignalMap.parse('''
        ... [signals]
        ... speed = "v [km/h]"
        ... [signals."yaw_rate.tractor"]
        ... column = "gyro"
        ... unit = "deg/s"
        ... delay = "20 ms"
        ... ''')
        >>> live = fw.LiveMap(signal_map, ["t", "v [km/h]", "gyro"])
        >>> live.push({"t": 0.00, "v [km/h]": 72.0, "gyro": 0.0})
        [{'time': -0.02, 'yaw_rate.tractor': 0.0}]
        >>> live.push({"t": 0.02, "v [km/h]": 72.0, "gyro": 180.0})
        [{'time': 0.0, 'speed': 20.0, 'yaw_rate.tractor': 3.141592653589793}]
    """

    def __init__(self, signal_map: SignalMap, columns: Iterable[str]) -> None:
        expect("signal_map", signal_map, SignalMap)
        expect_names("columns", columns)
        self._keys = {split_header(key)[0]: key for key in columns}
        found = self._columns = {n: Column(name=n, unit=split_header(key)[1]) for n, key in self._keys.items()}
        self._angles: dict[str, Unwrapped] = {}
        self._channels: dict[str, tuple[SignalSource, list[str]]] = {}
        for signal, channel in signal_map.completed(self._keys).signals.items():
            if channel.time is not None:
                raise SignalError(f"{signal}: has timestamps of its own; give live samples one time, and delete `time`")
            if channel.derivative:
                raise SignalError(f"{signal}: live samples have no derivative; send the rate, and delete `derivative`")
            names = [find_column(text, found, _SOURCE) for text in channel.columns]
            self._channels[signal] = (channel, names)
            for name in names:
                if turn := full_turn(signal, channel, found[name].unit):
                    self._angles[self._keys[name]] = Unwrapped(turn)
        given = signal_map.time.column
        time = find_column(given, found, _SOURCE) if given else time_column(found)
        if time is None:
            raise SignalError(f"{_SOURCE}: no column named 'time' or 't'; name it as [time] column in the signal map")
        self._time = time
        self._seconds = factor(signal_map.time.unit or found[time].unit or "s", "s")
        self._delays = {signal: quantity(channel.delay, "s") for signal, (channel, _) in self._channels.items()}
        self.latency = max(0.0, *self._delays.values()) if self._delays else 0.0
        """Time after which a sample is returned, s: the largest delay."""
        self._last = -math.inf  # time of the last sample
        self._waiting: dict[float, dict[str, float]] = {}  # measurements by instant
        self._inputs: dict[str, deque[tuple[float, float]]] = {n: deque() for n in self._channels if is_input(n)}

    def convert(self, sample: Mapping[str, float | None]) -> dict[str, float]:
        """The signals of one sample in SI, without delays; NaN for a column that is absent, None or NaN."""
        signals = {}
        for signal, (channel, names) in self._channels.items():
            cells = [sample.get(self._keys[name]) for name in names]
            if any(cell is None or math.isnan(cell) for cell in cells):
                signals[signal] = math.nan
                continue
            columns = [(np.array([cell]), self._columns[name].unit) for cell, name in zip(cells, names, strict=True)]
            signals[signal] = float(channel.converted(columns, channel.si(signal))[0])
        return signals

    def push(self, sample: Mapping[str, float | None]) -> list[dict[str, float]]:
        """Add a sample; returns those that are complete, in the order of time.

        Args:
            sample: values by the names of the columns; a value is missing if it is absent, None or NaN.

        Returns:
            "time" in s, and each signal in SI; a missing signal is absent. `Observer.push` and `Learner.push` take it.

        Raises:
            SignalError: the time is missing, or not after that of the sample before. Nothing changes then.
        """
        cell = sample.get(self._keys[self._time])
        time = math.nan if cell is None else cell * self._seconds
        if not self._last < time < math.inf:
            raise SignalError(
                f"{self._time}: expected a time after {self._last:g} s, got {cell}; push samples in order"
            )
        angles = {key: cell for key in self._angles if (cell := sample.get(key)) is not None}
        continuous = {key: self._angles[key].push_live(time, cell) for key, cell in angles.items()}
        signals = self.convert({**sample, **continuous})
        self._last = time
        self._at(time)
        for signal, value in signals.items():
            at = time - self._delays[signal]
            if signal in self._inputs:
                samples = self._inputs[signal]
                samples.append((at, value))
                while len(samples) > 3 and samples[0][0] < time - self.latency - _MEMORY:
                    samples.popleft()
            elif not math.isnan(value):
                self._at(at)[signal] = value
        released = []
        for at in sorted(at for at in self._waiting if at <= time - self.latency + SAME_INSTANT):
            found = {name: self._input(name, at) for name in self._inputs} | self._waiting.pop(at)
            present = {name: found[name] for name in self._channels if not math.isnan(found.get(name, math.nan))}
            released.append({"time": at, **present})
        return released

    def _at(self, time: float) -> dict[str, float]:
        """The measurements that wait at an instant; instants closer than `SAME_INSTANT` are one."""
        same = next((at for at in self._waiting if abs(at - time) <= SAME_INSTANT), time)
        return self._waiting.setdefault(same, {})

    def _input(self, name: str, time: float) -> float:
        """An input at an instant, interpolated; NaN after its last sample."""
        if time >= self._inputs[name][-1][0] - SAME_INSTANT:
            last, value = self._inputs[name][-1]
            return value if time <= last + SAME_INSTANT else math.nan
        instants, values = np.array(self._inputs[name]).T
        nearest = int(np.abs(instants - time).argmin())
        if abs(instants[nearest] - time) <= SAME_INSTANT:
            return float(values[nearest])
        return float(interpolated(np.array([time]), instants, values)[0])
