"""Gauss-Newton steps within a trust region, on problems with a known minimum."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fifthwheel.identify.one_stage.gauss_newton import Quadratic, minimise, trust_region_step

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


@pytest.mark.parametrize("start", [[-1.2, 1.0], [3.0, -3.0], [-5.0, 8.0], [1.0, 1.0]])
def test_rosenbrock_valley(start: list[float]) -> None:
    z, converged = search(start)
    assert converged
    assert z == pytest.approx([1.0, 1.0], abs=1e-5)


def test_minimum_on_a_bound() -> None:
    z, converged = search([-1.2, 0.3], upper=0.5)
    assert converged
    assert z == pytest.approx([0.5, 0.25], abs=1e-5)


def test_not_converged_after_too_few_steps() -> None:
    assert not search([-5.0, 8.0], limit=3)[1]


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


@given(st.integers(0, 10_000), st.floats(0.01, 10))
def test_trust_region_step_is_the_best_in_the_ball(seed: int, radius: float) -> None:
    rng = np.random.default_rng(seed)
    root, gradient = rng.normal(size=(4, 4)), rng.normal(size=4)
    hessian = root @ root.T + 0.1 * np.eye(4)
    step, interior = trust_region_step(gradient, hessian, radius)
    assert np.linalg.norm(step) <= radius * (1 + 1e-6)
    if interior:
        assert hessian @ step == pytest.approx(-gradient, abs=1e-6)
    else:
        assert np.linalg.norm(step) == pytest.approx(radius, rel=1e-6)

    def model(s: Array) -> float:
        return float(gradient @ s + s @ hessian @ s / 2)

    for _ in range(20):
        other = rng.normal(size=4)
        other *= min(radius, float(np.linalg.norm(step)) or radius) / np.linalg.norm(other)
        assert model(step) <= model(other) + 1e-7
