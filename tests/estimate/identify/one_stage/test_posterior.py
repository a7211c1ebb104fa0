"""Covariances, correlations and verdicts on problems with a known solution."""

import numpy as np
import pytest

from fifthwheel.estimate.identify.one_stage.posterior import ScaledPosterior

NAMES = ("a", "b", "c")
posterior = ScaledPosterior.from_information


def information(jacobian: np.ndarray, sigma: float) -> np.ndarray:
    return jacobian.T @ jacobian / sigma**2


@pytest.fixture(scope="module")
def jacobian() -> np.ndarray:
    return np.random.default_rng(0).normal(size=(200, 3))


def test_larger_score_covariance_widens_every_sigma(jacobian: np.ndarray) -> None:
    """The covariance is the inverse of the information plus the prior. Scores that scatter less than predicted do not
    reduce a sigma."""
    H = 100 * information(jacobian, 1.0)
    usual, wider = posterior(NAMES, H, H), posterior(NAMES, H, 9 * H)
    assert usual.covariance == pytest.approx(np.linalg.inv(np.eye(3) + H))
    assert posterior(NAMES, H).covariance == pytest.approx(usual.covariance)
    assert usual.sigma == pytest.approx(np.sqrt(np.diag(usual.covariance)))
    assert wider.sigma == pytest.approx(3 * usual.sigma, rel=1e-3)
    assert posterior(NAMES, H, H / 9).sigma == pytest.approx(usual.sigma)


def test_estimates_and_their_errors_against_random_draws(jacobian: np.ndarray) -> None:
    """Data and unknowns are drawn: the errors have the covariance, the estimates scatter as predicted."""
    rng, sigma = np.random.default_rng(1), 5.0
    result = posterior(NAMES, information(jacobian, sigma))
    estimates, errors = [], []
    for _ in range(20_000):
        z = rng.normal(size=3)
        gradient = jacobian.T @ (jacobian @ z + sigma * rng.normal(size=len(jacobian))) / sigma**2
        estimates.append(result.model_covariance @ gradient)
        errors.append(estimates[-1] - z)
    assert result.covariance == pytest.approx(np.cov(np.array(errors).T), abs=0.02)
    assert result.predictive == pytest.approx(np.std(estimates, axis=0), rel=0.02)


def test_more_information_or_a_narrower_prior_never_enlarges_a_sigma() -> None:
    rng = np.random.default_rng(2)
    for _ in range(50):
        one, other = (information(rng.normal(size=(2, 3)), sigma) for sigma in rng.uniform(0.3, 3.0, 2))
        few = posterior(NAMES, one)
        assert (posterior(NAMES, one + other).sigma <= few.sigma * (1 + 1e-12)).all()
        narrower = posterior(NAMES, one, precision=np.diag([1.0, 4.0, 1.0]))
        assert (narrower.sigma <= few.sigma * (1 + 1e-12)).all()


def test_conditional_sigma_does_not_take_sensor_errors_as_known() -> None:
    """a plus the sensor error c is measured well, but c is unknown."""
    H = information(np.array([[1.0, 0.0, 1.0]]), 0.01)
    assert posterior(NAMES, H).conditional_sigma(NAMES[0]) == pytest.approx(0.01, rel=1e-2)
    assert posterior(NAMES, H, nuisances=[2]).conditional_sigma(NAMES[0]) == pytest.approx(np.sqrt(0.5), rel=1e-2)


def test_limits_of_correlated_unknowns() -> None:
    """Above 0.8 in magnitude, at most three, the strongest first."""
    names = tuple("abcdef")
    correlations = np.array([1.0, 0.79, -0.81, 0.85, -0.9, 0.95])
    covariance = np.outer(correlations, correlations) + np.diag(1 - correlations**2)
    scale = np.array([1.0, 2.0, 0.5, 3.0, 1.0, 0.1])
    result = ScaledPosterior(names=names, information=np.eye(6), covariance=covariance * np.outer(scale, scale))
    assert result.correlated(0) == [5, 4, 3]
    assert result.correlated(0, 9) == [5, 4, 3, 2]
    assert result.most_limiting(0) == 5
    assert result.most_limiting(1) == 0
