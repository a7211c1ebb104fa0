"""What a filter needs to know of a system, and how its numbers lie in a carry, a sample and a constant vector."""

import itertools
from collections.abc import Hashable, Sequence
from typing import Protocol

import casadi as ca
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Model(Hashable, Protocol):
    """A discrete-time system, symbolically.

    transition: (x, dt, d, p, c) -> x+, the state dt seconds later; observation: (x, d, p, c) -> y.
    x is the state, d what a sample brings besides measurements, p the parameters that may be estimated, c the others.

    A model that knows a cheaper way to dx+/dx than to differentiate its transition offers `state_jacobian`, a function
    of the transition's arguments. One of a differential equation may offer `rates`, (x, x+, dt, d, p, c) -> x' at the
    begin and at the end of a step, from which dx+/dp is had nearly for nothing.
    """

    @property
    def transition(self) -> ca.Function: ...
    @property
    def observation(self) -> ca.Function: ...


def sizes(model: Model) -> tuple[int, int, int, int, int]:
    """Lengths of x, d, p, c and y."""
    n_x, _, n_d, n_p, n_c = (model.transition.numel_in(i) for i in range(5))
    return n_x, n_d, n_p, n_c, model.observation.numel_out(0)


def packed_size(n: int) -> int:
    """Elements of the lower triangle of an n x n matrix."""
    return n * (n + 1) // 2


def pack(matrix: ca.SX) -> ca.SX:
    """The lower triangle by columns; a covariance kept so is symmetric whatever the rounding."""
    n = matrix.shape[0]
    return ca.vertcat(*[matrix[i, j] for j in range(n) for i in range(j, n)])


def unpack(vector: ca.SX, n: int) -> ca.SX:
    """The symmetric matrix whose lower triangle `pack` wrote."""
    matrix = ca.SX(n, n)
    k = 0
    for j in range(n):
        for i in range(j, n):
            matrix[i, j] = vector[k]
            matrix[j, i] = vector[k]
            k += 1
    return matrix


def pack_array(matrix: Array) -> Array:
    """`pack` for numbers: (..., n, n) to (..., n(n+1)/2)."""
    rows, columns = np.triu_indices(matrix.shape[-1])
    return np.asarray(matrix[..., columns, rows])


def unpack_array(vector: Array, n: int) -> Array:
    """`unpack` for numbers: (..., n(n+1)/2) to (..., n, n)."""
    rows, columns = np.triu_indices(n)
    matrix = np.empty((*vector.shape[:-1], n, n))
    matrix[..., rows, columns] = vector
    matrix[..., columns, rows] = vector
    return matrix


def split(vector: ca.SX, lengths: Sequence[int]) -> list[ca.SX]:
    """Cut a column vector into consecutive pieces."""
    edges = np.concatenate([[0], np.cumsum(lengths)])
    return [vector[int(a) : int(b)] for a, b in itertools.pairwise(edges)]


def sample_rows(dt: Array, inputs: Array, measured: Array) -> Array:
    """The rows that a compiled step reads: dt, d, y, and a weight of 0 where y is missing.

    Args:
        dt: (N,) seconds since the row before.
        inputs: (N, n_d), finite.
        measured: (N, n_y), NaN where missing.

    Returns:
        (N, 1 + n_d + 2 n_y), finite.
    """
    seen = np.isfinite(measured)
    return np.column_stack([dt, inputs, np.where(seen, measured, 0.0), seen])
