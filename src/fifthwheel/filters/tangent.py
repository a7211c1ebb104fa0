"""Exact derivatives of a model or a filter with respect to its parameters and its initial state.

Forward differentiation with one direction in each lane of the compiled step. A batch with one lane for each unknown
gives the Jacobian, and one compiled step serves every choice of unknowns.
"""

import functools
import os
from collections.abc import Iterator
from typing import NamedTuple

import casadi as ca
import numpy as np

from fifthwheel._types import Array
from fifthwheel.filters import kalman
from fifthwheel.filters.model import Model, pack, pack_array, packed_size, sizes, split, unpack
from fifthwheel.native import Scan

LANES = 8
"""Number of directions in one pass of the loop."""

CHUNK = 1_000
"""Number of rows in one pass; it bounds the memory for long records and keeps it in the processor's cache."""

DECAYED = 1e-9
"""The effect of the initial state is left out once it has decayed to this fraction."""


def _with_tangent(
    name: str,
    carry: ca.SX,
    sample: ca.SX,
    p: ca.SX,
    others: ca.SX,
    later: ca.SX,
    output: ca.SX,
) -> Scan:
    """The step (carry, sample, [p, others]) -> (later, output), and its derivative along (carry', p').

    carry = [carry, carry']; constant = [p, p', others]; output = [output, output'].
    """
    carry_dot, p_dot = ca.SX.sym("carry_dot", carry.shape[0]), ca.SX.sym("p_dot", p.shape[0])
    results = ca.vertcat(later, output)
    derivative = ca.jtimes(results, ca.vertcat(carry, p), ca.vertcat(carry_dot, p_dot))
    n = later.shape[0]
    return Scan(
        ca.Function(
            name,
            [ca.vertcat(carry, carry_dot), sample, ca.vertcat(p, p_dot, others)],
            [ca.densify(ca.vertcat(later, derivative[:n])), ca.densify(ca.vertcat(output, derivative[n:]))],
            {"cse": True},
        ),
        LANES,
    )


@functools.cache
def simulation_tangent(model: Model) -> Scan:
    """The free-running model: sample = [dt, d]; output = y; others = c."""
    n_x, n_d, n_p, n_c, _ = sizes(model)
    x, row, p, c = (ca.SX.sym(name, size) for name, size in (("x", n_x), ("row", 1 + n_d), ("p", n_p), ("c", n_c)))
    later = model.transition(x, row[0], row[1:], p, c)
    y = model.observation(later, row[1:], p, c)
    return _with_tangent("simulation", x, row, p, c, later, y)


@functools.cache
def innovations_tangent(model: Model) -> Scan:
    """The Kalman filter: sample = [dt, d, y, weight]; output = [innovation, variance, accepted].

    others = [c, Q, R, gate^2], which are not differentiated.
    """
    n_x, n_d, n_p, n_c, n_y = sizes(model)
    n_P = packed_size(n_x)
    carry, sample, p, others = (
        ca.SX.sym(name, size)
        for name, size in (
            ("carry", n_x + n_P),
            ("sample", 1 + n_d + 2 * n_y),
            ("p", n_p),
            ("others", n_c + n_P + n_y + 1),
        )
    )
    x, P = split(carry, [n_x, n_P])
    dt, d, y, weight = split(sample, [1, n_d, n_y, n_y])
    c, q, r, limit = split(others, [n_c, n_P, n_y, 1])
    before, P_before, _ = kalman.predict(model, x, unpack(P, n_x), dt, d, p, c, unpack(q, n_x))
    predicted, H = kalman.observe(model, before, d, p, c)
    after, P_after, channels, _ = kalman.correct(before, P_before, predicted, H, y, weight, r, limit)
    later = ca.vertcat(after, pack(P_after))
    return _with_tangent("innovations", carry, sample, p, others, later, kalman.channel_columns(channels))


class Chunk(NamedTuple):
    """Outputs and derivatives for consecutive rows of a record."""

    rows: slice  # of the record
    values: Array  # outputs (M, n_output / 2) of M rows
    slopes: Array  # derivatives of the outputs along each of the k directions, (k, M, n_output / 2)


def run_in_chunks(
    scan: Scan,
    rows: Array,
    *,
    start: Array,
    start_directions: Array,
    p: Array,
    directions: Array,
    others: Array,
) -> Iterator[Chunk]:
    """Outputs of a step and their derivatives over a record, in chunks of rows.

    Args:
        scan: `simulation_tangent` or `innovations_tangent` of a model.
        rows: (N, n_sample).
        start: carry before the first row, (n,).
        start_directions: derivative of the start along each of the k directions, (k, n).
        p: parameters (n_p,).
        directions: derivative of p along each direction, (k, n_p).
        others: remaining constants of the step.
    """
    k = len(directions)
    carry = np.hstack([np.tile(start, (k, 1)), start_directions])
    constant = np.hstack([np.tile(p, (k, 1)), directions, np.tile(others, (k, 1))])
    half = scan.n_output // 2
    only_start = np.asarray(~directions.any(axis=1))  # directions of the start alone: their effect may decay
    initial = np.abs(start_directions).max(axis=1, initial=0.0)
    active = np.arange(k)
    for begin in range(0, len(rows), CHUNK):
        chunk = slice(begin, min(begin + CHUNK, len(rows)))
        carry, out = scan.batch(carry, rows[chunk], constant, threads=os.cpu_count() or 1)
        slopes = out[:, :, half:]
        if len(active) < k:
            slopes = np.zeros((k, *out.shape[1:2], half))
            slopes[active] = out[:, :, half:]
        yield Chunk(chunk, out[0, :, :half], slopes)
        remaining = np.abs(carry[:, len(start) :]).max(axis=1, initial=0.0)
        kept = ~only_start[active] | (remaining > DECAYED * initial[active])
        kept[0] = True  # one direction computes the outputs
        carry, constant, active = carry[kept], constant[kept], active[kept]


def initial_carry(x0: Array, P0: Array, x0_directions: Array) -> tuple[Array, Array]:
    """Carry of `innovations_tangent` before the first row, and its derivatives; the initial covariance is constant.

    Args:
        x0, P0: initial state (n,) and covariance (n, n).
        x0_directions: derivative of x0 along each of the k directions, (k, n).
    """
    packed = pack_array(P0)
    return np.concatenate([x0, packed]), np.pad(x0_directions, ((0, 0), (0, len(packed))))
