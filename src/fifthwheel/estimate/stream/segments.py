"""The segments of a record that a filter processes without a new start, as `Stream` would, bit for bit."""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fifthwheel.base.types import Array
from fifthwheel.data.record import Record
from fifthwheel.estimate.filters.step_rows import SampleRows
from fifthwheel.estimate.stream.settings import InputRule, Status, StreamSettings
from fifthwheel.model.dynamics import simulation
from fifthwheel.model.dynamics.speed_rate import speed_rates


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
