"""Lateral accelerations for the linear model, the steer angles that give them, and the candidates of the design."""

import numpy as np
import pytest

from fifthwheel.model.manoeuvres import accelerations
from fifthwheel.model.manoeuvres.accelerations import lateral_acceleration
from fifthwheel.model.manoeuvres.candidates import candidate_manoeuvres

RATE, SPEED = 100.0, 22.0
CANDIDATES = range(5)
"""Two lane changes, sweep, random, bend."""


@pytest.mark.parametrize("number", CANDIDATES)
def test_the_steer_angle_gives_the_acceleration(truck, number):
    """The response by time steps against the inverse in the frequency domain; it has unit size and ends in time."""
    candidate = candidate_manoeuvres(SPEED, (0.3, 0.5))[number]
    time = np.arange(0, 40, 0.001)
    acceleration = candidate.acceleration(time)
    assert np.abs(acceleration).max() == pytest.approx(1.0, rel=0.02)
    assert (acceleration[(time < 1.0) | (time > candidate.period)] == 0.0).all()
    steer = candidate.steer(truck, RATE)
    time = np.arange(len(steer)) / RATE
    response = lateral_acceleration(truck, SPEED, steer, RATE)[:, 0]
    np.testing.assert_allclose(response, candidate.acceleration(time), atol=0.03)


def test_repetitions_alternate_and_superpose(truck):
    candidate = candidate_manoeuvres(SPEED, (0.4,))[0]
    steer = candidate.steer(truck, RATE)
    three = candidate.repeated(steer, 3, RATE)
    assert len(three) == 3 * round(candidate.period * RATE)
    time = np.arange(len(three)) / RATE
    expected = sum((-1) ** k * candidate.acceleration(time - k * candidate.period) for k in range(3))
    np.testing.assert_allclose(lateral_acceleration(truck, SPEED, three, RATE)[:, 0], expected, atol=0.03)


@pytest.mark.parametrize(("rate", "duration"), [(20.0, 23.5), (50.0, 23.0), (137.0, 31.0)])
def test_the_sweep_is_finite_at_any_rate_and_duration(rate, duration):
    """The sine of the window may be below zero by rounding at the end."""
    time = np.arange(round(duration * rate)) / rate
    acceleration = accelerations.sweep(time)
    assert np.isfinite(acceleration).all()
    assert 1.1 < np.abs(acceleration).max() <= 1.2
