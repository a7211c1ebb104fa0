"""Derivatives of a model or a filter with respect to its parameters and its initial state.

The nominal step is computed once, the derivatives along any number of directions in the lanes of vector registers, by
the forward or by the reverse mode. They are exact but for rounding: the reverse mode computes in single precision. One
compiled step serves every choice of unknowns.

Both steps give innovations. Those of the free-running model are y - h(x) - d, where the discrepancy d of each channel
is a first-order process, predicted from the residuals before (`estimate.filters.noise_model`): they are white.
"""

from collections.abc import Iterator
from typing import NamedTuple, Self

import casadi as ca
import numpy as np

from fifthwheel.base.native import AdjointScan, DirectionScan, GradientScan, compiled, threads
from fifthwheel.base.types import Array, Indices
from fifthwheel.estimate.filters import kalman
from fifthwheel.estimate.filters.model import Model, pack, pack_array, packed_size, partitioned, sizes, unpack
from fifthwheel.estimate.filters.step_rows import SampleRows

CHUNK = 500
"""Number of rows in one pass, of which one without derivatives has 20 times as many; it bounds the memory for long
records."""

DECAYED = 1e-9
"""The effect of the initial state is left out once it has decayed to this fraction."""


class _Simulation(NamedTuple):
    """A step of the free-running model with a discrepancy d of variance q and time constant tau for each channel.

    carry = [x, d, variance of d]; sample = [dt, d, y, weight]; constant = [p, c, r, q, tau];
    output = [innovation, variance, weight].
    """

    arguments: list[ca.SX]  # carry, sample, constant
    moving: ca.SX  # x and d
    p: ca.SX
    later: ca.SX  # x
    offsets: ca.SX  # d
    spread: ca.SX  # variance of d
    error: ca.SX  # at d = 0
    innovation: ca.SX
    total: ca.SX  # variance of the innovation
    weight: ca.SX
    phi: ca.SX  # of d, over the step
    gain: ca.SX  # of d

    @classmethod
    def of(cls, model: Model) -> Self:
        """The step of a model."""
        n_x, n_d, n_p, n_c, n_y = sizes(model)
        moving, x, offset = partitioned("moving", n_x, n_y)
        variance = ca.SX.sym("variance", n_y)
        row, dt, d, y, weight = partitioned("row", 1, n_d, n_y, n_y)
        constant, p, c, r, q, tau = partitioned("constant", n_p, n_c, n_y, n_y, n_y)
        later = model.transition(x, dt, d, p, c)
        phi = ca.exp(-dt / tau)
        predicted, spread = phi * offset, phi * phi * variance + (1 - phi * phi) * q
        error = weight * (y - model.observation(later, d, p, c))
        innovation, total = error - weight * predicted, spread + r
        gain = weight * spread / total
        arguments = [ca.vertcat(moving, variance), row, constant]
        offsets, spread = predicted + gain * innovation, spread * (1 - gain)
        return cls(arguments, moving, p, later, offsets, spread, error, innovation, total, weight, phi, gain)

    @property
    def carried(self) -> ca.SX:
        """The next carry."""
        return ca.vertcat(self.later, self.offsets, self.spread)

    @property
    def output(self) -> ca.SX:
        """The output."""
        return ca.vertcat(self.innovation, self.total, self.weight)


@compiled(DirectionScan)
def simulation_directions(model: Model) -> ca.Function:
    """The free-running model, whose innovations are differentiated by the forward mode; see `_Simulation`."""
    s = _Simulation.of(model)
    carry_dot, p_dot = ca.SX.sym("carry_dot", s.moving.shape[0]), ca.SX.sym("p_dot", s.p.shape[0])
    dots = ca.jtimes(
        ca.vertcat(s.later, s.offsets, s.innovation), ca.vertcat(s.moving, s.p), ca.vertcat(carry_dot, p_dot)
    )
    n = carry_dot.shape[0]
    results = [ca.densify(part) for part in (s.carried, s.output, dots[:n], dots[n:])]
    return ca.Function("simulation", [*s.arguments, carry_dot, p_dot], results, {"cse": True})


@compiled(AdjointScan)
def simulation_adjoint(model: Model) -> ca.Function:
    """The same by the reverse mode. It is faster for tyres that saturate, whose step is long."""
    s = _Simulation.of(model)
    n_x = s.later.shape[0]
    seed, nothing = ca.SX.sym("seed", s.moving.shape[0]), ca.SX.sym("nothing", 0)
    adjoint = ca.jtimes(ca.vertcat(s.later, s.error), ca.vertcat(s.moving[:n_x], s.p), seed, True)
    output = ca.vertcat(s.output, s.weight * s.phi, s.phi, s.gain)
    results = [ca.densify(part) for part in (s.carried, output, ca.SX(0, 1), adjoint)]
    return ca.Function("simulation", [*s.arguments, nothing, seed], results, {"cse": True})


@compiled(GradientScan)
def simulation_gradient(model: Model) -> ca.Function:
    """The same, for the gradient of a function of the innovations by [x, d, p] before the first row."""
    s = _Simulation.of(model)
    n, n_p, seed = s.moving.shape[0], s.p.shape[0], ca.SX.sym("seed", s.innovation.shape[0])
    gradient, after, by_p = partitioned("gradient", n, n_p)
    of = ca.vertcat(s.later, s.offsets, s.innovation)
    before = ca.jtimes(of, ca.vertcat(s.moving, s.p), ca.vertcat(after, seed), True) + ca.vertcat(ca.SX(n, 1), by_p)
    carry, row, constant = s.arguments
    arguments = [carry, ca.vertcat(row, seed), constant, gradient, ca.SX.sym("nothing", 0)]
    results = [ca.densify(part) for part in (s.carried, s.output, before, ca.SX(0, 1))]
    return ca.Function("simulation", arguments, results, {"cse": True})


@compiled(DirectionScan)
def innovations_tangent(model: Model) -> ca.Function:
    """The Kalman filter.

    carry = [x, P]; sample = [dt, d, y, weight]; constant = [p, c, Q, R, gate^2];
    output = [innovation, variance, accepted], of which the first two are differentiated.
    """
    n_x, n_d, n_p, n_c, n_y = sizes(model)
    n_P = packed_size(n_x)
    p = ca.SX.sym("p", n_p)
    carry, x, P = partitioned("carry", n_x, n_P)
    sample, dt, d, y, weight = partitioned("sample", 1, n_d, n_y, n_y)
    others, c, q, r, limit = partitioned("others", n_c, n_P, n_y, 1)
    before, P_before, _ = kalman.predict(model, x, unpack(P, n_x), dt, d, p, c, unpack(q, n_x))
    predicted, H = kalman.observe(model, before, d, p, c)
    after, P_after, channels, _ = kalman.correct(before, P_before, predicted, H, y, weight, r, limit)
    columns, later = kalman.channel_columns(channels), ca.vertcat(after, pack(P_after))
    carry_dot, p_dot = ca.SX.sym("carry_dot", n_x + n_P), ca.SX.sym("p_dot", n_p)
    derivative = ca.jtimes(ca.vertcat(later, columns[: 2 * n_y]), ca.vertcat(carry, p), ca.vertcat(carry_dot, p_dot))
    results = [later, columns, derivative[: n_x + n_P], derivative[n_x + n_P :]]
    arguments = [carry, sample, ca.vertcat(p, others), carry_dot, p_dot]
    return ca.Function("innovations", arguments, [ca.densify(result) for result in results], {"cse": True})


class TangentChunk(NamedTuple):
    """Outputs and derivatives for consecutive rows of a record."""

    rows: slice  # of the record
    values: Array  # outputs (M, n_output) of M rows
    slopes: Array  # derivatives of the outputs along the directions that still have an effect, (M, n_output_dot, k)
    directions: Indices  # (k,) numbers of these directions


def run_in_chunks(
    scan: AdjointScan | DirectionScan,
    rows: Array | SampleRows,
    *,
    start: Array,
    start_directions: Array,
    constant: Array,
    directions: Array,
) -> Iterator[TangentChunk]:
    """Outputs of a step and their derivatives along k directions over N rows, in chunks of rows.

    The carry before the first row and its derivatives are `start` (n_carry,) and `start_directions` (k, n_carry_dot);
    k may be 0. `directions` (k, n_p) are the derivatives of the parameters.
    """
    only_start = np.asarray(~directions.any(axis=1))  # directions of the start alone: their effect may decay
    initial = np.abs(start_directions).max(axis=1, initial=0.0)
    carry, carry_dot, active = start, start_directions, np.arange(len(directions))
    size = CHUNK if len(directions) else 2 * CHUNK
    for begin in range(0, len(rows), size):
        chunk = slice(begin, min(begin + size, len(rows)))
        result = scan(carry, rows[chunk], constant, carry_dot, directions[active], threads=threads())
        yield TangentChunk(chunk, result.output, result.output_dot, active)
        remaining = np.abs(result.carry_dot).max(axis=1, initial=0.0)
        kept = ~only_start[active] | (remaining > DECAYED * initial[active])
        carry, carry_dot, active = result.carry, result.carry_dot[kept], active[kept]


def simulation_start(x0: Array, q: Array, x0_directions: Array) -> tuple[Array, Array]:
    """Carry of `simulation_directions` and `simulation_adjoint` before the first row, and its derivatives, from the
    initial state (n,), the variances of the discrepancies (m,), and the derivatives of x0 along k directions, (k, n).
    """
    return np.concatenate([x0, np.zeros_like(q), q]), np.hstack([x0_directions, np.zeros((len(x0_directions), len(q)))])


def innovations_start(x0: Array, P0: Array, x0_directions: Array) -> tuple[Array, Array]:
    """Carry of `innovations_tangent` before the first row, and its derivatives, as `simulation_start`; the initial
    covariance (n, n) is constant."""
    packed = pack_array(P0)
    return np.concatenate([x0, packed]), np.pad(x0_directions, ((0, 0), (0, len(packed))))
