"""The noise model of residuals: its spectrum, and the fit against simulated noise; their autocorrelation."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import minimize, rosen

from fifthwheel.estimate.filters.noise_model import (
    FEWEST_SAMPLES,
    NoiseModel,
    autocorrelation_factor,
    fit_noise_model,
    long_run_covariance,
    nelder_mead,
)

Array = np.ndarray

DT = 0.01
MODELS = [
    NoiseModel(white=1.0, discrepancy=1.0, time_constant=10.0),
    NoiseModel(white=1.0, discrepancy=4.0, time_constant=0.5),
    NoiseModel(white=0.01, discrepancy=1.0, time_constant=0.1),
    NoiseModel(white=1.0, discrepancy=0.02, time_constant=2.0),
    NoiseModel(white=2.0),
]


def draws(model: NoiseModel, count: int, n: int, seed: int) -> Array:
    """`count` realisations of the noise (count, n)."""
    rng, phi = np.random.default_rng(seed), np.exp(-DT / model.time_constant)
    discrepancy = np.sqrt(model.discrepancy) * rng.normal(size=(count, n))
    discrepancy[:, 1:] *= np.sqrt(1 - phi**2)
    for k in range(1, n):
        discrepancy[:, k] += phi * discrepancy[:, k - 1]
    return np.asarray(discrepancy + np.sqrt(model.white) * rng.normal(size=(count, n)))


@pytest.mark.parametrize("model", MODELS, ids=str)
def test_spectrum_is_that_of_the_covariance(model: NoiseModel) -> None:
    """Twice the Fourier transform of the autocovariance (Wiener-Khinchin); its integral is the variance."""
    variance, lags = model.white + model.discrepancy, np.arange(1, round(20 * model.time_constant / DT))
    autocovariance = model.discrepancy * np.exp(-lags * DT / model.time_constant)
    for frequency in (0.3, 4.0, 50.0):
        expected = 2 * DT * (variance + 2 * autocovariance @ np.cos(2 * np.pi * frequency * lags * DT))
        assert model.spectrum(np.array([frequency]), DT) == pytest.approx(expected, rel=1e-6)
    frequency = (np.arange(200_000) + 0.5) / 200_000 * 0.5 / DT
    assert model.spectrum(frequency, DT).mean() * 0.5 / DT == pytest.approx(variance, rel=1e-6)


@pytest.mark.parametrize("model", MODELS, ids=str)
def test_the_whitened_noise_is_white(model: NoiseModel) -> None:
    noise = model.whitened(draws(model, 20, 6000, seed=1), DT)[:, 1000:]
    assert np.var(noise) == pytest.approx(1.0, abs=0.02)
    for lag in (1, 3, 30):
        assert np.mean(noise[:, lag:] * noise[:, :-lag]) == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize(
    "model",
    [
        NoiseModel(white=1.0, discrepancy=1.0, time_constant=0.5),
        NoiseModel(white=4e-5, discrepancy=1e-4, time_constant=0.1),
        NoiseModel(white=1.0, discrepancy=0.2, time_constant=2.0),
    ],
    ids=str,
)
def test_the_fit_recovers_simulated_noise(model: NoiseModel) -> None:
    """The errors of 30 fits have mean 0 and the standard deviation of Whittle's information, and not much more."""
    count, n, theta = 30, 6000, np.log([model.white, model.discrepancy, model.time_constant])
    frequency = np.arange(1, n // 2) / (n * DT)

    def log_spectrum(theta: Array) -> Array:
        r, q, tau = np.exp(theta)
        return np.log(NoiseModel(white=r, discrepancy=q, time_constant=tau).spectrum(frequency, DT))

    slopes = np.array([(log_spectrum(theta + h) - log_spectrum(theta - h)) / 2e-4 for h in 1e-4 * np.eye(3)])
    sigma = np.sqrt(np.diag(np.linalg.inv(slopes @ slopes.T)))
    errors = []
    for noise in draws(model, count, n, seed=4):
        fit = fit_noise_model(np.split(noise, [n // 2 - 70, n // 2 + 70]), DT)
        errors.append((np.log([fit.white, fit.discrepancy, fit.time_constant]) - theta) / sigma)
    mean, spread = np.mean(errors, axis=0), np.std(errors, axis=0)
    assert (np.abs(mean) < 4 / np.sqrt(count)).all(), mean
    assert (spread < 1.5).all(), spread  # 30 draws: a standard deviation of 13 %


def test_the_fit_of_white_noise_of_few_samples_and_in_another_unit() -> None:
    fits = [fit_noise_model([noise], DT) for noise in draws(NoiseModel(white=0.25), 20, 2000, seed=5)]
    assert [fit.discrepancy for fit in fits] == [0.0] * 20
    assert np.mean([fit.white for fit in fits]) == pytest.approx(0.25, rel=0.02)
    few = 3.0 + np.sin(np.arange(FEWEST_SAMPLES - 1))
    assert fit_noise_model([few], DT) == NoiseModel(white=float(np.mean(few**2)))
    (noise,) = draws(NoiseModel(white=1.0, discrepancy=1.0, time_constant=0.5), 1, 3000, seed=6)
    fit, scaled = fit_noise_model([noise], DT), fit_noise_model([1e-3 * noise], DT)
    assert scaled.white == pytest.approx(1e-6 * fit.white, rel=0.02)
    assert scaled.discrepancy == pytest.approx(1e-6 * fit.discrepancy, rel=0.02)
    assert scaled.time_constant == pytest.approx(fit.time_constant, rel=0.02)


@pytest.mark.parametrize("lags", [1, 2, 7, 40])
def test_long_run_covariance_is_that_of_newey_and_west(lags: int) -> None:
    scores = np.random.default_rng(lags).normal(size=(40, 3)).cumsum(axis=0)
    expected = scores.T @ scores
    for lag in range(1, min(lags, len(scores))):
        gamma = scores[lag:].T @ scores[:-lag]
        expected += (1 - lag / lags) * (gamma + gamma.T)
    np.testing.assert_allclose(long_run_covariance(scores, lags), expected, rtol=1e-10, atol=1e-9)


def test_autocorrelation_factor_is_the_long_run_variance_over_the_variance() -> None:
    """(1 + rho) / (1 - rho) of an AR(1) process, 1 of white noise. Alternating residuals contain more information than
    white ones; that is not used."""
    white = np.random.default_rng(1).normal(size=20_000)
    assert autocorrelation_factor(white, 100) == pytest.approx(1.0, abs=0.2)
    for rho in (0.5, 0.8):
        series = white.copy()
        for k in range(1, len(series)):
            series[k] += rho * series[k - 1]
        assert autocorrelation_factor(series, 200) == pytest.approx((1 + rho) / (1 - rho), rel=0.2)
    assert autocorrelation_factor(np.tile([1.0, -1.0], 1000), 10) == 1.0


def rippled(x: Array) -> float:
    """With so many minima that the simplex shrinks several times."""
    return float(np.sum(x**2) + 3 * np.sin(25 * x).sum())


@pytest.mark.parametrize("function", [rosen, rippled])
@pytest.mark.parametrize("iterations", [3, 400])
def test_every_step_is_that_of_scipy(function: Callable[[Array], float], iterations: int) -> None:
    simplex = np.array([-1.2, 1.0, 0.7]) + 0.5 * np.eye(4, 3)
    options = {"xatol": 1e-2, "fatol": 1e-2, "maxiter": iterations, "initial_simplex": simplex}
    expected = minimize(function, simplex[0], method="Nelder-Mead", options=options)
    best = nelder_mead(function, simplex, tolerance=1e-2, iterations=iterations)
    assert best.x.tolist() == expected.x.tolist()
    assert best.value == expected.fun
