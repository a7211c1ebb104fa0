"""Gauss-Newton steps within a trust region for a least-squares problem with a prior.

Levenberg (1944) and Marquardt (1963) in the form of Moré (1978). The step s minimises the quadratic model
J + g's + s'Hs / 2 of the cost subject to ||s|| <= radius. The radius grows or shrinks with the ratio of the actual to
the predicted decrease of the cost. The unknowns are in units of their prior sigma, so the region is a ball. A full
step that is too long is shortened to the best length along its direction: a cost takes a tenth of the time of a model.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from fifthwheel.base.types import Array

INITIAL_RADIUS = 2.0
"""Of the trust region, in prior standard deviations."""
TOLERANCE = 0.03
"""Of a search, by default."""
SMALLEST_RADIUS = 1e-9
"""The search stops when the trust region is smaller: the cost does not follow its derivatives."""
SMALLEST_RATIO = 1e-3
"""A step is taken if the cost decreases by more than this fraction of the predicted decrease."""
FAIR_TRIAL = 2
"""Points that a search accepts before its cost can be hopeless: a gross error bends the first steps."""
LEAST_RATIO = -2.0
"""A step with a smaller ratio is not shortened along its direction: the trust region gives a better one."""


class Quadratic(NamedTuple):
    """Quadratic model of a cost about a point: cost + gradient's + s'hessian s / 2."""

    cost: float
    gradient: Array  # (k,)
    hessian: Array  # (k, k), positive definite


class Objective(Protocol):
    """A cost and its quadratic model, as functions of z (k,)."""

    def cost(self, z: Array, /) -> float:
        """The cost; infinite or NaN where it is not defined."""

    def expand(self, z: Array, /) -> Quadratic:
        """The quadratic model of the cost about a point."""


ObjectiveT = TypeVar("ObjectiveT", bound=Objective)


@dataclass(frozen=True, kw_only=True)
class Minimum(Generic[ObjectiveT]):
    """Result of the search."""

    objective: ObjectiveT  # of the last step
    z: Array  # (k,)
    model: Quadratic  # about z
    converged: bool
    steps: int
    lower: Array
    upper: Array  # bounds of z (k,)


def minimise(
    objective: ObjectiveT,
    z: Array,
    *,
    lower: Array,
    upper: Array,
    iterations: int,
    tolerance: float = TOLERANCE,
    radius: float = INITIAL_RADIUS,
    reweighted: Callable[[ObjectiveT, Array, int], ObjectiveT] = lambda objective, *_: objective,
    hopeless: Callable[[float], bool] = lambda _: False,
    progress: Callable[[int, int], None] = lambda *_: None,
) -> Minimum[ObjectiveT]:
    """Search a minimum of a cost from z (k,) within bounds (k,), by at most so many iterations.

    It has converged when a full step moves no unknown by more than the fraction `tolerance` of its standard deviation.
    `radius` is that of the trust region at the first step. `reweighted` gives the objective for the next step, such as
    one with other weights, from the last one, each accepted point, and the number of points accepted. After
    `FAIR_TRIAL` points, the search stops where the cost is `hopeless` that remains after twice the predicted decrease.
    `progress` is called with the number of steps done and the largest number.
    """
    steps, accepted, model, converged = 0, 0, objective.expand(z), False
    while steps < iterations:
        progress(steps, iterations)
        steps += 1
        gradient, hessian = model.gradient, model.hessian
        if not np.isfinite(hessian).all():
            break
        full_step = newton_step(z, gradient, hessian, lower, upper)
        if (np.abs(full_step) <= tolerance * _sigma(hessian, lower < upper)).all():
            converged = True
            break
        if accepted >= FAIR_TRIAL and hopeless(model.cost + float(gradient @ full_step)):
            break
        step, interior = full_step, bool(np.linalg.norm(full_step) <= radius)
        if not interior:
            free, step = ~_held(z, gradient, lower, upper), np.zeros_like(z)
            step[free] = trust_region_step(gradient[free], hessian[np.ix_(free, free)], radius)
            step = np.clip(z + step, lower, upper) - z
        slope = -float(gradient @ step)
        predicted_decrease = slope - float(step @ hessian @ step) / 2
        decrease = model.cost - objective.cost(z + step)
        usable = predicted_decrease > 0 and np.isfinite(decrease)
        ratio = decrease / predicted_decrease if usable else -1.0
        if interior and usable and ratio > LEAST_RATIO and (scale := _best_scale(slope, decrease)) < 0.75:
            shorter = np.clip(z + scale * step, lower, upper) - z
            decrease_of_shorter = model.cost - objective.cost(z + shorter)
            if decrease_of_shorter > decrease:
                step, ratio = shorter, decrease_of_shorter / predicted_decrease
        if ratio < 0.25:
            radius = float(np.linalg.norm(step)) / 4
        elif ratio > 0.75 and not interior:
            radius *= 2
        if ratio > SMALLEST_RATIO:
            z, accepted = z + step, accepted + 1
            objective = reweighted(objective, z, accepted)
            model = objective.expand(z)
        elif radius < SMALLEST_RADIUS:
            break
    return Minimum(objective=objective, z=z, model=model, converged=converged, steps=steps, lower=lower, upper=upper)


def remaining_step(minimum: Minimum[ObjectiveT]) -> Array:
    """The step (k,) that a search would take next, without a trust region."""
    return newton_step(minimum.z, minimum.model.gradient, minimum.model.hessian, minimum.lower, minimum.upper)


def _sigma(hessian: Array, free: NDArray[np.bool_]) -> Array:
    """Standard deviations (k,) of the unknowns; 0 of those that are not free.

    Where a free run diverges, the derivatives of the residuals all point along its growth, and are so large that
    rounding hides the other directions: the inverse is then not positive definite. 0 in its place ends no search.
    """
    sigma = np.zeros(len(hessian))
    sigma[free] = np.sqrt(np.maximum(np.diag(np.linalg.inv(hessian[np.ix_(free, free)])), 0.0))
    return sigma


def _best_scale(slope: float, decrease: float) -> float:
    """The fraction of a step, 0.1 to 1, that has the least cost if the cost along the step is a parabola.

    The cost decreases by `slope` t at first, and by `decrease` at t = 1. Where residuals are curved, the Hessian of
    Gauss and Newton may be half of the true one, and the step twice too long.
    """
    curvature = 2 * (slope - decrease)
    return min(max(slope / curvature, 0.1), 1.0) if curvature > 0 else 1.0


def newton_step(z: Array, gradient: Array, hessian: Array, lower: Array, upper: Array) -> Array:
    """The step to the minimum of a quadratic within bounds, by an active set: what reaches a bound stays on it."""
    held, step = _held(z, gradient, lower, upper), np.zeros_like(z)
    for _ in range(len(z)):
        free = ~held
        right = gradient[free] + hessian[np.ix_(free, held)] @ step[held]
        step[free] = -np.linalg.solve(hessian[np.ix_(free, free)], right)
        beyond = free & ((z + step < lower) | (z + step > upper))
        if not beyond.any():
            break
        step[beyond] = np.clip(z + step, lower, upper)[beyond] - z[beyond]
        held = held | beyond
    return step


def _held(z: Array, gradient: Array, lower: Array, upper: Array) -> NDArray[np.bool_]:
    """Which unknowns are on a bound and would leave the permitted range."""
    return ((z <= lower) & (gradient > 0)) | ((z >= upper) & (gradient < 0))


def trust_region_step(gradient: Array, hessian: Array, radius: float) -> Array:
    """The minimiser of a quadratic within a ball.

    On the boundary the step is s = -(H + mu I)^-1 g with ||s|| = radius; mu is found by bisection.
    """
    values, vectors = np.linalg.eigh(hessian)
    values = np.maximum(values, 1e-12 * values.max(initial=1.0))
    components = -vectors.T @ gradient
    if np.linalg.norm(components / values) <= radius:
        return np.asarray(vectors @ (components / values))
    low, high = 0.0, float(np.linalg.norm(gradient)) / radius
    for _ in range(60):
        middle = (low + high) / 2
        too_long = np.linalg.norm(components / (values + middle)) > radius
        low, high = (middle, high) if too_long else (low, middle)
    return np.asarray(vectors @ (components / (values + high)))
