"""Paths: geometry by finite differences, and limits that hold for every seed."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fifthwheel.base.errors import SignalError
from fifthwheel.model.manoeuvres import constant_radius, everyday, slow_turns, straight
from tests.model.manoeuvres.conftest import check_geometry


def test_constant_radius_is_a_circle():
    path = constant_radius(radius=80, speed=12, duration=60)
    circle = path.curvature == 1 / 80
    x, y = path.x[circle], path.y[circle]
    centre = np.linalg.lstsq(np.column_stack([2 * x, 2 * y, np.ones(len(x))]), x**2 + y**2)[0]
    np.testing.assert_allclose(np.hypot(x - centre[0], y - centre[1]), 80, atol=1e-6)
    assert centre[1] > 80  # to the left
    jerk = np.diff(path.curvature) / np.diff(path.arc) * 12**3
    assert jerk.max() == pytest.approx(1, rel=1e-6)


def test_speed_rises_on_the_circle():
    path = constant_radius(acceleration=0.1, duration=90)
    time = np.concatenate([[0], np.cumsum(np.diff(path.arc) * 2 / (path.speed[:-1] + path.speed[1:]))])
    rate = np.gradient(path.speed, time)
    assert time[-1] > 90
    assert rate[time > 25] == pytest.approx(0.1, abs=2e-3)
    with pytest.raises(SignalError, match="acceleration: expected 0"):
        constant_radius(acceleration=-0.1)


def test_slow_turns_are_right_angles_to_both_sides():
    path = slow_turns(radius=15.0, speed=6.0, duration=40.0)
    check_geometry(path)
    ends = path.heading[1:][(path.curvature[1:] == 0) & (path.curvature[:-1] != 0)]
    np.testing.assert_allclose(ends[:4], [np.pi / 2, 0, np.pi / 2, 0], atol=1e-2)
    assert np.abs(path.curvature).max() == pytest.approx(1 / 15)
    with pytest.raises(SignalError, match="radius: expected"):
        slow_turns(radius=0.0)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6), speed=st.floats(9, 35))
def test_everyday_driving_keeps_its_limits(seed, speed):
    path = everyday(seed=seed, duration=120, speed=speed)
    check_geometry(path)
    longitudinal = np.diff(path.speed**2) / 2 / np.diff(path.arc)
    assert longitudinal.min() >= -1 - 1e-6
    assert longitudinal.max() <= 0.4 + 1e-6
    assert np.abs(path.curvature * path.speed**2).max() <= 2 + 1e-6
    assert path.speed.min() >= 8 - 1e-6
    assert path.speed.max() <= speed + 1e-6


def test_everyday_road_has_straights_bends_to_both_sides_and_speed_limits():
    path = everyday(seed=3, duration=600)
    same, other = everyday(seed=3, duration=600), everyday(seed=4, duration=600)
    np.testing.assert_array_equal(path.curvature, same.curvature)
    assert not np.array_equal(path.curvature, other.curvature)
    assert (path.curvature == 0).mean() > 0.2
    assert np.abs(path.curvature * path.speed**2).max() > 1.5
    assert path.curvature.min() < -1e-3 < 1e-3 < path.curvature.max()
    assert np.ptp(path.speed) > 5


def test_arrays_are_validated_and_read_only():
    path = straight(duration=5)
    with pytest.raises(ValueError, match="read-only"):
        path.x[0] = 1.0
    with pytest.raises(SignalError, match="heading: expected at least 2 finite numbers"):
        replace(path, heading=path.heading[1:])
    with pytest.raises(SignalError, match="y: expected at least 2 finite"):
        replace(path, y=np.full_like(path.y, np.nan))
    with pytest.raises(SignalError, match="arc: expected numbers that rise from 0 in equal steps"):
        replace(path, arc=path.arc**2)
    with pytest.raises(SignalError, match="speed: expected a number above 0, got 0"):
        replace(path, speed=np.zeros_like(path.arc))
