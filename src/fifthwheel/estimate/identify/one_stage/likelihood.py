"""The loss of a block of residuals, with its gradient and its Fisher information.

For a residual e with variance s^2 the loss is rho(e / s) [+ log s], with rho of Huber (1964): quadratic up to a limit c
and linear beyond,

    rho(r) = r^2 / 2               |r| <= c,
    rho(r) = c |r| - c^2 / 2       |r| >  c,

so that an outlier has a bounded effect. With the weight w = min(1, c / |r|) / s^2, the variance v = s^2 and the
derivatives e_z and v_z of residual and variance with respect to the unknowns (column vectors), a residual contributes

    gradient       w e e_z      [+ (1 - w e^2) v_z / (2 v)],
    information    w e_z e_z'   [+ v_z v_z' / (2 v^2)].

The terms in brackets apply where the variance depends on the unknowns.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fifthwheel.base.types import Array


@dataclass(frozen=True, kw_only=True)
class ResidualBlock:
    """Residuals of N consecutive samples and m channels, and their derivatives by k of the unknowns."""

    time: Array  # (N,) s
    error: Array  # (N, m), NaN where missing or rejected
    variance: Array  # (N, m) of each error
    jacobian: Array  # (N, m, k) of the errors
    variance_jacobian: Array | None  # (N, m, k), None if the variance does not depend on the unknowns
    indices: NDArray[np.int64]  # (k,) of these unknowns among all

    def split(self, size: int) -> "Iterator[ResidualBlock]":
        """Blocks of `size` samples each; the last may be shorter."""
        for begin in range(0, len(self.time), size):
            rows = slice(begin, begin + size)
            yield replace(
                self,
                time=self.time[rows],
                error=self.error[rows],
                variance=self.variance[rows],
                jacobian=self.jacobian[rows],
                variance_jacobian=None if self.variance_jacobian is None else self.variance_jacobian[rows],
            )


def loss(block: ResidualBlock, limit: float) -> float:
    """Sum of the loss over all samples and channels; `limit` in standard deviations."""
    present = ~np.isnan(block.error)
    size = np.abs(block.error[present]) / np.sqrt(block.variance[present])
    total = huber(size, limit).sum()
    if block.variance_jacobian is not None:
        total += np.log(block.variance[present]).sum() / 2
    return float(total)


def log_density(block: ResidualBlock, limit: float) -> float:
    """Sum of the logarithm of Huber's density exp(-rho(e / s)) / (s c) over all samples and channels.

    c is the integral of exp(-rho), sqrt(2 pi) for a large limit.
    """
    present = ~np.isnan(block.error)
    size, variance = np.abs(block.error[present]) / np.sqrt(block.variance[present]), block.variance[present]
    tails = 2 * math.exp(-(limit**2) / 2) / limit
    constant = math.log(math.sqrt(2 * math.pi) * math.erf(limit / math.sqrt(2)) + tails)
    return -float(huber(size, limit).sum() + np.log(variance).sum() / 2 + size.size * constant)


def huber(size: Array, limit: float) -> Array:
    """rho of normalised residuals, by their magnitude."""
    return np.where(size <= limit, size**2 / 2, limit * size - limit**2 / 2)


def gradient_and_information(block: ResidualBlock, limit: float) -> tuple[Array, Array]:
    """Gradient of the loss (k,), and Fisher information (k, k)."""
    error, present, weight = weights(block.error, block.variance, limit)
    k, root = len(block.indices), np.sqrt(weight)
    rows = (block.jacobian * root[..., None]).reshape(root.size, k)
    gradient, gram = (root * error).ravel() @ rows, rows.T @ rows
    if block.variance_jacobian is not None:
        relative = (block.variance_jacobian * (present / block.variance)[..., None]).reshape(root.size, k)
        gradient += (present - weight * error**2).ravel() @ relative / 2
        gram += relative.T @ relative / 2
    return gradient, gram


def scores(block: ResidualBlock, limit: float) -> Array:
    """Gradient of the loss of each sample (N, k)."""
    error, present, weight = weights(block.error, block.variance, limit)
    gradients = np.einsum("nm,nmk->nk", weight * error, block.jacobian)
    if block.variance_jacobian is not None:
        factor = (present - weight * error**2) / (2 * block.variance)
        gradients += np.einsum("nm,nmk->nk", factor, block.variance_jacobian)
    return np.asarray(gradients)


def weights(error: Array, variance: Array, limit: float) -> tuple[Array, NDArray[np.bool_], Array]:
    """Errors, zero where missing; which are present; and the weight of each, 1/variance or less: (N, m)."""
    present = ~np.isnan(error)
    error = np.where(present, error, 0.0)
    size = np.abs(error) / np.sqrt(variance)
    return error, present, present * np.minimum(1.0, limit / np.maximum(size, 1e-9)) / variance
