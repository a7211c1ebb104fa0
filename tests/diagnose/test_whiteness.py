"""Whether a residual is white noise."""

import numpy as np
import pytest
from scipy import stats

from fifthwheel.diagnose import whiteness
from fifthwheel.diagnose.thresholds import SEGMENTS

TIME = np.arange(4000) * 0.01
NOISE = np.random.default_rng(1).standard_normal(4000)


def test_white_noise_is_white():
    correlation = whiteness.autocorrelation(TIME, NOISE)
    assert correlation.time is None
    assert np.mean(np.abs(correlation.value) < correlation.limit) == pytest.approx(0.95, abs=0.04)
    assert correlation.lag[0] == pytest.approx(0.01)
    assert "is white noise" in whiteness.describe_whiteness(
        correlation, whiteness.outlier_fraction(NOISE), free_run=True
    )


def test_a_slow_wave_is_autocorrelated_over_a_quarter_of_its_period():
    correlation = whiteness.autocorrelation(TIME, np.sin(2 * np.pi * 0.25 * TIME) + 0.3 * NOISE)
    assert correlation.time == pytest.approx(1.0, abs=0.1)
    text = whiteness.describe_whiteness(correlation, 0.0, free_run=True, in_sigma=True)
    assert "autocorrelated over about 0.9 s" in text
    assert "sigma of the parameters" in text
    assert "vehicle file" in whiteness.describe_whiteness(correlation, 0.0, free_run=False)


def test_the_autocorrelation_of_a_first_order_process_is_exponential():
    values = np.zeros(4000)
    for i in range(1, 4000):
        values[i] = 0.9 * values[i - 1] + NOISE[i]
    correlation = whiteness.autocorrelation(TIME, values)
    assert correlation.value[:5] == pytest.approx(0.9 ** np.arange(1, 6), abs=0.05)


def test_gaps_and_a_lower_rate_do_not_change_the_lags():
    values = np.where(np.arange(4000) % 2 == 0, NOISE, np.nan)
    values[1000:1400] = np.nan
    correlation = whiteness.autocorrelation(TIME, values)
    assert correlation.lag[0] == pytest.approx(0.02)
    assert correlation.time is None
    assert np.isfinite(correlation.value).all()


@pytest.mark.parametrize("values", [np.full(100, np.nan), np.ones(100), np.r_[NOISE[:20], np.full(80, np.nan)]])
def test_too_few_samples_give_no_test(values):
    assert whiteness.autocorrelation(TIME[:100], values) is None
    assert "too few" in whiteness.describe_whiteness(None, np.nan, free_run=False)


def test_rms_limits_are_those_of_chi_squared():
    for count in (30, 200, 5000):
        exact = np.sqrt(stats.chi2.ppf([0.025, 0.975], count) / count)
        assert whiteness.rms_limits(count) == pytest.approx(exact, rel=2e-3)


def test_segments_locate_larger_innovations():
    large = NOISE.copy()
    large[2000:2500] *= 3
    segments = whiteness.segment_rms(TIME, large)
    assert len(segments.rms) == SEGMENTS
    assert segments.time[np.argmax(segments.rms)] == pytest.approx(22.5, abs=2.5)
    assert whiteness.segment_rms(TIME, NOISE).fraction_within_limits > 0.8
    assert whiteness.segment_rms(TIME[:10], NOISE[:10]) is None


@pytest.mark.parametrize(
    ("rms", "expected"), [(1.0, "is expected."), (1.1, "no practical effect"), (2.0, "too narrow"), (0.4, "wider")]
)
def test_the_rms_of_innovations_in_words(rms, expected):
    assert expected in whiteness.describe_innovation_rms(rms, 1000)


def test_outliers_are_mentioned():
    values = NOISE.copy()
    values[::50] *= 20
    correlation = whiteness.autocorrelation(TIME, values)
    assert "outliers" in whiteness.describe_whiteness(correlation, whiteness.outlier_fraction(values), free_run=True)
