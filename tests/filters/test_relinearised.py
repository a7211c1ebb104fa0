"""Repeated segments: no effect on a linear model, and the most probable parameters of a nonlinear one."""

import copy

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import least_squares

from fifthwheel._types import Array
from fifthwheel.filters import Noise
from fifthwheel.filters.dual import Scaling
from fifthwheel.filters.relinearised import Estimate, RelinearisationSettings, RelinearisedFilter
from tests.filters.examples import example
from tests.filters.test_joint import MODEL, NOISE, SCALING, C, kalman


def rows_of(count: int, seed: int = 3) -> Array:
    """dt, d, y, weight, learn."""
    rng = np.random.default_rng(seed)
    columns = [rng.uniform(0.01, 0.2, count), rng.normal(size=(count, 3)), rng.random((count, 2)) < 0.8]
    return np.column_stack([*columns, rng.random(count) < 0.6])


def linear_filter(**settings: float) -> RelinearisedFilter:
    made = RelinearisedFilter(
        MODEL, c=C, noise=NOISE, scaling=SCALING, walk=np.zeros(2), settings=RelinearisationSettings(**settings)
    )
    made.start(np.zeros(3), np.eye(3), np.zeros((3, 2)), np.zeros(1))
    return made


def advance(made: RelinearisedFilter, row: Array, in_segment: bool) -> tuple[bool, bool]:
    made.sample[: len(row) - 1, 0] = row[:-1]
    return made.advance(in_segment, bool(row[-1]))


@pytest.mark.parametrize("max_passes", [0, 1, 3])
@pytest.mark.parametrize(("lag", "samples"), [(0, 50), (4, 50), (4, 9), (50, 9), (2, 1)])
def test_repetition_has_no_effect_on_a_linear_model(max_passes: int, lag: int, samples: int) -> None:
    """After every sample the estimate is that of the Kalman filter of [x, z], whatever is repeated."""
    rows, in_segment = rows_of(60), (np.arange(60) // 13) % 2 == 1
    rows[~in_segment, -1] = 0.0  # nothing is learned outside of segments
    made = linear_filter(max_passes=max_passes, lag=lag, samples=samples, first_pass_limit=0.0, pass_limit=1e-9)
    copied = None
    for k, (row, inside, (mean, P)) in enumerate(zip(rows, in_segment, kalman(rows, np.ones(2)), strict=True)):
        used, _ = advance(made, row, bool(inside))
        assert used == (row[4:6].any())
        estimate = made.estimate()
        np.testing.assert_allclose(estimate.z, mean[3:], atol=1e-10)
        np.testing.assert_allclose(estimate.Pz, P[3:, 3:], atol=1e-10)
        if k == 20:
            copied = copy.deepcopy(made.memory())
    other = linear_filter(max_passes=max_passes, lag=lag, samples=samples, first_pass_limit=0.0, pass_limit=1e-9)
    other.restore(copied)
    for row, inside in zip(rows[21:], in_segment[21:], strict=True):
        advance(other, row, bool(inside))
    np.testing.assert_array_equal(other.estimate().z, made.estimate().z)
    np.testing.assert_array_equal(other.carry, made.carry)


LOGARITHMIC = example(
    lambda x, dt, d, p, c: x[0] * ca.exp(-dt), lambda x, d, p, c: x[0] + p[0] * d[0] + p[1] ** 2, x=1, d=1, p=2
)
LOG_SCALING = Scaling(
    logarithmic=(True, False),
    centre=np.array([1.0, 0.5]),
    scale=np.array([0.6, 1.0]),
    lower=np.array([1e-3, -9.0]),
    upper=np.array([1e3, 9.0]),
)


def nonlinear(inputs: Array, y: Array, *, later: int = 0, **settings: float) -> Estimate:
    """The estimate after one segment of a model that is nonlinear in its parameters, whose state is known.

    With samples after it, during which the passes are finished one sample at a time.
    """
    noise = Noise(process=np.zeros((1, 1)), measurement=np.array([0.05]))
    made = RelinearisedFilter(
        LOGARITHMIC,
        c=np.zeros(0),
        noise=noise,
        scaling=LOG_SCALING,
        walk=np.zeros(2),
        settings=RelinearisationSettings(**settings),
    )
    made.start(np.zeros(1), np.full((1, 1), 1e-12), np.zeros((1, 2)), np.zeros(1))
    for d, value in zip(inputs, y, strict=True):
        made.sample[:4, 0] = 0.01, d, value, 1.0
        made.advance(True, True)
    for _ in range(later):
        made.sample[:4, 0] = 0.01, 0.0, 0.0, 0.0
        made.advance(False, False)
    if not later:
        made.end_segment()
    assert made._count == 0  # the segment is done
    return made.estimate()


def test_repetition_reaches_the_most_probable_parameters() -> None:
    """Against a search of the maximum by SciPy; without repetition the filter stays away from it."""
    rng = np.random.default_rng(5)
    inputs = rng.normal(size=30)
    y = 2.5 * inputs + 1.2**2 + np.sqrt(0.05) * rng.normal(size=30)

    def residual(z: Array) -> Array:
        p = LOG_SCALING.to_p(z)
        return np.concatenate([z, (y - p[0] * inputs - p[1] ** 2) / np.sqrt(0.05)])

    expected = least_squares(residual, np.zeros(2), xtol=1e-14, ftol=1e-14, gtol=1e-14)
    sigma = np.sqrt(np.diag(np.linalg.inv(expected.jac.T @ expected.jac)))
    for lag in (3, 100):
        repeated = nonlinear(inputs, y, max_passes=30, first_pass_limit=1e-6, pass_limit=1e-6, lag=lag)
        assert np.abs((repeated.z - expected.x) / sigma).max() < 1e-3
        np.testing.assert_allclose(np.sqrt(np.diag(repeated.Pz)), sigma, rtol=1e-3)
    once = nonlinear(inputs, y, max_passes=0)
    assert np.abs((once.z - expected.x) / sigma).max() > 0.1
    # a limit far above the change ends the repetition with the first pass
    first = nonlinear(inputs, y, max_passes=30, first_pass_limit=1e9, pass_limit=1e-6, lag=100)
    assert np.abs((first.z - expected.x) / sigma).max() > 10 * np.abs((repeated.z - expected.x) / sigma).max()
    for passes in (1, 2, 4):
        limits = {"max_passes": passes, "first_pass_limit": 1e-6, "pass_limit": 1e-6}
        at_once = nonlinear(inputs, y, lag=100, **limits)
        assert (at_once.z == pytest.approx(first.z, abs=1e-9)) == (passes == 1)
        one_by_one = nonlinear(inputs, y, lag=100, later=30 * passes, **limits)
        assert one_by_one.z == pytest.approx(at_once.z, abs=1e-9)


def test_inflation_of_the_variance() -> None:
    """At most to the variance of the prior; correlations stay, and the scores contain so much less information."""
    Pz = np.array([[0.1, 0.12], [0.12, 0.4]])
    estimate = Estimate(
        z=np.ones(2), Pz=Pz, B=np.ones((2, 1)), gradient=np.array([6.0]), information=np.array([8.0])
    )  # fmt: skip
    wider = estimate.with_variance_inflation(4.0)
    assert np.diag(wider.Pz) == pytest.approx([0.4, 1.0])
    assert wider.Pz[0, 1] / np.sqrt(0.4) == pytest.approx(0.12 / np.sqrt(0.1 * 0.4))
    assert (wider.gradient, wider.information) == (1.5, 2.0)
    np.testing.assert_array_equal(wider.z, estimate.z)
    np.testing.assert_allclose(estimate.covariance(), [[1.1, 1.12, 1], [1.12, 1.4, 1], [1, 1, 1]])
