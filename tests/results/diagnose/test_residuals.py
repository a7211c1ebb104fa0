"""Whether a residual is white noise."""

import numpy as np
import pytest
from scipy import stats

from fifthwheel.results.diagnose import residuals

TIME = np.arange(4000) * 0.01
NOISE = np.random.default_rng(1).standard_normal(4000)


def test_white_noise_is_white():
    correlation = residuals.autocorrelation(TIME, NOISE)
    assert correlation.time is None
    assert np.mean(np.abs(correlation.value) < correlation.limit) == pytest.approx(0.95, abs=0.04)
    assert correlation.lag[0] == pytest.approx(0.01)
    assert "is white noise" in residuals.describe_whiteness(
        correlation, residuals.outlier_fraction(NOISE), free_run=True
    )


@pytest.mark.parametrize("values", [np.full(100, np.nan), np.ones(100), np.r_[NOISE[:20], np.full(80, np.nan)]])
def test_too_few_samples_give_no_test(values):
    assert residuals.autocorrelation(TIME[:100], values) is None
    assert "too few" in residuals.describe_whiteness(None, np.nan, free_run=False)


def test_rms_limits_are_those_of_chi_squared():
    for count in (30, 200, 5000):
        exact = np.sqrt(stats.chi2.ppf([0.025, 0.975], count) / count)
        assert residuals.rms_limits(count) == pytest.approx(exact, rel=2e-3)


def test_the_autocorrelation_equals_a_sum_over_pairs():
    """With gaps, on the channel's own step; at most 300 lags, a third of the samples, and 2 s but at least 20 lags."""
    random = np.random.default_rng(4)
    for step, count, expected_lags in ((0.01, 900, 200), (0.2, 900, 20), (0.004, 2000, 300), (0.01, 90, 30)):
        time = 5.0 + step * np.arange(count)
        values = 3.0 + np.convolve(random.normal(size=count + 4), np.ones(5), "valid")
        values[random.random(count) < 0.2] = np.nan
        values[[0, 1]] = 3.0
        n = np.isfinite(values).sum()
        correlation = residuals.autocorrelation(time, values)
        lags = len(correlation.value)
        assert lags == min(expected_lags, n // 3)
        np.testing.assert_allclose(correlation.lag, step * np.arange(1, lags + 1))
        assert correlation.limit == pytest.approx(1.96 / np.sqrt(n))
        deviation = values - np.nanmean(values)
        variance = np.nanmean(deviation**2)
        for k in (1, 2, 5, lags - 1, lags):
            products = deviation[k:] * deviation[:-k]
            assert correlation.value[k - 1] == pytest.approx(np.nanmean(products) / variance, abs=1e-9)


def first_order(pole, count=4000, seed=1):
    values = np.random.default_rng(seed).normal(size=count)
    for k in range(1, count):
        values[k] += pole * values[k - 1]
    return values


def test_a_correlation_must_be_relevant_and_significant():
    """Above 0.2 and above 1.5 times the 95 % limit of white noise at some of the first lags."""
    for pole, autocorrelated in ((0.1, False), (0.3, True)):
        correlation = residuals.autocorrelation(TIME, first_order(pole))
        assert (correlation.time is not None) == autocorrelated
    few = residuals.autocorrelation(TIME[:60], first_order(0.3, 60))
    assert 0.2 < np.abs(few.value[:5]).max() < 1.5 * few.limit
    assert few.time is None


def test_the_time_of_a_correlation_ends_below_the_limit():
    """The first lag within half of 0.2, or within the limit if that is larger."""
    for pole in (0.6, 0.95):
        correlation = residuals.autocorrelation(TIME, first_order(pole))
        below = np.flatnonzero(np.abs(correlation.value) < max(correlation.limit, 0.1))
        assert correlation.time == correlation.lag[below[0]]
        assert correlation.time == pytest.approx(0.01 * np.log(0.1) / np.log(pole), rel=0.8)  # of one draw
    constant = residuals.autocorrelation(TIME, np.where(TIME < 20, 1.0, -1.0) + 0.01 * NOISE)
    assert constant.time == constant.lag[-1] == pytest.approx(2.0)
    assert "2 s or more" in residuals.describe_whiteness(constant, 0.0, free_run=True)
    alternating = residuals.autocorrelation(TIME, np.tile([1.0, 0.0, -1.0, 0.0], 1000) + 0.01 * NOISE)
    assert alternating.time == pytest.approx(0.01)  # the first lag itself is within the limit


def test_segments_of_equally_many_samples():
    """24 at most, of 30 samples at least, each with its middle and the limits of its size."""
    for count, expected in ((29, None), (30, 1), (59, 1), (60, 2), (24 * 30, 24), (4000, 24)):
        values = np.where(np.arange(count) % 10 == 3, np.nan, NOISE[:count]) if count > 100 else NOISE[:count]
        segments = residuals.segment_rms(TIME[:count], values)
        assert (segments and len(segments.rms)) == (
            min(expected, np.isfinite(values).sum() // 30) if expected else None
        )
    rows = np.array_split(np.flatnonzero(np.isfinite(values)), 24)
    np.testing.assert_allclose(segments.time, [TIME[r].mean() for r in rows])
    np.testing.assert_allclose(segments.rms, [np.sqrt(np.mean(values[r] ** 2)) for r in rows])
    low, high = np.transpose([residuals.rms_limits(len(r)) for r in rows])
    np.testing.assert_array_equal((segments.low, segments.high), (low, high))
    inside = (segments.rms >= low) & (segments.rms <= high)
    assert segments.fraction_within_limits == inside.mean()


def test_whiteness_in_words():
    coloured = residuals.autocorrelation(TIME, first_order(0.95))
    residual = residuals.describe_whiteness(coloured, 0.0, free_run=True)
    assert "error of the model, the road or a sensor" in residual
    assert "sigma of the parameters" not in residual
    innovation = residuals.describe_whiteness(coloured, 0.0, free_run=False)
    assert "error of the vehicle file or of the assumed noise" in innovation
