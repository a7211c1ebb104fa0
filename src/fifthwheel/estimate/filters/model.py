"""The interface of a symbolic model, and the layout of carry, sample and constant vectors."""

import itertools
from collections.abc import Hashable, Sequence
from typing import Any, Protocol, cast

import casadi as ca
import numpy as np

from fifthwheel.base.types import Array
from fifthwheel.model.dynamics.symbolic import Matrix


class Model(Hashable, Protocol):
    """A symbolic discrete-time model.

    transition: (x, dt, d, p, c) -> x+, the state dt seconds later; observation: (x, d, p, c) -> y.
    x is the state, d the inputs of a sample, p the parameters that can be estimated, c all other parameters.

    Some attributes are optional. `sizes` are those of the function `sizes`. `identity`, plain values, identifies the
    model for the cache of machine code (`native.step`). `state_jacobian`, with the arguments of the transition, gives
    dx+/dx, and `observation_jacobian`, with those of the observation, dy/dx, with fewer operations than automatic
    differentiation. In place of `state_jacobian` a model may have `transition_parts`, with the same arguments, and a
    method `transition_matrix` that makes dx+/dx of their results by a few products of matrices. Further columns of
    dx+/dx and dy/dx are derivatives with respect to parameters that a filter considers.

    `rates`, (x, x+, dt, d, p, c) -> x' at the beginning and at the end of a step, gives dx+/dp by the trapezoidal rule
    with few operations. `rate_slopes`, with the arguments of the rates, gives their derivatives with respect to p, and
    `observation_slopes`, with those of the observation, dy/dx and dy/dp.
    """

    @property
    def transition(self) -> ca.Function: ...
    @property
    def observation(self) -> ca.Function: ...


def sizes(model: Model) -> tuple[int, int, int, int, int]:
    """Numbers of elements of x, d, p, c and y."""
    if given := getattr(model, "sizes", None):
        return cast(tuple[int, int, int, int, int], given)
    n_x, _, n_d, n_p, n_c = (model.transition.numel_in(i) for i in range(5))
    return n_x, n_d, n_p, n_c, model.observation.numel_out(0)


def packed_size(n: int) -> int:
    """Number of elements of the lower triangle of an n x n matrix."""
    return n * (n + 1) // 2


def pack(matrix: Matrix) -> Matrix:
    """Lower triangle by columns, (n(n+1)/2,); a covariance stored in this form is exactly symmetric."""
    n = matrix.shape[0]
    return ca.vec(matrix)[[i + n * j for j in range(n) for i in range(j, n)]]


def unpack(vector: Matrix, n: int) -> Matrix:
    """The symmetric matrix (n, n) of a lower triangle from `pack`."""
    first = [j * (2 * n - j - 1) // 2 for j in range(n)]  # place of (i, j) less i
    return ca.reshape(vector[[first[min(i, j)] + max(i, j) for j in range(n) for i in range(n)]], n, n)


def pack_array(matrix: Array) -> Array:
    """`pack` for arrays: (..., n, n) to (..., n(n+1)/2)."""
    rows, columns = np.triu_indices(matrix.shape[-1])
    return np.asarray(matrix[..., columns, rows])


def unpack_array(vector: Array, n: int) -> Array:
    """`unpack` for arrays: (..., n(n+1)/2) to (..., n, n)."""
    rows, columns = np.triu_indices(n)
    matrix = np.empty((*vector.shape[:-1], n, n))
    matrix[..., rows, columns] = vector
    matrix[..., columns, rows] = vector
    return matrix


def block_diagonal(first: Array, second: Array) -> Array:
    """The matrix with two blocks on its diagonal."""
    n, m = len(first), len(second)
    return np.block([[first, np.zeros((n, m))], [np.zeros((m, n)), second]])


def split(vector: Matrix, lengths: Sequence[int]) -> list[Matrix]:
    """Split a column vector into consecutive vectors of these lengths."""
    edges = [0, *itertools.accumulate(lengths)]
    return [vector[a:b] for a, b in itertools.pairwise(edges)]


def partitioned(name: str, *lengths: int, kind: Any = ca.SX) -> list[Any]:
    """A symbolic column vector of a CasADi type, and its consecutive parts of these lengths."""
    vector = kind.sym(name, sum(lengths))
    return [vector, *split(vector, lengths)]


def sample_rows(dt: Array, inputs: Array, measured: Array) -> Array:
    """Samples of a compiled step: [dt, d, y, weight], with weight 0 and y = 0 where y is missing.

    Args:
        dt: (N,) time since the previous row, s.
        inputs: d (N, n_d), finite.
        measured: y (N, n_y), not finite where missing.

    Returns:
        (N, 1 + n_d + 2 n_y), finite.
    """
    n_d, n_y = inputs.shape[1], measured.shape[1]
    rows = np.zeros((len(dt), 1 + n_d + 2 * n_y))
    rows[:, 0], rows[:, 1 : 1 + n_d] = dt, inputs
    present = np.isfinite(measured)
    np.copyto(rows[:, 1 + n_d : 1 + n_d + n_y], measured, where=present)
    rows[:, 1 + n_d + n_y :] = present
    return rows
