"""The longest step of the model, steps between the samples of a record, and the response of a model without noise."""

import functools
from collections.abc import Mapping

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from fifthwheel.base.errors import SignalError
from fifthwheel.base.lazy import lazy
from fifthwheel.base.native import Scan, compiled
from fifthwheel.base.types import Array
from fifthwheel.model.dynamics import ChainModel
from fifthwheel.model.dynamics.chain import relaxation_groups
from fifthwheel.model.dynamics.state_space import matrices_of_variants
from fifthwheel.model.dynamics.symbolic import LARGEST_LAG
from fifthwheel.truck import Vehicle

MAX_STEP_EIGENVALUE = 0.72
"""Largest product of the step and the magnitude of the fastest eigenvalue.

The error of a step is then below 1e-6 of the largest state. It is reached at 0.74 without and 0.92 with roll, as
measured with the catalogue's vehicles and trains of three units at 3 to 35 m/s, with relaxation lengths of 0 to 0.8 m
on all groups or on some, for 40 random states and steer angles each. `StepLimit` applies `MARGIN` in addition.
"""
MAX_LONG_STEP_EIGENVALUE = 2.0
"""The same of a long step (`symbolic.exponential_step`) without relaxation lengths. It is a limit of stability (2.8 for
oscillations): a mode that fast is hardly excited, and `step_rows` shortens steps where the steering changes fast."""

MARGIN = 1.25
"""Factor by which the fastest eigenvalue may grow while parameters are estimated."""

MAX_STEPS = 1e5
"""Largest number of steps between two samples."""

SPEEDS = np.geomspace(1.0, 60.0, 32)
"""Speeds at which the fastest eigenvalue is computed, m/s; it is interpolated between them."""


class StepLimit:
    """The longest step of a vehicle's model as a function of speed."""

    def __init__(self, vehicle: Vehicle, *, roll: bool, long_steps: bool = False) -> None:
        self.vehicle, self.roll, self.long_steps = vehicle, roll, long_steps

    @lazy
    def longest(self) -> Array:
        """Longest step at each of `SPEEDS`, s."""
        vehicle, limit, lags = self.vehicle, MAX_STEP_EIGENVALUE, np.zeros(1)
        if self.long_steps:
            paths = [f"{path}.relaxation_length" for path in relaxation_groups(vehicle)]
            lags = np.array([0.0, *[1 / vehicle.parameters()[path] for path in paths]])
            vehicle, limit = vehicle.replace(dict.fromkeys(paths, 0.0)), MAX_LONG_STEP_EIGENVALUE
        m = matrices_of_variants(vehicle, SPEEDS, list(vehicle.parameters().values()), roll=self.roll)
        fastest = np.abs(np.linalg.eigvals(m.A)).max(axis=1)
        return np.asarray(1 / (MARGIN * np.maximum(fastest / limit, lags.max() * SPEEDS / LARGEST_LAG)))

    @lazy
    def safe_step_by_speed(self) -> list[float]:
        """A step that is within the limit at all speeds from i to i + 1 m/s, for each integer i, s.

        A shorter step needs no subdivision, which a plain number decides faster than an array.
        """
        grid = np.arange(0.0, SPEEDS[-1] + 2, 1 / 16)
        limit = self(np.maximum(grid, 1 / 16)) * 0.99
        least = np.minimum.reduceat(np.minimum(limit[:-1], limit[1:]), np.arange(0, len(grid) - 1, 16))
        return list(map(float, least))

    def __call__(self, speed: Array) -> Array:
        """Longest step (N,), s, at speeds (N,), m/s.

        Below the first of `SPEEDS` eigenvalues are proportional to 1/u. Above the last one they are proportional to u
        if there are relaxation lengths.
        """
        below = np.minimum(np.asarray(speed) / SPEEDS[0], 1.0)
        above = np.minimum(SPEEDS[-1] / np.asarray(speed), 1.0)
        return np.asarray(np.interp(speed, SPEEDS, self.longest) * below * above, dtype=np.float64)


@functools.lru_cache(64)
def step_limit(vehicle: Vehicle, roll: bool, long_steps: bool = False) -> StepLimit:
    """`StepLimit`, cached."""
    return StepLimit(vehicle, roll=roll, long_steps=long_steps)


def step_counts(gap: Array, limit: Array) -> NDArray[np.int64]:
    """Number of steps (N - 1,) between N samples, by the time between them (N - 1,) and the longest steps (N,), s.

    A SignalError where a gap needs more than `MAX_STEPS` steps.
    """
    count = np.ceil(gap / np.minimum(limit[1:], limit[:-1]))
    if not (count < MAX_STEPS).all():
        i = int((~(count < MAX_STEPS)).argmax())
        raise SignalError(
            f"speed: expected fewer than {MAX_STEPS:.0g} model steps between samples {i + 1} and {i + 2}, got"
            f" {count[i]:.1g}; check the unit of the speed and the timestamps there"
        )
    return np.maximum(count, 1).astype(np.int64)


def subdivide(time: Array, inputs: Array, limit: Array) -> tuple[Array, Array, NDArray[np.int64]]:
    """Times (M,) and inputs (M, k) with enough steps between N samples, and the indices (N,) of these among the M rows.

    Inputs are interpolated linearly; `limit` (N,) is the longest step at each sample, s. Each step depends only on the
    two samples around it. A record that is processed sample by sample therefore gives the same bits. A SignalError as
    in `step_counts`.
    """
    count = step_counts(np.diff(time), limit)
    if (count == 1).all():
        return time, inputs, np.arange(len(time))
    indices = np.concatenate([[0], np.cumsum(count)])
    first = np.repeat(np.arange(len(count)), count)
    fraction = (np.arange(1, indices[-1] + 1) - indices[first]) / count[first]
    fine = np.concatenate([time[:1], time[first] + (time[first + 1] - time[first]) * fraction])
    between = inputs[first] + (inputs[first + 1] - inputs[first]) * fraction[:, None]
    between = np.concatenate([inputs[:1], between])
    fine[indices], between[indices] = time, inputs
    return fine, between, indices


def step_inputs(time: Array, inputs: Array) -> tuple[Array, Array]:
    """dt (M,) and d (M, 2 k) of `ChainModel`: the step before each row, and the inputs at its beginning and its end.

    The first row has no step before it: its dt is 0, and both halves of its d are equal.
    """
    before = np.vstack([inputs[:1], inputs[:-1]])
    return np.diff(time, prepend=time[0]), np.hstack([before, inputs])


def input_columns(inputs: Mapping[str, Array], names: tuple[str, ...]) -> Array:
    """Inputs by name as columns (N, k), in the order of `names`."""
    return np.column_stack([np.asarray(inputs[name], dtype=np.float64) for name in names])


def free_response(
    model: ChainModel, values: Mapping[str, float], time: Array, inputs: Mapping[str, Array], x0: Array | None = None
) -> tuple[Array, Array]:
    """States (N, n) and outputs (N, m) of a model without free parameters, from its state x0 at the first sample.

    `values` are all its parameters, `inputs` speed and steer angles (N,), by name, SI. A SignalError as in
    `step_counts`.
    """
    columns = input_columns(inputs, model.inputs)
    vehicle = model.vehicle.replace({name: values[name] for name in model.vehicle.parameters()})
    limit = step_limit(vehicle, model.roll, model.long_steps)(columns[:, 0])
    fine, columns, indices = subdivide(time, columns, limit)
    dt, d = step_inputs(fine, columns)
    start = np.zeros(len(model.states)) if x0 is None else x0
    _, out = _simulator(model)(start, np.column_stack([dt, d]), model.known_values(values))
    samples = out[indices]
    return samples[:, : len(model.states)], samples[:, len(model.states) :]


@compiled(Scan)
def _simulator(model: ChainModel) -> ca.Function:
    """The compiled step: carry = x; sample = [dt, d]; constant = c; output = [x+, y]."""
    n, k, c = len(model.states), 2 * len(model.inputs), len(model.known)
    x, row, constant = ca.SX.sym("x", n), ca.SX.sym("row", 1 + k), ca.SX.sym("c", c)
    no_p = ca.SX(0, 1)
    later = model.transition(x, row[0], row[1:], no_p, constant)
    y = model.observation(later, row[1:], no_p, constant)
    return ca.Function("simulate", [x, row, constant], [later, ca.vertcat(later, y)], {"cse": True})
