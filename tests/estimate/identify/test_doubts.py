"""Tests of priors against estimates of a small linear problem without one of the priors."""

import math

import numpy as np
import pytest
from scipy.stats import norm

from fifthwheel.estimate.identify.doubts import (
    PriorTest,
    linear_odds,
    most_likely,
    prior_tests,
)
from fifthwheel.estimate.identify.one_stage.posterior import ScaledPosterior
from fifthwheel.estimate.identify.unknowns.unknown import RATE, GrossError, Unknown

Array = np.ndarray

NAMES = ("a", "b", "c", "d", "e")
TESTED = ("b", "d", "e")
MASS = Unknown(name="mass", centre=1e4, scale=0.03, lower=-9.0, upper=9.0, logarithmic=True)
UNKNOWNS = dict.fromkeys(TESTED, MASS)


class Linear:
    """Measurements y = J z + noise of variance 1, with the prior z ~ N(0, I)."""

    def __init__(self, jacobian: Array, y: Array) -> None:
        self.jacobian, self.y = jacobian, y

    def estimate(self, without_prior: tuple[int, ...] = ()) -> tuple[Array, float]:
        """The most probable z (5,) and its cost."""
        prior = np.eye(len(NAMES))
        prior[without_prior, without_prior] = 0.0
        z = np.linalg.solve(prior + self.jacobian.T @ self.jacobian, self.jacobian.T @ self.y)
        residual = self.y - self.jacobian @ z
        return z, float(residual @ residual + z @ prior @ z) / 2

    def tests(self) -> list[PriorTest]:
        information = self.jacobian.T @ self.jacobian
        posterior = ScaledPosterior.from_information(NAMES, information)
        return prior_tests(NAMES, self.estimate()[0], posterior.model_covariance, posterior.predictive, TESTED)


def linear(seed: int, z: tuple[float, ...] = (1.0, 0.5, -1.0, 2.0, -0.3), scale: float = 1.0) -> Linear:
    """With correlated columns."""
    rng = np.random.default_rng(seed)
    jacobian = scale * rng.normal(size=(60, 5)) @ (np.eye(5) + 0.4 * rng.normal(size=(5, 5)))
    return Linear(jacobian, jacobian @ np.array(z) + rng.normal(size=60))


@pytest.mark.parametrize("scale", [0.2, 2.0], ids=str)
@pytest.mark.parametrize("seed", range(2))
def test_the_test_of_a_prior_is_the_estimate_without_it(seed: int, scale: float) -> None:
    problem = linear(seed, scale=scale)
    z, cost = problem.estimate()
    tests = problem.tests()
    assert sorted(test.name for test in tests) == sorted(TESTED)
    for test in tests:
        i = NAMES.index(test.name)
        free, smaller = problem.estimate(without_prior=(i,))
        assert test.implied == pytest.approx(free[i], rel=1e-9)
        others = [k for k in range(len(NAMES)) if k != i]
        assert test.shifts[others] == pytest.approx((free - z)[others], rel=1e-9, abs=1e-12)
        assert test.statistic**2 / 2 == pytest.approx(cost - smaller, rel=1e-6, abs=1e-9)
    assert [abs(t.statistic) for t in tests] == sorted((abs(t.statistic) for t in tests), reverse=True)


def test_statistic_is_normal_if_all_priors_are_right() -> None:
    by_name: dict[str, list[float]] = {name: [] for name in TESTED}
    for seed, truth in enumerate(np.random.default_rng(7).normal(size=(2000, 5))):
        for test in linear(seed, tuple(truth)).tests():
            by_name[test.name].append(test.statistic)
    for statistics in by_name.values():
        assert abs(np.mean(statistics)) < 4 / np.sqrt(2000)
        assert np.var(statistics) == pytest.approx(1.0, abs=4 * np.sqrt(2 / 2000))


def test_autocorrelated_noise_scatters_the_estimates_more() -> None:
    """Each measurement is repeated four times with the same noise: H counts it four times, the scores show it."""
    statistics = []
    for seed, truth in enumerate(np.random.default_rng(9).normal(size=(1000, 5))):
        once = linear(seed, tuple(truth), scale=0.2)
        H = once.jacobian.T @ once.jacobian
        posterior = ScaledPosterior.from_information(NAMES, 4 * H, 16 * H)
        P = posterior.model_covariance
        z = P @ (4 * once.jacobian.T @ once.y)
        statistics += [test.statistic for test in prior_tests(NAMES, z, P, posterior.predictive, TESTED)]
    assert np.mean(np.square(statistics)) == pytest.approx(1.0, abs=0.1)


def test_the_true_cause_is_the_most_likely() -> None:
    """A change that the logs show clearly but its prior explains is no doubt."""
    for cause in TESTED:
        for seed in range(8):
            truth = dict.fromkeys(NAMES, 0.2) | {cause: 8.0}
            causes = most_likely(linear(seed, tuple(truth.values())).tests(), UNKNOWNS)
            assert causes[0].name == cause
            assert causes[0].implied == pytest.approx(8.0, abs=2.0)
    assert most_likely(linear(2, (0.0, 0.0, 0.0, 2.0, 0.0)).tests(), UNKNOWNS) == []


def test_the_odds_of_a_gross_error_are_those_of_two_marginal_likelihoods() -> None:
    """y = c + noise of variance 1 / I, with c ~ N(0, 1) or N(0, w^2)."""
    y, information, w = 7.0, 4.0, 5.0
    sigma = math.sqrt(1 + 1 / information)
    test = PriorTest(name="c", statistic=y / sigma, implied=y, shifts=np.zeros(1))
    wide = norm(scale=math.sqrt(w**2 + 1 / information)).logpdf(y)
    expected = math.log(RATE * 2.0) + wide - norm(scale=sigma).logpdf(y)
    assert linear_odds(test, GrossError(w, 2.0)) == pytest.approx(expected)


def test_an_unknown_with_little_information_has_no_test() -> None:
    """Below 0.3 % of the variance of its prior, whatever that is; or none."""
    problem = linear(1)
    problem.jacobian[:, 3] = 0.0
    assert "d" not in {test.name for test in problem.tests()}
    for variance in (1.0, 0.04):
        for information, tested in ((0.0029, False), (0.0031, True)):
            P = np.diag([variance * (1 - information)])
            found = prior_tests("a", np.array([0.01]), P, np.array([0.002]), ["a"], np.array([variance]))
            assert bool(found) == tested
            if found:
                assert found[0].implied == pytest.approx(0.01 / information)
                assert found[0].statistic == pytest.approx(5.0)
