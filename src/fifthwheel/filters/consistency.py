"""Consistency of a filter's covariance with its errors: NIS and NEES (Bar-Shalom, Li and Kirubarajan 2001, 5.4)."""

import numpy as np
from numpy.typing import ArrayLike

from fifthwheel._types import Array


def nis(innovation: Array, variance: Array, accepted: Array) -> tuple[Array, Array]:
    """Normalised innovation squared (NIS) of each sample and its degrees of freedom: (N,) and (N,).

    Args:
        innovation, variance: (N, m), of a sequential update, in which channels are uncorrelated.
        accepted: (N, m), above 0 where the measurement was used.
    """
    used = accepted > 0
    return np.where(used, innovation**2 / variance, 0.0).sum(axis=1), used.sum(axis=1).astype(float)


def nees(error: Array, covariance: Array) -> Array:
    """Normalised estimation error squared (NEES), e' P^-1 e, (...,).

    Args:
        error: e (..., n).
        covariance: P (..., n, n).
    """
    return np.asarray(np.einsum("...i,...i", error, np.linalg.solve(covariance, error[..., None])[..., 0]))


def chi_square_band(degrees: ArrayLike, count: int = 1, probability: float = 0.95) -> tuple[Array, Array]:
    """Limits between which the mean of independent chi-squares lies with a probability; shapes as `degrees`.

    Args:
        degrees: degrees of freedom of each chi-square.
        count: number of chi-squares in the mean.
        probability: of the interval, two-sided.
    """
    from scipy.special import chdtri

    total = np.asarray(degrees, dtype=float) * count
    tail = (1 - probability) / 2
    return np.asarray(chdtri(total, 1 - tail) / count), np.asarray(chdtri(total, tail) / count)
