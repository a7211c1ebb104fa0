"""Gauss-Newton steps within a region of trust, on the normal equations of a least-squares problem with a prior.

Levenberg (1944) and Marquardt (1963) in the form of More (1978): the step is the Gauss-Newton step where that lies
within the region, else the best one of the region's length; the region grows and shrinks with what the last step kept
of its promise. Unknowns are of order one (their prior's standard deviation), so the region is a ball.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RADIUS = 2.0
"""Of the region at the start, in prior standard deviations."""


class Quadratic(NamedTuple):
    """A cost about a point: cost + gradient' s + s' hessian s / 2."""

    cost: float
    gradient: Array  # (k,)
    hessian: Array  # (k, k) positive definite


@dataclass(frozen=True, kw_only=True)
class Minimum:
    """Where the search ended."""

    z: Array  # (k,)
    at: Quadratic
    converged: bool
    steps: int


def minimise(
    expand: Callable[[Array], Quadratic],
    cost: Callable[[Array], float],
    accept: Callable[[Array], None],
    z: Array,
    *,
    lower: Array,
    upper: Array,
    iterations: int,
    small: float = 0.02,
    progress: Callable[[int, int], None] = lambda *_: None,
) -> Minimum:
    """The minimum of a cost near z.

    Args:
        expand: the cost's expansion at a point.
        cost: the cost alone, infinite or NaN where there is none.
        accept: called with every point that is taken; the cost may change with it (its weights, its noise).
        z: (k,) to begin with.
        lower, upper: bounds of z (k,).
        iterations: at most so many steps.
        small: converged when a full step moves nothing by more than this part of its standard deviation.
        progress: called with steps done and their most.
    """
    radius, here, steps = RADIUS, expand(z), 0
    while steps < iterations:
        progress(steps, iterations)
        steps += 1
        free = ~(((z <= lower) & (here.gradient > 0)) | ((z >= upper) & (here.gradient < 0)))
        own = here.gradient[free], here.hessian[np.ix_(free, free)]
        whole, step = np.zeros_like(z), np.zeros_like(z)
        whole[free], _ = within(*own, np.inf)
        if (np.abs(np.clip(z + whole, lower, upper) - z) <= small * _deviations(here.hessian)).all():
            return Minimum(z=z, at=here, converged=True, steps=steps)
        step[free], inside = within(*own, radius)
        step = np.clip(z + step, lower, upper) - z
        promised = -(here.gradient @ step + step @ here.hessian @ step / 2)
        gained = here.cost - cost(z + step)
        ratio = gained / promised if promised > 0 and np.isfinite(gained) else -1.0
        length = float(np.linalg.norm(step))
        if ratio < 0.25:
            radius = length / 4
        elif ratio > 0.75 and not inside:
            radius *= 2
        if ratio > 1e-3:
            z = z + step
            accept(z)
            here = expand(z)
        elif radius < 1e-9:  # the cost does not keep what its derivatives promise
            return Minimum(z=z, at=here, converged=False, steps=steps)
    return Minimum(z=z, at=here, converged=False, steps=steps)


def within(gradient: Array, hessian: Array, radius: float) -> tuple[Array, bool]:
    """The minimiser of a quadratic in a ball, and whether it is the quadratic's own."""
    values, vectors = np.linalg.eigh(hessian)
    values = np.maximum(values, 1e-12 * values.max(initial=1.0))
    along = -vectors.T @ gradient
    if np.linalg.norm(along / values) <= radius:
        return vectors @ (along / values), True
    low, high = 0.0, float(np.linalg.norm(gradient)) / radius
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if np.linalg.norm(along / (values + middle)) > radius else (low, middle)
    return vectors @ (along / (values + high)), False


def _deviations(hessian: Array) -> Array:
    return np.sqrt(np.diag(np.linalg.inv(hessian)))
