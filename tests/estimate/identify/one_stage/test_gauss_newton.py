"""Gauss-Newton steps within a trust region, on problems with a known minimum."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fifthwheel.estimate.identify.one_stage.gauss_newton import (
    Quadratic,
    minimise,
    newton_step,
    remaining_step,
    trust_region_step,
)

Array = np.ndarray


def rosenbrock(z: Array) -> Array:
    return np.array([10 * (z[1] - z[0] ** 2), 1 - z[0]])


def expand(z: Array) -> Quadratic:
    r, J = rosenbrock(z), np.array([[-20 * z[0], 10.0], [-1.0, 0.0]])
    return Quadratic(float(r @ r) / 2, J.T @ r, J.T @ J)


def cost(z: Array) -> float:
    r = rosenbrock(z)
    return float(r @ r) / 2


def search(start: list[float], lower: float = -9.0, upper: float = 9.0, limit: int = 200) -> tuple[Array, bool]:
    minimum = minimise(
        SimpleNamespace(expand=expand, cost=cost),
        np.array(start),
        lower=np.full(2, lower),
        upper=np.full(2, upper),
        iterations=limit,
        tolerance=1e-6,
    )
    return minimum.z, minimum.converged


def test_rosenbrock_valley() -> None:
    """Also with the minimum on a bound; not after too few steps."""
    for start in ([-1.2, 1.0], [3.0, -3.0], [-5.0, 8.0], [1.0, 1.0]):
        z, converged = search(start)
        assert converged
        assert z == pytest.approx([1.0, 1.0], abs=1e-5)
    z, converged = search([-1.2, 0.3], upper=0.5)
    assert converged
    assert z == pytest.approx([0.5, 0.25], abs=1e-5)
    assert not search([-5.0, 8.0], limit=3)[1]


@pytest.mark.parametrize("hopeless", [False, True])
def test_a_hopeless_search_stops_after_a_fair_trial(hopeless: bool) -> None:
    """It is asked with a cost that the next steps do not reach."""
    asked, valley, start = list[float](), SimpleNamespace(expand=expand, cost=cost), np.array([-5.0, 8.0])

    def answer(least: float) -> bool:
        asked.append(least)
        return hopeless

    bounds = {"lower": np.full(2, -9.0), "upper": np.full(2, 9.0)}
    minimum = minimise(valley, start, **bounds, iterations=200, tolerance=1e-6, hopeless=answer)
    assert minimum.converged is not hopeless
    assert (len(asked) == 1) is hopeless
    assert asked[0] < cost(minimise(valley, start, **bounds, iterations=3).z)


def test_the_remaining_step_of_a_search() -> None:
    """Of a quadratic, to its minimum within the bounds of the search."""
    target = np.array([3.0, -2.0])
    bowl = SimpleNamespace(
        expand=lambda z: Quadratic(float((z - target) @ (z - target)) / 2, z - target, np.eye(2)), cost=None
    )
    minimum = minimise(bowl, np.zeros(2), lower=np.full(2, -1.0), upper=np.full(2, 9.0), iterations=0)
    assert remaining_step(minimum).tolist() == [3.0, -1.0]


def test_stops_at_an_infinite_cost() -> None:
    """The cost is infinite between the start and the minimum of the quadratic."""

    def walled(z: Array) -> float:
        return np.inf if z[0] > 2 else float((z[0] - 3) ** 2) / 2

    minimum = minimise(
        SimpleNamespace(expand=lambda z: Quadratic(walled(z), z - 3, np.eye(1)), cost=walled),
        np.zeros(1),
        lower=np.full(1, -9.0),
        upper=np.full(1, 9.0),
        iterations=60,
    )
    assert not minimum.converged
    assert 1.9 < minimum.z[0] <= 2


@settings(max_examples=30)
@given(st.integers(0, 10_000), st.floats(0.01, 10))
def test_trust_region_step_is_the_best_in_the_ball(seed: int, radius: float) -> None:
    rng = np.random.default_rng(seed)
    root, gradient = rng.normal(size=(4, 4)), rng.normal(size=4)
    hessian = root @ root.T + 0.1 * np.eye(4)
    step = trust_region_step(gradient, hessian, radius)
    assert np.linalg.norm(step) <= radius * (1 + 1e-6)
    if np.linalg.norm(np.linalg.solve(hessian, gradient)) <= radius:
        assert hessian @ step == pytest.approx(-gradient, abs=1e-6)
    else:
        assert np.linalg.norm(step) == pytest.approx(radius, rel=1e-6)

    def model(s: Array) -> float:
        return float(gradient @ s + s @ hessian @ s / 2)

    for _ in range(20):
        other = rng.normal(size=4)
        other *= min(radius, float(np.linalg.norm(step)) or radius) / np.linalg.norm(other)
        assert model(step) <= model(other) + 1e-7


class Slope:
    """A cost that falls by a chosen ratio of the predicted decrease; it keeps the lengths of all steps."""

    def __init__(self, ratio: float) -> None:
        self.ratio, self.at, self.lengths = ratio, 0.0, []
        self.model = Quadratic(0.0, np.array([-1.0]), 1e-9 * np.eye(1))

    def expand(self, z: Array) -> Quadratic:
        self.model = self.model._replace(cost=self.cost(z))
        self.at = float(z[0])
        self.lengths.pop()
        return self.model

    def cost(self, z: Array) -> float:
        step = float(z[0]) - self.at
        self.lengths.append(step)
        return self.model.cost - self.ratio * (step - 1e-9 * step**2 / 2)


@pytest.mark.parametrize(
    ("ratio", "factor"),
    [(1.0, 2), (0.76, 2), (0.74, 1), (0.26, 1), *((r, 0.25) for r in (0.24, 1.1e-3, 0.9e-3, -1, np.nan))],
)
def test_the_trust_region_follows_the_ratio_of_actual_to_predicted_decrease(ratio: float, factor: float) -> None:
    """Twice as large above 3/4, a quarter below 1/4; a step is taken if the cost decreases by 1/1000 of it."""
    slope, far, progress, lengths = Slope(ratio), np.full(1, 1e9), [], [2.0 * factor**k for k in range(4)]
    minimum = minimise(
        slope, np.zeros(1), lower=-far, upper=far, iterations=4, progress=lambda *step: progress.append(step)
    )
    assert slope.lengths == pytest.approx(lengths)
    assert minimum.z[0] == pytest.approx(sum(lengths) if ratio > 1e-3 else 0.0)
    assert (minimum.converged, minimum.steps) == (False, 4)
    assert progress == [(k, 4) for k in range(4)]


def test_a_cost_that_does_not_follow_its_derivatives_ends_the_search() -> None:
    """When the trust region is smaller than 1e-9."""
    slope, far = Slope(-1.0), np.full(1, 1e9)
    minimum = minimise(slope, np.zeros(1), lower=-far, upper=far, iterations=100)
    assert (minimum.converged, minimum.steps) == (False, 16)
    assert 2.0 / 4**15 > 1e-9 > 2.0 / 4**16


@pytest.mark.parametrize(("tolerance", "largest"), [({}, 0.03), ({"tolerance": 0.5}, 0.5)])
def test_converged_when_a_full_step_is_small_in_standard_deviations(
    tolerance: dict[str, float], largest: float
) -> None:
    """A step within the tolerance is not taken; sigma is 1/2."""
    far, sigma = np.full(1, 9.0), 0.5
    for error, steps in ((0.99 * largest * sigma, 1), (1.01 * largest * sigma, 2)):

        def expand(z: Array) -> Quadratic:
            return Quadratic(float(z @ z) / 2 / sigma**2, z / sigma**2, np.eye(1) / sigma**2)

        objective = SimpleNamespace(expand=expand, cost=lambda z: expand(z).cost)
        minimum = minimise(objective, np.array([error]), lower=-far, upper=far, iterations=9, **tolerance)
        assert (minimum.converged, minimum.steps) == (True, steps)
        assert minimum.z[0] == (error if steps == 1 else 0.0)


@settings(max_examples=30)
@given(st.integers(0, 10_000))
def test_newton_step_is_the_minimum_within_bounds(seed: int) -> None:
    """Of a quadratic in three unknowns, some of which are on a bound: against a search over what is on its bounds."""
    rng = np.random.default_rng(seed)
    root, gradient = rng.normal(size=(3, 3)), 3 * rng.normal(size=3)
    hessian, lower, upper = root @ root.T + np.diag([3.0, 4.0, 5.0]), np.full(3, -1.0), np.full(3, 1.0)
    z = rng.choice([-1.0, 0.0, 0.5, 1.0], size=3)
    step = newton_step(z, gradient, hessian, lower, upper)
    assert (np.abs(z + step) <= 1 + 1e-12).all()
    slope = gradient + hessian @ step
    free = np.abs(z + step) < 1 - 1e-9
    assert slope[free] == pytest.approx(0.0, abs=1e-9)
