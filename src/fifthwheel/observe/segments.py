"""Segments of a record that a filter processes without a new start. Causal: a missing input keeps its last value."""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fifthwheel._types import Array
from fifthwheel.dynamics import ChainModel, steps
from fifthwheel.filters.model import sample_rows
from fifthwheel.observe.settings import ObserverSettings
from fifthwheel.observe.states import Status
from fifthwheel.record import Record

MAX_SPEED = float(steps.SPEEDS[-1])
"""A speed above this, m/s, counts as missing: no truck reaches it, and the model would need ever shorter steps."""


@dataclass(frozen=True, kw_only=True)
class ObserverSegment:
    """N consecutive samples as M rows of a compiled step."""

    samples: slice  # of the record
    rows: Array  # (M, 1 + n_d + 2 n_y), from `model.sample_rows`
    sample_indices: NDArray[np.int64]  # (N,) indices of the samples among the rows
    first: dict[str, float]  # speed and steer angles at the first sample, by name


def observer_segments(
    record: Record, model: ChainModel, settings: ObserverSettings, limit: steps.StepLimit
) -> tuple[NDArray[np.int8], list[ObserverSegment]]:
    """Status (N,) of every sample as determined by the inputs, and the segments in which it is OK.

    Raises:
        SignalError: a gap between samples needs too many steps; see `steps.step_counts`.
    """
    time, N = record.time, len(record.time)
    inputs, fresh = held_inputs(record, model.inputs, settings.hold)
    slow = inputs[:, 0] < settings.min_speed
    status = np.where(~fresh, Status.INPUT_MISSING, np.where(slow, Status.TOO_SLOW, Status.OK)).astype(np.int8)
    ok = status == Status.OK
    gap = np.diff(time, prepend=time[0]) > settings.max_gap
    begins = np.flatnonzero(ok & (~np.concatenate([[False], ok[:-1]]) | gap))
    measured = np.column_stack([record.signals[name] for name in model.outputs])
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


def held_inputs(record: Record, names: tuple[str, ...], hold: float) -> tuple[Array, NDArray[np.bool_]]:
    """Inputs (N, k), with the last value where one is missing, and whether all are at most `hold` seconds old (N,)."""
    columns, fresh = [], np.ones(len(record.time), dtype=bool)
    for name in names:
        values = record.signals[name]
        present = np.isfinite(values) & ((name != "speed") | (values <= MAX_SPEED))
        last = np.maximum.accumulate(np.where(present, np.arange(len(values)), -1))
        age = record.time - record.time[np.maximum(last, 0)]
        fresh &= (last >= 0) & (age <= hold)
        columns.append(np.where(last >= 0, values[np.maximum(last, 0)], np.nan))
    return np.column_stack(columns), fresh


def without_measurement(time: Array, accepted: Array, coast: float) -> NDArray[np.bool_]:
    """Samples (N,) of a segment for which no channel (N, m) was accepted for longer than `coast` seconds."""
    last = np.maximum.accumulate(np.where(accepted.any(axis=1), time, time[0]))
    return np.asarray(time - last > coast)
