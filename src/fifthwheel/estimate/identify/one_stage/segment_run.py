"""One run of the model through a segment: its initial state, its residuals and their derivatives, in both forms.

The initial state is the steady state of the first inputs, so it depends on the parameters. Without its derivative an
estimator takes the transient from a wrong initial state as information on the parameters.
"""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from fifthwheel.base.native import AdjointScan, DirectionScan, GradientScan
from fifthwheel.base.types import Array, Indices
from fifthwheel.data.channels import SensorErrorName
from fifthwheel.estimate.filters import tangent
from fifthwheel.estimate.filters.initial_state import equilibrium, steer_angles
from fifthwheel.estimate.filters.step_rows import StepRows
from fifthwheel.estimate.identify.one_stage.likelihood import ResidualBlock, weights
from fifthwheel.estimate.identify.unknowns.unknown import Unknown
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics import ChainModel
from fifthwheel.truck import Vehicle

SMALL_CHANGE = 1e-3
"""Of an unknown, in prior standard deviations, for central differences."""


def steady_state_slopes(
    model: ChainModel,
    vehicle: Vehicle,
    inputs: Mapping[str, float],
    values: Mapping[str, float],
    unknowns: Sequence[Unknown],
    state: Array,
    m: dynamics.Matrices,
) -> Array:
    """Derivative of a steady state with respect to the values of k unknowns (k, n), those of the states of the model.

    The steady state x solves F x + G d = 0, so F x' = -(F' x + (G d)'), with the derivatives of the matrices and of the
    steer angles d by central differences: they are almost linear in the parameters. It is zero for every unknown that
    changes neither a parameter of the vehicle nor the first speed or steer angle, and for an unstable vehicle.

    Args:
        model: with the states.
        vehicle, inputs, values: as for `steady_initial_state`; inputs may have rates, by which delays change them.
        unknowns: (k,).
        state: the steady state, with the bank as the last one.
        m: the matrices of the steady state.
    """
    parameters, slopes = vehicle.parameters(), np.zeros((len(unknowns), len(model.states)))
    places = {name: place for place, name in enumerate(parameters)}
    of_inputs = {*dynamics.steer_parameters(vehicle), dynamics.SPEED_DELAY}
    moved = [i for i, u in enumerate(unknowns) if not (places.keys() | of_inputs).isdisjoint(u.slopes)]
    if not moved:
        return slopes
    level = _with_errors(vehicle, inputs, values, {})
    variants = np.tile([values.get(name, value) for name, value in parameters.items()], (len(moved), 2, 1))
    steps, driven = np.array([SMALL_CHANGE * unknowns[i].prior_sigma for i in moved]), []
    for i, step, pair in zip(moved, steps, variants, strict=True):
        for row, change in zip(pair, (step, -step), strict=True):
            changes = {name: change * rate for name, rate in unknowns[i].slopes.items()}
            for name in places.keys() & changes.keys():
                row[places[name]] += changes[name]
            errors = {name: changes[name] for name in of_inputs & changes.keys()}
            driven.append(_with_errors(vehicle, inputs, values, errors) if errors else level)
    speeds, steers = zip(*driven, strict=True)
    flat = variants.reshape(-1, len(parameters))
    varied = dynamics.matrices_of_variants(vehicle, speeds, flat, roll=model.roll, bank=True)
    unbalanced = np.einsum("nij,j->ni", varied.F, state) + np.einsum("nij,nj->ni", varied.G, np.array(steers))
    slope = (unbalanced[::2] - unbalanced[1::2])[:, :-1] / (2 * steps)[:, None]
    slopes[moved, : len(state) - 1] = equilibrium(m, np.linalg.solve(m.E[:-1, :-1], slope.T)).T
    return slopes


def _with_errors(
    vehicle: Vehicle, inputs: Mapping[str, float], values: Mapping[str, float], errors: Mapping[str, float]
) -> tuple[float, Array]:
    """The first speed and steer angles after changes of errors; a delay changes the first input by its derivative."""
    changed = dict(inputs)
    for name, difference in errors.items():
        error = SensorErrorName.of(name)
        if error and error.kind == "delay":
            rate = dynamics.SLOPES.get(error.signal) or dynamics.rate_input(error.signal)
            changed[error.signal] += difference * inputs.get(rate, 0.0)
    moved = {name: values[name] + difference for name, difference in errors.items()}
    return changed["speed"], steer_angles(vehicle, changed, {**values, **moved})


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
        error, variance = _residuals(values)
        m = error.shape[1]
        yield ResidualBlock(
            time=rows.time[in_rows],
            error=error,
            variance=variance,
            jacobian=slopes[:, :m],
            variance_jacobian=slopes[:, m:] if slopes.shape[1] > m else None,
            indices=indices[chunk.directions],
        )


def segment_gradient(
    scan: GradientScan,
    rows: StepRows,
    start: tuple[Array, Array],
    constant: Array,
    directions: Array,
    limit: float,
) -> Array:
    """Gradient (k,) of the loss of a segment along `directions`; arguments as in `segment_blocks`."""

    def derivatives(output: Array) -> Array:
        residual, _, weight = weights(*_residuals(output[rows.sample_indices]), limit)
        of_rows = np.zeros((len(output), residual.shape[1]))
        of_rows[rows.sample_indices] = weight * residual
        return of_rows

    carry, carry_dot = start
    gradient = scan(carry, rows[:], constant, derivatives)
    return np.asarray(np.hstack([carry_dot, directions]) @ gradient)


def _residuals(values: Array) -> tuple[Array, Array]:
    """Errors (N, m), NaN where missing, and variances (N, m) of outputs [residual, variance, used]."""
    error, variance, used = np.split(values, 3, axis=1)
    return np.where(used > 0, error, np.nan), variance


def _samples(rows: StepRows, chunk: slice) -> tuple[slice | Indices, slice | Indices]:
    """Which rows of a chunk are samples, counted from the start of the chunk and from the start of the segment."""
    if len(rows.sample_indices) == len(rows):  # all are; a slice avoids a copy
        return slice(None), chunk
    first, last = np.searchsorted(rows.sample_indices, (chunk.start, chunk.stop))
    indices = rows.sample_indices[first:last]
    return indices - chunk.start, indices
