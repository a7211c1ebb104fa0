"""A record cut into what a filter runs through without a new start. Causal: a missing input is held, not bridged."""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fifthwheel.dynamics import ChainModel, steps
from fifthwheel.filters.model import sample_rows
from fifthwheel.logs import Record
from fifthwheel.observe.settings import ObserverSettings
from fifthwheel.observe.states import Status

Array = NDArray[np.float64]
FASTEST = float(steps.SPEEDS[-1])
"""A speed above this, m/s, counts as missing: no truck has it, and the model's steps would have to be ever shorter."""


@dataclass(frozen=True, kw_only=True)
class Stretch:
    """Consecutive samples, N of them, cut into M steps that the model can take."""

    samples: slice  # of the record
    rows: Array  # (M, 1 + n_d + 2 n_y), for a compiled step
    places: NDArray[np.int64]  # (N,) which of the M are samples
    first: dict[str, float]  # the inputs at the first sample


def stretches(
    record: Record, model: ChainModel, settings: ObserverSettings, limit: steps.StepLimit
) -> tuple[NDArray[np.int8], list[Stretch]]:
    """Status (N,) of every sample as far as the inputs tell, and the stretches in which it is OK."""
    time, N = record.time, len(record.time)
    inputs, fresh = held(record, model.inputs, settings.hold)
    slow = inputs[:, 0] < settings.min_speed
    status = np.where(~fresh, Status.INPUT_MISSING, np.where(slow, Status.TOO_SLOW, Status.OK)).astype(np.int8)
    good = status == Status.OK
    gap = np.diff(time, prepend=time[0]) > settings.max_gap
    begins = np.flatnonzero(good & (~np.concatenate([[False], good[:-1]]) | gap))
    measured = np.column_stack([record.signals[name] for name in model.outputs])
    found = []
    for first, following in itertools.pairwise([*begins, N]):
        stop = first + int(np.argmin(np.append(good[first:following], False)))
        part = slice(int(first), stop)
        fine, columns, places = steps.subdivide(time[part], inputs[part], limit(inputs[part, 0]))
        dt, d = steps.step_inputs(fine, columns)
        y = np.full((len(fine), measured.shape[1]), np.nan)
        y[places] = measured[part]
        start = dict(zip(model.inputs, inputs[first].tolist(), strict=True))
        found.append(Stretch(samples=part, rows=sample_rows(dt, d, y), places=places, first=start))
    return status, found


def held(record: Record, names: tuple[str, ...], hold: float) -> tuple[Array, NDArray[np.bool_]]:
    """Inputs (N, k), each missing one at its last value, and whether none is older than `hold` seconds (N,)."""
    columns, fresh = [], np.ones(len(record.time), dtype=bool)
    for name in names:
        values = record.signals[name]
        seen = np.isfinite(values) & ((name != "speed") | (values <= FASTEST))
        last = np.maximum.accumulate(np.where(seen, np.arange(len(values)), -1))
        age = record.time - record.time[np.maximum(last, 0)]
        fresh &= (last >= 0) & (age <= hold)
        columns.append(np.where(last >= 0, values[np.maximum(last, 0)], np.nan))
    return np.column_stack(columns), fresh


def without_news(time: Array, accepted: Array, coast: float) -> NDArray[np.bool_]:
    """Whether at each sample (N,) of a stretch none of the channels (N, m) was used for longer than `coast` seconds."""
    since = np.maximum.accumulate(np.where(accepted.any(axis=1), time, time[0]))
    return np.asarray(time - since > coast)
