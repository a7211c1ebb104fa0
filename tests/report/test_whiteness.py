"""Whether a residual is noise."""

import numpy as np
import pytest
from scipy import stats

from fifthwheel.report import whiteness

TIME = np.arange(4000) * 0.01
NOISE = np.random.default_rng(1).standard_normal(4000)


def test_white_noise_is_white():
    found = whiteness.correlation(TIME, NOISE)
    assert found.together is None
    assert np.mean(np.abs(found.value) < found.limit) == pytest.approx(0.95, abs=0.04)
    assert found.lag[0] == pytest.approx(0.01)
    assert "as good as white" in whiteness.in_words(found, whiteness.beyond(NOISE), free_run=True)


def test_a_slow_wave_hangs_together():
    found = whiteness.correlation(TIME, np.sin(2 * np.pi * 0.25 * TIME) + 0.3 * NOISE)
    assert found.together == pytest.approx(1.0, abs=0.1)  # a quarter of its period
    told = whiteness.in_words(found, 0.0, free_run=True)
    assert "for about 0.9 s" in told
    assert "sigma of the parameters" in told


def test_a_first_order_process_has_its_correlation():
    values = np.zeros(4000)
    for i in range(1, 4000):
        values[i] = 0.9 * values[i - 1] + NOISE[i]
    found = whiteness.correlation(TIME, values)
    assert found.value[:5] == pytest.approx(0.9 ** np.arange(1, 6), abs=0.05)


def test_holes_and_a_slower_channel_keep_their_lags():
    values = np.where(np.arange(4000) % 2 == 0, NOISE, np.nan)
    values[1000:1400] = np.nan
    found = whiteness.correlation(TIME, values)
    assert found.lag[0] == pytest.approx(0.02)
    assert found.together is None
    assert np.isfinite(found.value).all()


@pytest.mark.parametrize("values", [np.full(100, np.nan), np.ones(100), np.r_[NOISE[:20], np.full(80, np.nan)]])
def test_too_little_says_nothing(values):
    assert whiteness.correlation(TIME[:100], values) is None
    assert "too few" in whiteness.in_words(None, np.nan, free_run=False)


def test_the_band_of_an_rms_is_that_of_chi_squared():
    for count in (30, 200, 5000):
        exact = np.sqrt(stats.chi2.ppf([0.025, 0.975], count) / count)
        assert whiteness.expected(count) == pytest.approx(exact, rel=2e-3)


def test_stretches_find_where_it_is_loud():
    loud = NOISE.copy()
    loud[2000:2500] *= 3
    found = whiteness.stretches(TIME, loud)
    assert len(found.rms) == whiteness.STRETCHES
    assert found.time[np.argmax(found.rms)] == pytest.approx(22.5, abs=2.5)
    assert whiteness.stretches(TIME, NOISE).inside > 0.8
    assert whiteness.stretches(TIME[:10], NOISE[:10]) is None


@pytest.mark.parametrize(("size", "said"), [(1.0, "as expected"), (1.1, "no harm"), (2.0, "narrow"), (0.4, "wider")])
def test_sizes_in_words(size, said):
    assert said in whiteness.size_in_words(size, 1000)


def test_outliers_are_told():
    spiky = NOISE.copy()
    spiky[::50] *= 20
    assert "outliers" in whiteness.in_words(whiteness.correlation(TIME, spiky), whiteness.beyond(spiky), free_run=True)
