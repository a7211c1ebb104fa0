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


def test_it_is_relative_to_the_mean() -> None:
    assert wheel_speed_difference(20.0, 20.2) == pytest.approx(0.2 / 20.1)
    assert np.isnan(wheel_speed_difference(0.9, 1.1))


def test_the_difference_of_a_sample() -> None:
    sample = {"time": 0.1, LEFT: 20.0, RIGHT: 20.2}
    assert sample_with_differences(sample, [DIFFERENCE]) == sample | {DIFFERENCE: pytest.approx(0.2 / 20.1)}
    assert np.isnan(sample_with_differences(sample | {RIGHT: None}, [DIFFERENCE])[DIFFERENCE])
    assert np.isnan(sample_with_differences({"time": 0.1}, [DIFFERENCE])[DIFFERENCE])
    given = {"time": 0.1, DIFFERENCE: 0.01}
    assert sample_with_differences(given, [DIFFERENCE]) is given


RNG = np.random.default_rng(5)
WHITE = RNG.normal(size=20_000)
TIME = np.arange(20_000) / 100


@pytest.mark.parametrize("manoeuvre", ["lane_changes", "sweep", "random", "straight"])
@pytest.mark.parametrize("rate", [20, 50, 200])
def test_noise_of_gyros_on_a_moving_truck(manoeuvre, rate):
    gyros = article_gyro_variance(["tractor", "semitrailer"])
    record = simulate(get("cheng_cebon_2011"), manoeuvre=manoeuvre, duration=60, rate=rate, seed=2)
    for name, variance in gyros.items():
        assert estimate_noise_variance(record.time, record.signals[name]) == pytest.approx(variance, rel=0.25), name


def test_a_low_pass_filter_does_not_change_the_estimate():
    b, a = butter(2, 15 / 50)
    filtered = lfilter(b, a, WHITE)
    assert filtered.var() < 0.4
    assert estimate_noise_variance(TIME, filtered) == pytest.approx(1.0, rel=0.2)


def test_repeated_samples_count_once():
    distinct = WHITE[:2000]
    assert estimate_noise_variance(TIME, np.repeat(distinct, 10)) == pytest.approx(10, rel=0.2)
    sparse = np.full(20_000, np.nan)
    sparse[::10] = distinct
    assert estimate_noise_variance(TIME, sparse) == pytest.approx(1, rel=0.2)


def test_bumps_gaps_and_drift_do_not_change_the_estimate():
    values = WHITE + 0.01 * TIME**2
    for start in range(0, 20_000, 4000):
        values[start : start + 50] += 30.0
    values[5000:5500] = np.nan
    rows = np.r_[0:9000, 9500:20_000]
    assert estimate_noise_variance(TIME[rows], values[rows]) == pytest.approx(1, rel=0.2)


def test_too_few_segments_give_no_estimate():
    assert estimate_noise_variance(TIME[:300], WHITE[:300]) is None
    assert estimate_noise_variance(TIME[:5], WHITE[:5]) is None
    assert estimate_noise_variance(TIME, np.full(20_000, np.nan)) is None
    assert estimate_noise_variance(TIME, np.zeros(20_000)) == 0.0
