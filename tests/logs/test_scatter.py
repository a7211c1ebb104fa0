"""A channel's own noise, beside the motion that it shows."""

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from fifthwheel import vehicle
from fifthwheel.logs.noise import article_gyros
from fifthwheel.logs.scatter import scatter
from fifthwheel.simulate import simulate

RNG = np.random.default_rng(5)
WHITE = RNG.normal(size=20_000)
TIME = np.arange(20_000) / 100


@pytest.mark.parametrize("manoeuvre", ["lane_changes", "sweep", "random", "straight"])
@pytest.mark.parametrize("rate", [20, 50, 200])
def test_noise_of_gyros_on_a_moving_truck(manoeuvre, rate):
    gyros = article_gyros(["tractor", "semitrailer"])
    record = simulate(vehicle.get("cheng_cebon_2011"), manoeuvre=manoeuvre, duration=60, rate=rate, seed=2)
    for name, variance in gyros.items():
        assert scatter(record.time, record.signals[name]) == pytest.approx(variance, rel=0.25), name


def test_a_filtered_sensor_is_worth_no_more_than_an_open_one():
    b, a = butter(2, 15 / 50)
    filtered = lfilter(b, a, WHITE)
    assert filtered.var() < 0.4
    assert scatter(TIME, filtered) == pytest.approx(1.0, rel=0.2)


def test_a_repeated_sample_is_worth_one():
    once = WHITE[:2000]
    assert scatter(TIME, np.repeat(once, 10)) == pytest.approx(10, rel=0.2)
    sparse = np.full(20_000, np.nan)
    sparse[::10] = once
    assert scatter(TIME, sparse) == pytest.approx(1, rel=0.2)


def test_bumps_gaps_and_drift_do_not_count():
    values = WHITE + 0.01 * TIME**2
    for start in range(0, 20_000, 4000):
        values[start : start + 50] += 30.0
    values[5000:5500] = np.nan
    gone = np.r_[0:9000, 9500:20_000]
    assert scatter(TIME[gone], values[gone]) == pytest.approx(1, rel=0.2)


def test_too_little_to_tell():
    assert scatter(TIME[:300], WHITE[:300]) is None
    assert scatter(TIME[:5], WHITE[:5]) is None
    assert scatter(TIME, np.full(20_000, np.nan)) is None
    assert scatter(TIME, np.zeros(20_000)) == 0.0
