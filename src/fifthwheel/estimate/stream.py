"""Samples for a filter, one by one or of a record: plausible and held inputs, gaps, starts, long steps and statuses."""

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from fifthwheel.base.errors import SignalError
from fifthwheel.base.types import Array
from fifthwheel.data.channels import limit_of
from fifthwheel.data.record import Record
from fifthwheel.estimate.filters.step_rows import SampleRows
from fifthwheel.model.dynamics import SPEED_RATE, simulation
from fifthwheel.model.dynamics.speed_rate import TIME_CONSTANT, SpeedRate, speed_rates


class Status(IntEnum):
    """Status of a sample; its states are NaN if it is TOO_SLOW or INPUT_MISSING.

    Example:
        >>> import fifthwheel as fw
        >>> fw.Status(2).name
        'TOO_SLOW'
    """

    OK = 0
    COASTING = 1
    """No accepted measurement for longer than `ObserverSettings.coast`: the model predicts from its inputs."""
    TOO_SLOW = 2
    """Below the lowest speed of the model."""
    INPUT_MISSING = 3
    """The speed or a steer angle is missing or implausible for longer than `ObserverSettings.hold`."""
    INCONSISTENT = 4
    """The measurements contradict the vehicle, the speed or the steer angles: `States.nis` is above
    `ObserverSettings.max_nis`. The states may be wrong by many sigmas."""
    SETTLING = 5
    """Too few samples agree since a start of the filter or a sudden input. The states are wrong if that was wrong."""


VALID = frozenset(Status) - {Status.TOO_SLOW, Status.INPUT_MISSING}
"""Statuses with which the states have values; otherwise they are NaN."""


CLOCK_RESTART = 1.0
"""s. After a time that goes back, samples in order for so long are a new start."""


def take_turn(idle: list[bool]) -> None:
    """Mark an object as in use; a SignalError if another thread uses it. `idle` has one element while it does not."""
    try:
        idle.pop()  # atomic
    except IndexError:
        raise SignalError(
            "push: another thread pushes a sample to this object; give each thread its own, or lock around push"
        ) from None


@dataclass(frozen=True, kw_only=True)
class InputRule:
    """Which values of an input are plausible; any other value counts as missing."""

    name: str
    largest: float  # magnitude, SI
    jump: float  # largest change within any time, SI: of noise and repeated samples
    rate: float  # largest change per second, SI, if that is more

    def follows(self, change: Any, age: Any, hold: float) -> Any:
        """Whether a value can follow the last plausible one, by its change and the age of that; numbers or arrays."""
        return self.agrees(change, age) | (age > hold)

    def agrees(self, change: Any, age: Any) -> Any:
        """Whether a value agrees with the last plausible one."""
        return (change <= self.jump) | (change <= self.rate * age)


@dataclass(frozen=True, kw_only=True)
class StreamSettings:
    """How a filter treats faults of its signals.

    An input that is implausible for longer than `hold` takes any value up to its largest: the last plausible one is
    outdated, or was the wrong one. So does an input of which no second value has followed the first one of a start.
    """

    inputs: tuple[InputRule, ...]  # of the speed and the steer angles
    measured: Mapping[str, float]  # largest magnitude of each measured signal, SI
    min_speed: float  # m/s; below it the status is TOO_SLOW
    hold: float  # longest time for which a missing input keeps its value, s; then the status is INPUT_MISSING
    max_gap: float  # longest time between samples without a new start, s
    coast: float  # longest time without an accepted measurement, s; then the status is COASTING
    speed_smoothing: float = TIME_CONSTANT  # of the derivative of the speed, s

    @property
    def names(self) -> tuple[str, ...]:
        """The inputs of the model."""
        return (*(rule.name for rule in self.inputs), SPEED_RATE)


def magnitude(name: str) -> float:
    """Largest magnitude of a signal of a heavy vehicle, SI."""
    limit = limit_of(name)
    return limit.magnitude if limit else math.inf


@dataclass(frozen=True, kw_only=True)
class StreamSegment:
    """N consecutive samples as M rows of a compiled step."""

    samples: slice  # of the record
    rows: SampleRows  # M
    sample_indices: NDArray[np.int64]  # (N,) indices of the samples among the rows
    first: dict[str, float]  # speed and steer angles at the first sample, by name

    def inputs(self, row: int) -> dict[str, float]:
        """Speed and steer angles at a row, by name."""
        return dict(zip(self.first, self.rows.inputs[row].tolist(), strict=True))

    def part(self, first: int, last: int) -> "StreamSegment":
        """The segment of the rows from that of a sample, `first`, to before `last`."""
        within, indices = self.samples_of(slice(first, last))
        samples = slice(self.samples.start + within.start, self.samples.start + within.stop)
        rows = self.rows.part(first, last)
        return StreamSegment(samples=samples, rows=rows, sample_indices=indices, first=self.inputs(first))

    def with_accepted(self, accepted: NDArray[np.bool_]) -> "StreamSegment":
        """The segment with the accepted (N, n_y) of its measurements only."""
        measured = np.full_like(self.rows.measured, np.nan)
        measured[self.sample_indices] = np.where(accepted, self.rows.measured[self.sample_indices], np.nan)
        return replace(self, rows=replace(self.rows, measured=measured))

    def samples_of(self, rows: slice) -> tuple[slice, NDArray[np.int64]]:
        """Those of the N samples that are among some rows, and their indices among these rows."""
        begin, end = np.searchsorted(self.sample_indices, [rows.start, rows.stop]).tolist()
        return slice(begin, end), self.sample_indices[begin:end] - rows.start


def stream_segments(
    record: Record, settings: StreamSettings, limit: simulation.StepLimit
) -> tuple[NDArray[np.int8], list[StreamSegment]]:
    """Status (N,) of every sample as determined by the inputs, and the segments in which it is OK.

    Raises:
        SignalError: a gap between samples needs too many steps; see `simulation.step_counts`.
    """
    time = record.time
    inputs, fresh = held_inputs(record, settings)
    slow = inputs[:, 0] < settings.min_speed
    status = np.where(~fresh, Status.INPUT_MISSING, np.where(slow, Status.TOO_SLOW, Status.OK)).astype(np.int8)
    ok = status == Status.OK
    gap = np.diff(time, prepend=time[0]) > settings.max_gap
    begins = np.flatnonzero(ok & (~np.concatenate([[False], ok[:-1]]) | gap))
    measured = measurements(record, settings.measured)
    segments = []
    for first, following in itertools.pairwise([*begins, len(time)]):
        stop = first + int(np.argmin(np.append(ok[first:following], False)))
        samples = slice(int(first), stop)
        fine, columns, indices = simulation.subdivide(time[samples], inputs[samples], limit(inputs[samples, 0]))
        y = measured[samples]
        if len(fine) > len(y):
            y = np.full((len(fine), measured.shape[1]), np.nan)
            y[indices] = measured[samples]
        start = dict(zip(settings.names, inputs[first].tolist(), strict=True))
        rows = SampleRows(time=fine, inputs=columns, measured=y)
        segments.append(StreamSegment(samples=samples, rows=rows, sample_indices=indices, first=start))
    return status, segments


def held_inputs(record: Record, settings: StreamSettings) -> tuple[Array, NDArray[np.bool_]]:
    """Inputs (N, k), with the last value where one is missing, and whether all are at most `hold` seconds old (N,)."""
    columns, derived, fresh = list[Array](), list[Array](), np.ones(len(record.time), dtype=bool)
    for i, rule in enumerate(settings.inputs):
        values = record.signals[rule.name]
        present = plausible(rule, settings.hold, record.time, values)
        last = np.maximum.accumulate(np.where(present, np.arange(len(values)), -1))
        age = record.time - record.time[np.maximum(last, 0)]
        fresh &= (last >= 0) & (age <= settings.hold)
        columns.append(np.where(last >= 0, values[np.maximum(last, 0)], np.nan))
        if not i:
            rates = speed_rates(record.time[present], values[present], settings.speed_smoothing, settings.max_gap)
            derived.append(np.append(0.0, rates)[np.cumsum(present)])
    return np.column_stack([*columns, *derived]), fresh


def plausible(rule: InputRule, hold: float, time: Array, values: Array) -> NDArray[np.bool_]:
    """Which values (N,) of an input are plausible."""
    present = np.asarray(np.abs(values) <= rule.largest)
    indices = np.flatnonzero(present)
    if rule.follows(np.abs(np.diff(values[indices])), np.diff(time[indices]), hold).all():
        return present
    last, last_time, confirmed = np.nan, -np.inf, False
    samples = zip(indices.tolist(), time[indices].tolist(), values[indices].tolist(), strict=True)
    for i, at, value in samples:
        age = at - last_time
        agrees = age <= hold and rule.agrees(abs(value - last), age)
        if agrees or age > hold or not confirmed:
            last, last_time, confirmed = value, at, agrees
        else:
            present[i] = False
    return present


def measurements(record: Record, largest: Mapping[str, float]) -> Array:
    """Measured signals (N, m), NaN where they are missing or implausible."""
    signals = [(record.signals[name], limit) for name, limit in largest.items()]
    return np.column_stack([np.where(np.abs(values) <= limit, values, np.nan) for values, limit in signals])


def without_measurement(time: Array, accepted: NDArray[Any], coast: float) -> NDArray[np.bool_]:
    """Samples (N,) of a segment for which no channel (N, m) was accepted for longer than `coast` seconds."""
    last = np.maximum.accumulate(np.where(accepted.any(axis=1), time, time[0]))
    return np.asarray(time - last > coast)


class StreamFilter(Protocol):
    """A filter that a stream drives."""

    @property
    def row(self) -> Any:
        """Memory of the sample [dt, d, y, weight] of its compiled step."""

    def start(self, stream: "Stream") -> None:
        """Set the state at the inputs of this sample."""

    def ends(self, stream: "Stream") -> tuple[Sequence[float], Sequence[float]]:
        """Inputs of the model at the last sample and at this one, the speed first."""

    def step(self) -> None:
        """Process a row between two samples."""

    def update(self, stream: "Stream") -> bool:
        """Process the row of a sample; whether a measurement was accepted, or the state started again."""


class Stream:
    """Takes the samples of a filter in the order of time, and writes them as rows of its compiled step.

    Args:
        settings: plausible inputs, and limits of time.
        step_limit: longest step of the model.
    """

    def __init__(self, settings: StreamSettings, step_limit: simulation.StepLimit) -> None:
        self.settings, self.step_limit = settings, step_limit
        self._back = (math.inf, math.inf, math.nan)  # first and last refused time, and the last time before them
        self._forget()

    def _forget(self) -> None:
        """Return to the state before the first sample."""
        settings = self.settings
        self.time = self.accepted = -math.inf
        """Times of the last sample and of the last accepted measurement, s."""
        self.times = [-math.inf] * len(settings.inputs)
        """When each input was measured, s."""
        self.gap = 0.0
        """Time since the last sample, s; 0 at a start."""
        self.inputs: list[float] = []
        """Speed and steer angles, and what is derived from them, at this sample, plausible or held."""
        self.last: list[float] = []
        """The same at the last sample; at a start at this one."""
        self._held = [math.nan] * len(settings.inputs) + [0.0] * (len(settings.names) - len(settings.inputs))
        self._confirmed = [False] * len(settings.inputs)  # whether a second value has followed the first one
        self._running = False  # whether there is a state
        self._rules = [(i, rule.largest, rule.jump, rule.rate) for i, rule in enumerate(settings.inputs)]
        self._largest = list(settings.measured.values())
        self._speed_rate = SpeedRate(settings.speed_smoothing, settings.max_gap)

    def process_sample(
        self, driven: StreamFilter, time: float | None, inputs: Iterable[float | None], measured: Iterable[float | None]
    ) -> Status:
        """Process speed and steer angles, and measurements, of a sample; None or NaN if missing.

        Raises:
            SignalError: the time is missing, not finite, or not after the previous one. The state has not changed.
        """
        previous = self.time
        status = self._take(time, inputs)
        if status != Status.OK:
            self._running = False
            return status
        if not self._running or self.gap > self.settings.max_gap:
            self.start(driven)
        before, after = driven.ends(self)
        gap, short = self.gap, self.step_limit.safe_step_by_speed
        if gap > short[int(after[0])] or gap > short[int(before[0])]:
            gap, before = self._divide(driven, previous, before, after)
        self._write(driven.row, gap, (*before, *after), measured)
        if driven.update(self):
            self.accepted = self.time
        self.last = self.inputs
        return Status.COASTING if self.coasts else Status.OK

    def start(self, driven: StreamFilter) -> None:
        """Start the state with this sample: no step leads to it."""
        driven.start(self)
        self.gap, self.last, self.accepted, self._running = 0.0, self.inputs, self.time, True

    @property
    def coasts(self) -> bool:
        """Whether no measurement was accepted for too long."""
        return self.time - self.accepted > self.settings.coast

    def _take(self, time: float | None, values: Iterable[float | None]) -> Status:
        """Take time and plausible inputs: OK, TOO_SLOW or INPUT_MISSING."""
        if time is None or not math.isfinite(time):
            raise SignalError(f"time: expected seconds, got {time}; give every sample its time")
        gap = time - self.time
        if gap <= 0:
            self._restart_clock(time)
            gap = math.inf
        settings, held, times, confirmed, fresh = self.settings, self._held, self.times, self._confirmed, True
        hold = settings.hold
        for (i, largest, jump, rate), value in zip(self._rules, values, strict=True):
            age = time - times[i]
            # the magnitude of a value that is NaN or infinite is not below the largest one
            if (
                value is not None
                and abs(value) <= largest
                and (
                    (agrees := age <= hold and ((change := abs(value - held[i])) <= jump or change <= rate * age))
                    or age > hold
                    or not confirmed[i]
                )
            ):
                held[i], times[i], confirmed[i] = float(value), time, agrees
                if not i:
                    held[-1] = self._speed_rate.update(age, held[0])
            elif age > hold:
                fresh = False
        self.time, self.gap = time, gap
        if not fresh:
            return Status.INPUT_MISSING
        self.inputs = list(held)
        return Status.TOO_SLOW if held[0] < settings.min_speed else Status.OK

    def _restart_clock(self, time: float) -> None:
        """Forget all samples if times have come in order for `CLOCK_RESTART` seconds since they went back, because the
        clock was set, or one time was wrong. Else a SignalError."""
        since, last, before = self._back
        if before != self.time or not 0 < time - last <= self.settings.max_gap:
            since = time
        self._back = since, time, self.time
        if time - since < CLOCK_RESTART:
            cure = f"push samples in the order of time, or call reset; after {CLOCK_RESTART:g} s it starts by itself"
            raise SignalError(f"time: expected after {self.time:g} s, got {time:g} s; {cure}")
        self._forget()

    def _write(self, row: Any, gap: float, inputs: Sequence[float], measured: Iterable[float | None]) -> None:
        """Write duration, inputs at both ends and measurements of a step to its row."""
        row[0] = gap
        i = 1
        for value in inputs:
            row[i] = value
            i += 1
        m = len(self._largest)
        for reading, largest in zip(measured, self._largest, strict=True):
            present = reading is not None and abs(reading) <= largest
            row[i] = reading if present else 0.0
            row[i + m] = present
            i += 1

    def _divide(
        self, driven: StreamFilter, previous: float, before: Sequence[float], after: Sequence[float]
    ) -> tuple[float, Sequence[float]]:
        """Process all steps since the previous sample but the last; the length of that, and the inputs before it."""
        limits = self.step_limit(np.array([before[0], after[0]]))
        times, inputs, _ = simulation.subdivide(np.array([previous, self.time]), np.array([before, after]), limits)
        dt, d = simulation.step_inputs(times, inputs)
        memory, n_d = np.asarray(driven.row), d.shape[1]
        memory[1 + n_d :] = 0.0
        for k in range(1, len(dt) - 1):
            memory[0], memory[1 : 1 + n_d] = dt[k], d[k]
            driven.step()
        return float(dt[-1]), d[-1, : len(before)].tolist()

    def save(self) -> dict[str, Any]:
        """All that changes, for `resume` and JSON."""

        def finite(values: Iterable[float]) -> list[float | None]:
            return [value if math.isfinite(value) else None for value in values]

        return {
            "time": finite([self.time])[0],
            "inputs": finite(self._held),
            "seen": finite(self.times),
            "confirmed": list(self._confirmed),
            "speed_rate": self._speed_rate.carry.tolist(),
            "accepted": finite([self.accepted])[0],
            "running": self._running,
            "last": finite(self.last),
        }

    def resume(self, saved: Mapping[str, Any]) -> None:
        """Continue from the result of `save`."""

        def numbers(values: Iterable[float | None], missing: float) -> list[float]:
            return [missing if value is None else value for value in values]

        self.time, self.accepted = numbers([saved["time"], saved["accepted"]], -math.inf)
        self._held, self.last = (numbers(saved[key], math.nan) for key in ("inputs", "last"))
        self.times, self._running = numbers(saved["seen"], -math.inf), saved["running"]
        self._confirmed = list(saved["confirmed"])
        self._speed_rate.carry[:] = saved["speed_rate"]
