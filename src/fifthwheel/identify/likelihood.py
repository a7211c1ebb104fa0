"""What a piece of a log says of the unknowns: its loss, its gradient and its information.

rho is Huber's (1964): half the square of a normalised error up to a limit, and linear beyond, so that a spike cannot
pull without end.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Part:
    """What a piece of a section says: N samples, m channels, k unknowns of its own choice."""

    time: Array  # (N,) s
    error: Array  # (N, m), NaN where missing or refused
    variance: Array  # (N, m) of each error
    jacobian: Array  # (k, N, m) of the errors
    variance_jacobian: Array | None  # (k, N, m) where the variance depends on the unknowns
    places: NDArray[np.int64]  # (k,) of these unknowns among all

    def split(self, size: int) -> "Iterator[Part]":
        """Pieces of it with `size` samples each, the last with less."""
        for begin in range(0, len(self.time), size):
            here = slice(begin, begin + size)
            yield replace(
                self,
                time=self.time[here],
                error=self.error[here],
                variance=self.variance[here],
                jacobian=self.jacobian[:, here],
                variance_jacobian=None if self.variance_jacobian is None else self.variance_jacobian[:, here],
            )


def loss(part: Part, limit: float) -> float:
    """Sum of rho(e / s), and of log(s) where s depends on the unknowns; `limit` in standard deviations."""
    seen = ~np.isnan(part.error)
    size = np.abs(part.error[seen]) / np.sqrt(part.variance[seen])
    total = np.where(size <= limit, size**2 / 2, limit * size - limit**2 / 2).sum()
    if part.variance_jacobian is not None:
        total += np.log(part.variance[seen]).sum() / 2
    return float(total)


def information(part: Part, limit: float) -> tuple[Array, Array]:
    """Gradient of the loss (k,), and Fisher's information (k, k)."""
    error, seen, weight = _weights(part, limit)
    k, root = len(part.places), np.sqrt(weight)
    rows = (part.jacobian * root).reshape(k, -1)
    gradient, gram = rows @ (root * error).ravel(), rows @ rows.T
    if part.variance_jacobian is not None:
        relative = (part.variance_jacobian * (seen / part.variance)).reshape(k, -1)
        gradient += relative @ (seen - weight * error**2).ravel() / 2
        gram += relative @ relative.T / 2
    return gradient, gram


def scores(part: Part, limit: float) -> Array:
    """Each sample's part of the gradient (N, k)."""
    error, seen, weight = _weights(part, limit)
    found = np.einsum("nm,knm->nk", weight * error, part.jacobian)
    if part.variance_jacobian is not None:
        own = (seen - weight * error**2) / (2 * part.variance)
        found += np.einsum("nm,knm->nk", own, part.variance_jacobian)
    return np.asarray(found)


def _weights(part: Part, limit: float) -> tuple[Array, NDArray[np.bool_], Array]:
    """Errors, zero where missing; which are there; and what each counts, 1/variance but for outliers: (N, m)."""
    seen = ~np.isnan(part.error)
    error = np.where(seen, part.error, 0.0)
    size = np.abs(error) / np.sqrt(part.variance)
    return error, seen, seen * np.minimum(1.0, limit / np.maximum(size, 1e-9)) / part.variance
