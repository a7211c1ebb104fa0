"""The smooth curve of a speed: against weighted least squares by NumPy, constant rates, the noise, and the ends."""

import numpy as np
import pytest

from fifthwheel.estimate.filters.step_rows import CUT, STEP, WIDTH, SpeedCurve


def test_it_equals_weighted_least_squares() -> None:
    """The parabola gives the speed, the line its rate; also near the ends, where there are samples on one side only."""
    time = np.linspace(0, 99 * STEP, 100)
    speed = 20 + np.cumsum(np.random.default_rng(0).normal(0, 0.1, time.size))
    speeds, _, rates, _ = SpeedCurve(time, speed)(time)
    for k in (0, 1, 10, 50, 98, 99):
        t = time - time[k]
        near = np.abs(t) <= CUT * WIDTH
        weights = np.exp(-(t[near] ** 2) / (4 * WIDTH**2))  # of the residuals, not of their squares
        parabola, line = (np.polyfit(t[near], speed[near], degree, w=weights) for degree in (2, 1))
        np.testing.assert_allclose([speeds[k], rates[k]], [parabola[-1], line[0]], rtol=1e-9)


@pytest.mark.parametrize("rate", [10, 100])
def test_a_constant_rate_is_exact(rate: float) -> None:
    """Inside the log and outside of it, with samples that are missing."""
    time = np.arange(0, 10, 1 / rate)
    time = time[(time < 4) | (time > 4.4)]
    at = np.linspace(-0.5, 10.5, 500)
    speeds, slopes, rates, changes = SpeedCurve(time, 20 - 0.8 * time)(at)
    np.testing.assert_allclose(speeds, 20 - 0.8 * at, atol=1e-9)
    np.testing.assert_allclose([slopes, rates], -0.8, atol=1e-9)
    np.testing.assert_allclose(changes, 0.0, atol=1e-9)


def test_it_has_no_delay_and_is_smooth() -> None:
    """Of a speed that falls, is constant and rises, and of one in steps, as on a CAN bus."""
    time = np.cumsum(np.random.default_rng(0).uniform(0.005, 0.015, 1000))
    slope = np.select([time < 3, time < 7], [-2.0, 0.0], 1.0)
    speed = 20 + np.concatenate([[0.0], np.cumsum(slope[1:] * np.diff(time))])
    speeds, _, rates, _ = SpeedCurve(time, speed)(time)
    settled = np.abs(time[:, None] - [3.0, 7.0]).min(axis=1) > CUT * WIDTH
    np.testing.assert_allclose(speeds[settled], speed[settled], atol=0.02)
    np.testing.assert_allclose(rates[settled], slope[settled], atol=0.02)
    for middle, height in ((3.0, -1.0), (7.0, 0.5)):  # half way where the slope changes
        assert np.interp(middle, time, rates) == pytest.approx(height, abs=0.03)
    steps = SpeedCurve(time, np.round(speed, 1))
    np.testing.assert_allclose(steps(time)[2][settled], slope[settled], atol=0.1)
    inside, h = np.linspace(time[0] + 0.1, time[-1] - 0.1, 300), 1e-4
    now, later, before = (steps(inside + s) for s in (0.0, h, -h))
    for value, its_slope in ((0, 1), (2, 3)):
        np.testing.assert_allclose(now[its_slope], (later[value] - before[value]) / (2 * h), atol=1e-3)


def test_noise() -> None:
    """The standard deviation of the slope of a line with Gaussian weights."""
    dt, sigma = 0.01, 0.1
    noise = np.random.default_rng(1).normal(0, sigma, 200_000)
    _, _, rates, _ = SpeedCurve(np.linspace(0, (noise.size - 1) * dt, noise.size), 20 + noise)(np.arange(10, 1990, 0.5))
    assert rates.std() == pytest.approx(sigma * np.sqrt(dt / (4 * np.sqrt(np.pi) * WIDTH**3)), rel=0.03)
