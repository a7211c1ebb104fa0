"""One run of the model through a segment: its initial state, its residuals and their derivatives, in both forms.

The initial state is the steady state of the first inputs, so it depends on the parameters. Without its derivative an
estimator takes the transient from a wrong initial state as information on the parameters.
"""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from fifthwheel.base.native import AdjointScan, DirectionScan
from fifthwheel.base.types import Array, Indices
from fifthwheel.data.channels import SensorErrorName
from fifthwheel.estimate.filters import tangent
from fifthwheel.estimate.filters.initial_state import bank_effect, equilibrium, steady_initial_state, steer_angles
from fifthwheel.estimate.filters.step_rows import StepRows
from fifthwheel.estimate.identify.one_stage.likelihood import ResidualBlock
from fifthwheel.estimate.identify.unknowns.unknown import Unknown
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics import ChainModel
from fifthwheel.truck import Vehicle

SMALL_CHANGE = 1e-3
"""Of the speed, m/s, for central differences."""


def steady_state(
    model: ChainModel, vehicle: Vehicle, inputs: Mapping[str, float], values: Mapping[str, float], bank: float = 0.0
) -> Array:
    """The steady state (n,) of constant inputs, speed and steer angles by name, on a road with a bank, rad.

    `values` of model parameters, SI, replace those of the vehicle, and give steering offsets and gains.
    """
    x0, _ = steady_initial_state(vehicle, inputs, values, roll=model.roll, bank=bank)
    return np.append(x0, bank) if model.bank else x0


def steady_state_bank_slope(
    model: ChainModel, vehicle: Vehicle, inputs: Mapping[str, float], values: Mapping[str, float]
) -> Array:
    """Derivative (n,) of `steady_state` with respect to the bank, for a model with bank."""
    _, m = steady_initial_state(vehicle, inputs, values, roll=model.roll)
    return bank_effect(m)


def steady_state_slopes(
    model: ChainModel,
    vehicle: Vehicle,
    inputs: Mapping[str, float],
    values: Mapping[str, float],
    unknowns: Sequence[Unknown],
    bank: float = 0.0,
) -> Array:
    """Derivative of `steady_state` with respect to the values of k unknowns (k, n).

    The steady state x solves F x + G d = 0, so F x' = -(F' x + (G d)'), with the derivatives of the matrices and of the
    steer angles d by central differences: they are almost linear in the parameters. It is zero for every unknown that
    changes neither a parameter of the vehicle nor the first speed or steer angle, and for an unstable vehicle.
    """
    parameters, slopes = vehicle.parameters(), np.zeros((len(unknowns), len(model.states)))
    late, speed = inputs.get(dynamics.SLOPES["speed"], 0.0), inputs["speed"]
    for i, u in enumerate(unknowns):
        if late and (rate := u.slopes.get(dynamics.SPEED_DELAY)):
            faster, slower = (
                steady_initial_state(vehicle, {**inputs, "speed": s}, values, roll=model.roll, bank=bank)[0]
                for s in (speed + SMALL_CHANGE, speed - SMALL_CHANGE)
            )
            slopes[i, : len(faster)] = rate * late * (faster - slower) / (2 * SMALL_CHANGE)
    relevant = {*parameters, *dynamics.steer_parameters(vehicle)}
    moved = {
        i: rates for i, u in enumerate(unknowns) if (rates := {n: r for n, r in u.slopes.items() if n in relevant})
    }
    if not moved:
        return slopes
    x, m = steady_initial_state(vehicle, inputs, values, roll=model.roll, bank=bank)
    state, rows, steers, steps = np.append(x, bank), [], [], []
    for i, rates in moved.items():
        steps.append(1e-3 * unknowns[i].prior_sigma)
        for step in (steps[-1], -steps[-1]):
            change = {name: step * rate for name, rate in rates.items()}
            changed = {**values, **{name: values[name] + difference for name, difference in change.items()}}
            rows.append([changed.get(name, value) for name, value in parameters.items()])
            steers.append(steer_angles(vehicle, _delayed(inputs, change), changed))
    varied = dynamics.matrices_of_variants(vehicle, inputs["speed"], np.array(rows), roll=model.roll, bank=True)
    unbalanced = np.einsum("nij,j->ni", varied.F, state) + np.einsum("nij,nj->ni", varied.G, np.array(steers))
    slope = (unbalanced[::2] - unbalanced[1::2])[:, :-1] / (2 * np.array(steps))[:, None]
    slopes[list(moved), : len(x)] = equilibrium(m, np.linalg.solve(m.E[:-1, :-1], slope.T)).T
    return slopes


def _delayed(inputs: Mapping[str, float], change: Mapping[str, float]) -> dict[str, float]:
    """First inputs after a change of parameters: a delay changes the first steer angle by its derivative."""
    changed = dict(inputs)
    for name, difference in change.items():
        error = SensorErrorName.of(name)
        if error and error.kind == "delay":
            changed[error.signal] += difference * inputs.get(dynamics.rate_input(error.signal), 0.0)
    return changed


def segment_blocks(
    scan: AdjointScan | DirectionScan,
    rows: StepRows,
    start: tuple[Array, Array],
    constant: Array,
    directions: Array,
    indices: Indices,
) -> Iterator[ResidualBlock]:
    """The outputs [residual, variance, used] of a scan for m channels at the samples of the segment.

    `start` has the carry and its derivatives along k `directions` (k, n_p) of the parameters, which belong to the
    unknowns with these `indices` (k,).
    """
    chunks = tangent.run_in_chunks(
        scan, rows, start=start[0], start_directions=start[1], constant=constant, directions=directions
    )
    for chunk in chunks:
        in_chunk, in_rows = _samples(rows, chunk.rows)
        values, slopes = chunk.values[in_chunk], chunk.slopes[in_chunk]
        m = values.shape[1] // 3
        yield ResidualBlock(
            time=rows.time[in_rows],
            error=np.where(values[:, 2 * m :] > 0, values[:, :m], np.nan),
            variance=values[:, m : 2 * m],
            jacobian=slopes[:, :m],
            variance_jacobian=slopes[:, m:] if slopes.shape[1] > m else None,
            indices=indices[chunk.directions],
        )


def _samples(rows: StepRows, chunk: slice) -> tuple[slice | Indices, slice | Indices]:
    """Which rows of a chunk are samples, counted from the start of the chunk and from the start of the segment."""
    if len(rows.sample_indices) == len(rows):  # all are; a slice avoids a copy
        return slice(None), chunk
    first, last = np.searchsorted(rows.sample_indices, (chunk.start, chunk.stop))
    indices = rows.sample_indices[first:last]
    return indices - chunk.start, indices
