"""Segments of a record that a filter processes without a new start."""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fifthwheel._types import Array
from fifthwheel.dynamics import steps
from fifthwheel.filters.model import sample_rows
from fifthwheel.observe.inputs import held_inputs, within_magnitude
from fifthwheel.observe.observed_chain import ObservedChain
from fifthwheel.observe.settings import ObserverSettings
from fifthwheel.observe.states import Status
from fifthwheel.record import Record


@dataclass(frozen=True, kw_only=True)
class ObserverSegment:
    """N consecutive samples as M rows of a compiled step."""

    samples: slice  # of the record
    rows: Array  # (M, 1 + n_d + 2 n_y), from `model.sample_rows`
    sample_indices: NDArray[np.int64]  # (N,) indices of the samples among the rows
    first: dict[str, float]  # speed and steer angles at the first sample, by name

    def inputs(self, row: int) -> dict[str, float]:
        """Speed and steer angles at a row, by name."""
        k = len(self.first)
        return dict(zip(self.first, self.rows[row, 1 + k : 1 + 2 * k].tolist(), strict=True))

    def part(self, first: int, last: int) -> "ObserverSegment":
        """The segment of the rows from that of a sample, `first`, to before `last`."""
        begin, end = np.searchsorted(self.sample_indices, [first, last]).tolist()
        rows, k = self.rows[first:last].copy(), len(self.first)
        rows[0, 0], rows[0, 1 : 1 + k] = 0.0, rows[0, 1 + k : 1 + 2 * k]  # no step before the first row
        return ObserverSegment(
            samples=slice(self.samples.start + begin, self.samples.start + end),
            rows=rows,
            sample_indices=self.sample_indices[begin:end] - first,
            first=self.inputs(first),
        )


def observer_segments(
    record: Record, model: ObservedChain, settings: ObserverSettings, limit: steps.StepLimit
) -> tuple[NDArray[np.int8], list[ObserverSegment]]:
    """Status (N,) of every sample as determined by the inputs, and the segments in which it is OK.

    Raises:
        SignalError: a gap between samples needs too many steps; see `steps.step_counts`.
    """
    time, N = record.time, len(record.time)
    inputs, fresh = held_inputs(record, model.inputs, settings)
    slow = inputs[:, 0] < settings.min_speed
    status = np.where(~fresh, Status.INPUT_MISSING, np.where(slow, Status.TOO_SLOW, Status.OK)).astype(np.int8)
    ok = status == Status.OK
    gap = np.diff(time, prepend=time[0]) > settings.max_gap
    begins = np.flatnonzero(ok & (~np.concatenate([[False], ok[:-1]]) | gap))
    measured = measurements(record, model.outputs)
    segments = []
    for first, following in itertools.pairwise([*begins, N]):
        stop = first + int(np.argmin(np.append(ok[first:following], False)))
        samples = slice(int(first), stop)
        fine, columns, indices = steps.subdivide(time[samples], inputs[samples], limit(inputs[samples, 0]))
        dt, d = steps.step_inputs(fine, columns)
        y = np.full((len(fine), measured.shape[1]), np.nan)
        y[indices] = measured[samples]
        start = dict(zip(model.inputs, inputs[first].tolist(), strict=True))
        segments.append(
            ObserverSegment(samples=samples, rows=sample_rows(dt, d, y), sample_indices=indices, first=start)
        )
    return status, segments


def measurements(record: Record, names: tuple[str, ...]) -> Array:
    """Measured signals (N, m), NaN where they are missing or implausible."""
    columns = [record.signals[name] for name in names]
    return np.column_stack([np.where(within_magnitude(n, v), v, np.nan) for n, v in zip(names, columns, strict=True)])


def without_measurement(time: Array, accepted: Array, coast: float) -> NDArray[np.bool_]:
    """Samples (N,) of a segment for which no channel (N, m) was accepted for longer than `coast` seconds."""
    last = np.maximum.accumulate(np.where(accepted.any(axis=1), time, time[0]))
    return np.asarray(time - last > coast)
