"""The lane change: its two forms agree with each other and with SAE J2179."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import cumulative_trapezoid

from fifthwheel.base.errors import SignalError
from fifthwheel.model.manoeuvres import LaneChange, lane_changes, lane_changes_on_test_track
from tests.model.manoeuvres.conftest import KMH_88, G, check_geometry


def test_lateral_acceleration_moves_the_truck_by_the_offset():
    time = np.arange(0, 32, 0.001)
    acceleration = LaneChange().acceleration(time, KMH_88, 4)
    assert acceleration.max() == pytest.approx(2 * np.pi * 1.464 / (61 / KMH_88) ** 2, rel=1e-4)
    offset = cumulative_trapezoid(cumulative_trapezoid(acceleration, time, initial=0), time, initial=0)
    np.testing.assert_allclose(offset[[4000, 12000, 20000, 28000]], [1.464, 0, 1.464, 0], atol=2e-3)
    small = LaneChange(offset=0.5, length=40, min_period=4, rest=1, lead=2).acceleration(time, 20.0, 1)
    assert np.flatnonzero(small)[[0, -1]] * 0.001 == pytest.approx([2.0, 4.0], abs=2e-3)


@settings(max_examples=20, deadline=None)
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


@pytest.mark.parametrize("wrong", [{"length": 0.0}, {"length": float("inf")}, {"rest": -1.0}])
def test_impossible_lane_changes_are_refused(wrong):
    with pytest.raises(SignalError, match=f"{next(iter(wrong))}: expected a number above 0"):
        LaneChange(**wrong)
