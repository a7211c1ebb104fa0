"""Wheel speed differences of records and samples; the noise of a channel, from its high frequencies."""

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from fifthwheel.data.record.derived import (
    article_gyro_variance,
    estimate_noise_variance,
    sample_with_differences,
    sides_of,
    wheel_speed_difference,
)
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import get

DIFFERENCE = "wheel_speed_difference.semitrailer.middle"
LEFT, RIGHT = sides_of(DIFFERENCE)


def test_the_difference_of_a_sample() -> None:
    sample = {"time": 0.1, LEFT: 20.0, RIGHT: 20.2}
    assert sample_with_differences(sample, [DIFFERENCE]) == sample | {DIFFERENCE: pytest.approx(0.2 / 20.1)}
    assert np.isnan(sample_with_differences(sample | {RIGHT: None}, [DIFFERENCE])[DIFFERENCE])
    assert np.isnan(sample_with_differences({"time": 0.1}, [DIFFERENCE])[DIFFERENCE])
    assert np.isnan(wheel_speed_difference(0.9, 1.1))
    given = {"time": 0.1, DIFFERENCE: 0.01}
    assert sample_with_differences(given, [DIFFERENCE]) is given


RNG = np.random.default_rng(5)
WHITE = RNG.normal(size=20_000)
TIME = np.arange(20_000) / 100


@pytest.mark.parametrize(("manoeuvre", "rate"), [("lane_changes", 20), ("sweep", 50), ("random", 200)])
def test_noise_of_gyros_on_a_moving_truck(manoeuvre, rate):
    gyros = article_gyro_variance(["tractor", "semitrailer"])
    record = simulate(get("cheng_cebon_2011"), manoeuvre=manoeuvre, duration=60, rate=rate, seed=2)
    for name, variance in gyros.items():
        assert estimate_noise_variance(record.time, record.signals[name]) == pytest.approx(variance, rel=0.25), name


def test_what_does_not_change_the_estimate():
    """A low-pass filter; repeated samples, which count once; bumps, gaps and drift. Too few segments give none."""
    filtered = lfilter(*butter(2, 15 / 50), WHITE)
    assert filtered.var() < 0.4
    assert estimate_noise_variance(TIME, filtered) == pytest.approx(1.0, rel=0.2)
    assert estimate_noise_variance(TIME, np.repeat(WHITE[:2000], 10)) == pytest.approx(10, rel=0.2)
    sparse = np.where(np.arange(20_000) % 10, np.nan, WHITE)
    assert estimate_noise_variance(TIME, sparse) == pytest.approx(1, rel=0.2)
    values = WHITE + 0.01 * TIME**2 + 30.0 * (np.arange(20_000) % 4000 < 50)
    values[5000:5500] = np.nan
    rows = np.r_[0:9000, 9500:20_000]
    assert estimate_noise_variance(TIME[rows], values[rows]) == pytest.approx(1, rel=0.2)
    for few in (WHITE[:300], WHITE[:5], np.full(20_000, np.nan)):
        assert estimate_noise_variance(TIME[: few.size], few) is None
    assert estimate_noise_variance(TIME, np.zeros(20_000)) == 0.0
