"""Paths: geometry by finite differences, SAE J2179, and limits that hold for every seed."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import cumulative_trapezoid

from fifthwheel.base.errors import SignalError
from fifthwheel.model.manoeuvres import (
    LaneChange,
    constant_radius,
    everyday,
    lane_changes,
    lane_changes_on_test_track,
    slow_turns,
    straight,
)
from tests.model.manoeuvres.conftest import KMH_88, G, check_geometry


def test_lateral_acceleration_moves_the_truck_by_the_offset():
    time = np.arange(0, 32, 0.001)
    acceleration = LaneChange().acceleration(time, KMH_88, 4)
    assert acceleration.max() == pytest.approx(2 * np.pi * 1.464 / (61 / KMH_88) ** 2, rel=1e-4)
    offset = cumulative_trapezoid(cumulative_trapezoid(acceleration, time, initial=0), time, initial=0)
    np.testing.assert_allclose(offset[[4000, 12000, 20000, 28000]], [1.464, 0, 1.464, 0], atol=2e-3)
    small = LaneChange(offset=0.5, length=40, min_period=4, rest=1, lead=2).acceleration(time, 20.0, 1)
    assert np.flatnonzero(small)[[0, -1]] * 0.001 == pytest.approx([2.0, 4.0], abs=2e-3)


@settings(max_examples=10, deadline=None)
@given(
    offset=st.floats(-5, 5),
    length=st.floats(20, 150),
    speed=st.floats(5, 40),
    rest=st.floats(0.5, 9),
    count=st.integers(1, 4),
)
def test_path_of_any_lane_change(offset, length, speed, rest, count):
    path = LaneChange(offset=offset, length=length, rest=rest).path(count=count, speed=speed)
    check_geometry(path)
    assert path.y[-1] == pytest.approx(offset * (count % 2))
    assert path.heading[-1] == pytest.approx(0, abs=1e-12)
    assert (np.diff(path.x) > 0).all()


def test_path_is_that_of_the_standard():
    """1.464 m in 61 m, 0.15 g at 0.4 Hz, with the lateral acceleration of the linear model's manoeuvre."""
    path = lane_changes(count=4)
    time = path.arc / KMH_88
    acceleration = path.curvature * KMH_88**2
    assert np.abs(acceleration).max() == pytest.approx(0.15 * G, rel=0.01)
    first = time < 4
    assert time[acceleration[first].argmin()] - time[acceleration[first].argmax()] == pytest.approx(0.5 / 0.4, rel=0.02)
    np.testing.assert_allclose(acceleration, LaneChange().acceleration(time, KMH_88, 4), atol=0.02)
    offset = np.interp([1.0, 1.0 + 61 / KMH_88, 9.0, 17.0, 33.0], time, path.y)
    np.testing.assert_allclose(offset, [0, 1.464, 1.464, 0, 0], atol=1e-3)
    start = path.x[np.flatnonzero(path.curvature)[0]]
    assert start == pytest.approx(KMH_88, abs=0.3)
    assert path.duration == 33


def test_path_on_the_test_track():
    path = lane_changes_on_test_track()
    assert path.name == "test_track"
    assert path.y.max() == pytest.approx(4)
    assert np.abs(path.curvature * path.speed**2).max() == pytest.approx(0.27 * G, rel=0.05)
    assert ((path.y[:-1] < 2) != (path.y[1:] < 2)).sum() == 10


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


@settings(max_examples=10, deadline=None)
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
    np.testing.assert_array_equal(path.curvature, everyday(seed=seed, duration=120, speed=speed).curvature)
    assert path.curvature.any()  # a short road may bend to one side only
    assert (path.curvature == 0).any()


def test_arrays_are_validated_and_read_only():
    path = straight(duration=5)
    with pytest.raises(ValueError, match="read-only"):
        path.x[0] = 1.0
    for wrong in ({"length": 0.0}, {"length": float("inf")}, {"rest": -1.0}):
        with pytest.raises(SignalError, match=f"{next(iter(wrong))}: expected a number above 0"):
            LaneChange(**wrong)
    with pytest.raises(SignalError, match="heading: expected at least 2 finite numbers"):
        replace(path, heading=path.heading[1:])
    with pytest.raises(SignalError, match="y: expected at least 2 finite"):
        replace(path, y=np.full_like(path.y, np.nan))
    with pytest.raises(SignalError, match="arc: expected numbers that rise from 0 in equal steps"):
        replace(path, arc=path.arc**2)
    with pytest.raises(SignalError, match="speed: expected a number above 0, got 0"):
        replace(path, speed=np.zeros_like(path.arc))
