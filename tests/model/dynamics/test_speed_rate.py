"""The derivative of the speed: a ramp, the delay, the noise, gaps, and both forms."""

import copy

import numpy as np
import pytest

from fifthwheel.model.dynamics.speed_rate import SpeedRate, speed_rates

T = 0.2
UNEVEN = np.cumsum(np.random.default_rng(0).uniform(0.005, 0.015, 1000))
GAP = 1.0


def test_a_ramp() -> None:
    """The derivative of a ramp is exact in the end, at any steps, and `2` time constants late on average."""
    start = 2.0
    rates = speed_rates(UNEVEN, 20.0 - 3.0 * np.maximum(UNEVEN - start, 0.0), T, GAP)
    assert (rates[start > UNEVEN] == 0).all()
    np.testing.assert_allclose(rates[start + 15 * T < UNEVEN], -3.0, atol=1e-3)
    delay = np.trapezoid(1 + rates / 3, UNEVEN) - start
    assert delay == pytest.approx(2 * T, abs=0.02)  # less two steps
    assert rates.min() > -3.0 - 1e-9  # no overshoot


def test_noise() -> None:
    dt, sigma = 0.01, 0.1
    noise = np.random.default_rng(1).normal(size=200_000) * sigma
    rates = speed_rates(np.arange(noise.size) * dt, 20 + noise, T, GAP)
    assert rates.std() == pytest.approx(sigma * np.sqrt(dt / (4 * T**3)), rel=0.1)


def test_it_starts_again_after_a_gap() -> None:
    time = np.concatenate([np.arange(100), np.arange(300, 400)]) * 0.01
    rates = speed_rates(time, 20 - 3 * time, T, GAP)
    assert rates[0] == rates[100] == 0
    assert rates[99] < -2.5
    assert rates[101] < 0
    assert (speed_rates(UNEVEN, 20 - 3 * UNEVEN, np.inf, GAP) == 0).all()  # of an infinite time constant


@pytest.mark.parametrize("longest", [GAP, np.inf])
def test_both_forms_agree(longest: float) -> None:
    """Bit for bit, with a gap."""
    time = UNEVEN + 2.0 * (UNEVEN > 5)
    speed = 20 - time + np.random.default_rng(2).normal(size=len(time)) * 0.1
    single = SpeedRate(T, longest)
    ages = np.diff(time, prepend=-np.inf)
    actual = [single.update(age, value) for age, value in zip(ages.tolist(), speed.tolist(), strict=True)]
    np.testing.assert_array_equal(actual, speed_rates(time, speed, T, longest))
    other = copy.deepcopy(single)
    assert other.update(0.1, 12.0) == single.update(0.1, 12.0) != single.update(0.1, 30.0)
    assert other.update(0.1, 12.0) != single.update(0.1, 12.0)
    assert np.isfinite(actual).all()
