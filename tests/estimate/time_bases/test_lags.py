"""The lag of a channel behind its prediction on signals with a known lag, gain and noise."""

import numpy as np
import pytest

from fifthwheel.estimate.time_bases.predictions import RATE, LagCurve, lag_curve

TIME = np.arange(0, 60, 1 / RATE)


def slow_noise(seed: int, time_constant: float, count: int = len(TIME)) -> np.ndarray:
    """First-order noise of variance 1."""
    rng, phi = np.random.default_rng(seed), np.exp(-1 / (RATE * time_constant))
    values = rng.normal(size=count)
    for k in range(1, count):
        values[k] = phi * values[k - 1] + np.sqrt(1 - phi**2) * values[k]
    return values


def excitation(seed: int) -> np.ndarray:
    smooth = np.convolve(slow_noise(seed, 0.5), np.hanning(25), mode="same")
    return smooth / smooth.std()


def curve_of(measured: np.ndarray, predicted: np.ndarray) -> LagCurve:
    curve = lag_curve(measured, predicted)
    assert curve is not None
    return curve


@pytest.mark.parametrize("lag", [-0.6, 0.0, 0.3, 1.6])
def test_lag_and_gain(lag: float) -> None:
    predicted = excitation(1)
    curve = curve_of(0.3 + 1.4 * np.interp(TIME - lag, TIME, predicted), predicted)
    found = curve.best()
    assert found is not None
    assert found[0] == pytest.approx(lag, abs=0.002)
    gain = curve.gain()
    assert gain is not None
    assert gain[0] == pytest.approx(1.4, rel=0.02)
    assert gain[2] == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("time_constant", [0.02, 0.8])
def test_sigma_of_lag_and_gain(time_constant: float) -> None:
    """Of 60 draws of white and of autocorrelated noise."""
    lags, gains = [], []
    for seed in range(60):
        predicted = excitation(seed)
        noise = 0.3 * slow_noise(1000 + seed, time_constant)
        curve = curve_of(np.interp(TIME - 0.2, TIME, predicted) + noise, predicted)
        found, gain = curve.best(), curve.gain()
        assert found is not None
        assert gain is not None
        lags.append((found[0] - 0.2) / found[1])
        gains.append((gain[0] - 1.0) / gain[1])
    for z in (lags, gains):  # 15 blocks of 4 s: sigma itself varies by about a fifth
        assert 0.75 < np.sqrt(np.mean(np.square(z))) < 1.4


def test_an_inverted_signal_has_no_lag() -> None:
    predicted = np.sin(np.pi * TIME) + 0.3 * excitation(2)
    curve = curve_of(-predicted, predicted)
    assert curve.explained.max() > 0.5  # half a period later or earlier
    assert curve.best() is None


def test_of_several_maxima_the_smallest_lag_counts() -> None:
    """A period of 2 s: 0.1 and -1.9 s late explain the same, apart from the noise."""
    predicted = np.sin(np.pi * TIME)
    for seed in range(5):
        found = curve_of(np.sin(np.pi * (TIME - 0.1)) + 0.2 * slow_noise(seed, 0.02), predicted).best()
        assert found is not None
        assert found[0] == pytest.approx(0.1, abs=0.03)


def test_too_few_samples_and_missing_ones() -> None:
    predicted = excitation(3)
    assert lag_curve(predicted[:100], predicted[:100]) is None
    measured = np.interp(TIME - 0.3, TIME, predicted)
    measured[200:600] = np.nan
    found = curve_of(measured, predicted).best()
    assert found is not None
    assert found[0] == pytest.approx(0.3, abs=0.002)
