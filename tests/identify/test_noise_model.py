"""The noise model of residuals: whitening against dense covariance matrices, the fit against simulated noise."""

import numpy as np
import pytest
from scipy.linalg import cho_factor, cho_solve, toeplitz

from fifthwheel.identify.noise_model import FEWEST_SAMPLES, NoiseModel, Whitener, fit_noise_model

Array = np.ndarray

DT = 0.01
MODELS = [
    NoiseModel(white=1.0, discrepancy=1.0, time_constant=10.0),
    NoiseModel(white=1.0, discrepancy=4.0, time_constant=0.5),
    NoiseModel(white=0.01, discrepancy=1.0, time_constant=0.1),
    NoiseModel(white=1.0, discrepancy=0.02, time_constant=2.0),
    NoiseModel(white=2.0),
]


def covariance(model: NoiseModel, n: int) -> Array:
    """Of n consecutive residuals (n, n), by the definition of the model."""
    lags = np.arange(n) * DT
    return toeplitz(model.discrepancy * np.exp(-lags / model.time_constant)) + model.white * np.eye(n)


def draws(model: NoiseModel, count: int, n: int, seed: int) -> Array:
    """`count` realisations of the noise (count, n)."""
    rng, phi = np.random.default_rng(seed), np.exp(-DT / model.time_constant)
    discrepancy = np.sqrt(model.discrepancy) * rng.normal(size=(count, n))
    discrepancy[:, 1:] *= np.sqrt(1 - phi**2)
    for k in range(1, n):
        discrepancy[:, k] += phi * discrepancy[:, k - 1]
    return np.asarray(discrepancy + np.sqrt(model.white) * rng.normal(size=(count, n)))


@pytest.mark.parametrize("model", MODELS, ids=str)
def test_whitening_is_generalised_least_squares(model: NoiseModel) -> None:
    """A constant, a fast transient at the start, and an oscillation: gradient and Gram matrix of the dense problem."""
    n = 400
    time = np.arange(n) * DT
    jacobian = np.array([np.ones(n), np.exp(-time / 0.05), np.sin(4 * time)])
    (error,) = draws(model, 1, n, seed=1)
    factor = cho_factor(covariance(model, n))
    gradient, gram = jacobian @ cho_solve(factor, error), jacobian @ cho_solve(factor, jacobian.T)
    rows, residuals = Whitener(model, DT)(jacobian), Whitener(model, DT)(error)
    sigma = np.sqrt(np.diag(gram))
    assert rows @ rows.T / np.outer(sigma, sigma) == pytest.approx(gram / np.outer(sigma, sigma), abs=1e-4)
    assert rows @ residuals / sigma == pytest.approx(gradient / sigma, abs=1e-3)
    assert residuals @ residuals == pytest.approx(error @ cho_solve(factor, error), rel=1e-4)


@pytest.mark.parametrize("model", MODELS, ids=str)
def test_whitened_noise_is_white_from_the_first_sample_on(model: NoiseModel) -> None:
    count, n = 4000, 150
    whitened = Whitener(model, DT)(draws(model, count, n, seed=2))
    sample_covariance = whitened.T @ whitened / count
    # an element has a standard deviation of 1 / sqrt(count), on the diagonal sqrt(2 / count); there are 11000
    assert np.abs(sample_covariance - np.eye(n)).max() < 5 * np.sqrt(2 / count)
    for lag in (1, 5, 30):
        correlation = np.trace(sample_covariance, offset=lag) / (n - lag)
        assert abs(correlation) < 4 / np.sqrt(count * (n - lag)), lag


@pytest.mark.parametrize("cuts", [(1,), (0, 0, 7), (1, 2, 3, 90), (50, 250)], ids=str)
@pytest.mark.parametrize("model", MODELS[:2], ids=str)
def test_whitening_in_pieces(model: NoiseModel, cuts: tuple[int, ...]) -> None:
    rows = np.random.default_rng(3).normal(size=(2, 300))
    whitener = Whitener(model, DT)
    pieces = [whitener(piece) for piece in np.split(rows, cuts, axis=1)]
    assert np.concatenate(pieces, axis=1) == pytest.approx(Whitener(model, DT)(rows), rel=1e-12, abs=1e-14)


@pytest.mark.parametrize("model", MODELS, ids=str)
def test_spectrum_is_that_of_the_covariance(model: NoiseModel) -> None:
    """Twice the Fourier transform of the autocovariance (Wiener-Khinchin); its integral is the variance."""
    lags = np.arange(1, round(20 * model.time_constant / DT))
    autocovariance = model.discrepancy * np.exp(-lags * DT / model.time_constant)
    for frequency in (0.3, 4.0, 50.0):
        expected = 2 * DT * (model.variance + 2 * autocovariance @ np.cos(2 * np.pi * frequency * lags * DT))
        assert model.spectrum(np.array([frequency]), DT) == pytest.approx(expected, rel=1e-6)
    frequency = (np.arange(200_000) + 0.5) / 200_000 * 0.5 / DT
    assert model.spectrum(frequency, DT).mean() * 0.5 / DT == pytest.approx(model.variance, rel=1e-6)


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


def test_the_fit_does_not_depend_on_the_unit() -> None:
    for noise in draws(NoiseModel(white=1.0, discrepancy=1.0, time_constant=0.5), 5, 3000, seed=6):
        fit, scaled = fit_noise_model([noise], DT), fit_noise_model([1e-3 * noise], DT)
        assert scaled.white == pytest.approx(1e-6 * fit.white, rel=0.02)
        assert scaled.discrepancy == pytest.approx(1e-6 * fit.discrepancy, rel=0.02)
        assert scaled.time_constant == pytest.approx(fit.time_constant, rel=0.02)


def test_white_noise_has_no_discrepancy() -> None:
    fits = [fit_noise_model([noise], DT) for noise in draws(NoiseModel(white=0.25), 40, 2000, seed=5)]
    assert [fit.discrepancy for fit in fits] == [0.0] * 40
    assert np.mean([fit.white for fit in fits]) == pytest.approx(0.25, rel=0.02)


def test_too_few_samples_are_taken_as_white() -> None:
    segment = 3.0 + np.sin(np.arange(FEWEST_SAMPLES - 1))
    assert fit_noise_model([segment], DT) == NoiseModel(white=float(np.mean(segment**2)))
