"""Whether a filter's covariance is what its errors are: NIS and NEES (Bar-Shalom, Li and Kirubarajan 2001, 5.4)."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def nis(innovation: Array, variance: Array, accepted: Array) -> tuple[Array, Array]:
    """Normalised innovation squared of every sample, and its degrees of freedom: (N,) and (N,).

    Args:
        innovation, variance, accepted: (N, m) of a sequential update, whose channels are uncorrelated.
    """
    used = accepted > 0
    return np.where(used, innovation**2 / variance, 0.0).sum(axis=1), used.sum(axis=1).astype(float)


def nees(error: Array, covariance: Array) -> Array:
    """Normalised estimation error squared e' P^-1 e: (..., n) and (..., n, n) to (...,)."""
    return np.asarray(np.einsum("...i,...i", error, np.linalg.solve(covariance, error[..., None])[..., 0]))


def chi_square_band(degrees: ArrayLike, count: int = 1, probability: float = 0.95) -> tuple[Array, Array]:
    """Between what the mean of `count` independent chi-squares of `degrees` lies with this probability."""
    from scipy.special import chdtri

    total = np.asarray(degrees, dtype=float) * count
    tail = (1 - probability) / 2
    return np.asarray(chdtri(total, 1 - tail) / count), np.asarray(chdtri(total, tail) / count)
