"""Rows of a compiled step from a record."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fifthwheel._types import Array
from fifthwheel.dynamics import ChainModel, steps
from fifthwheel.filters.model import sample_rows
from fifthwheel.record import Record
from fifthwheel.vehicle import Vehicle


@dataclass(frozen=True, kw_only=True)
class StepRows:
    """A record of N samples as M rows, with additional rows where the model needs several steps between two samples."""

    rows: Array  # (M, 1 + n_d + 2 n_y), from `model.sample_rows`
    time: Array  # (M,) s
    sample_indices: NDArray[np.int64]  # (N,) indices of the samples among the rows
    first: dict[str, float]  # speed and steer angles at the first sample, by name
    steer_sigma: float  # standard deviation of the steer angles, rad


def steer_sigma(inputs: Mapping[str, Array]) -> float:
    """Largest standard deviation of the steer angles among the inputs, rad."""
    return max(float(np.std(values)) for name, values in inputs.items() if name != "speed")


def delay_corrected_inputs(record: Record, names: Sequence[str], errors: Mapping[str, float]) -> dict[str, Array]:
    """Inputs of a record by name, (N,) each, shifted by their delays.

    Args:
        record: of N samples.
        names: of the inputs.
        errors: of the sensors; "<name>.delay" is the delay of an input, s.

    Raises:
        SignalError: an input is missing, or has a gap that is too long.
    """
    inputs = {}
    for name in names:
        values, delay = record.input(name), errors.get(f"{name}.delay", 0.0)
        inputs[name] = np.interp(record.time + delay, record.time, values) if delay else values
    return inputs


def step_rows(
    model: ChainModel, vehicle: Vehicle, record: Record, *, errors: Mapping[str, float] | None = None
) -> StepRows:
    """Rows of a record for a model.

    Args:
        model: gives inputs and outputs.
        vehicle: with the numbers that determine the longest step.
        record: of N samples.
        errors: known errors of the steer sensors; a delay shifts the input.

    Raises:
        SignalError: an input is missing, or has a gap that is too long.
    """
    errors = errors or {}
    inputs = delay_corrected_inputs(record, model.inputs, errors)
    columns = steps.input_columns(inputs, model.inputs)
    limit = steps.step_limit(vehicle, model.roll)(columns[:, 0])
    fine, columns, indices = steps.subdivide(record.time, columns, limit)
    dt, d = steps.step_inputs(fine, columns)
    measured = np.full((len(fine), len(model.outputs)), np.nan)
    for i, name in enumerate(model.outputs):
        if name in record.signals:
            measured[indices, i] = record.signals[name]
    first = {name: float(values[0]) for name, values in inputs.items()}
    return StepRows(
        rows=sample_rows(dt, d, measured),
        time=fine,
        sample_indices=indices,
        first=first,
        steer_sigma=steer_sigma(inputs),
    )
