"""The long-run covariance against its definition, the autocorrelation factor against AR(1) noise."""

import numpy as np
import pytest

from fifthwheel.identify.residuals import autocorrelation_factor, long_run_covariance


@pytest.mark.parametrize("lags", [1, 2, 7, 40])
def test_long_run_covariance_is_that_of_newey_and_west(lags: int) -> None:
    scores = np.random.default_rng(lags).normal(size=(40, 3)).cumsum(axis=0)
    expected = scores.T @ scores
    for lag in range(1, min(lags, len(scores))):
        gamma = scores[lag:].T @ scores[:-lag]
        expected += (1 - lag / lags) * (gamma + gamma.T)
    np.testing.assert_allclose(long_run_covariance(scores, lags), expected, rtol=1e-10, atol=1e-9)


def test_autocorrelation_factor_of_white_noise_is_one() -> None:
    white = np.random.default_rng(1).normal(size=20_000)
    assert autocorrelation_factor(white, 100) == pytest.approx(1.0, abs=0.2)


@pytest.mark.parametrize("rho", [0.5, 0.8])
def test_autocorrelation_factor_of_ar1_noise(rho: float) -> None:
    """The long-run variance over the variance is (1 + rho) / (1 - rho)."""
    series = np.random.default_rng(1).normal(size=20_000)
    for k in range(1, len(series)):
        series[k] += rho * series[k - 1]
    assert autocorrelation_factor(series, 200) == pytest.approx((1 + rho) / (1 - rho), rel=0.2)


def test_autocorrelation_factor_is_at_least_one() -> None:
    """Alternating residuals contain more information than white ones; that is not used."""
    assert autocorrelation_factor(np.tile([1.0, -1.0], 1000), 10) == 1.0
