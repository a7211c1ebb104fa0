"""The catalogue: every form of every manoeuvre works, and a form that does not exist is refused."""

import numpy as np
import pytest

from fifthwheel.base.errors import SignalError
from fifthwheel.model.manoeuvres import (
    MANOEUVRES,
    PLANT_MANOEUVRES,
    OpenLoop,
    Path,
    course,
)
from fifthwheel.truck import get
from tests.model.manoeuvres.conftest import KMH_88, check_geometry


@pytest.mark.parametrize("name", PLANT_MANOEUVRES)
def test_courses_of_the_plant(name, truck):
    result = course(name, truck)
    assert result.name == name
    assert result.duration > 5
    assert result.speed.min() >= 5
    if isinstance(result, Path):
        assert MANOEUVRES[name].path
        check_geometry(result)
    else:
        assert MANOEUVRES[name].open_loop
        np.testing.assert_allclose(np.diff(result.time), 0.01, atol=1e-9)
        assert result.steer[0] == 0
        assert 0 < np.abs(result.steer).max() < 0.1
        assert result.time[-1] == result.duration


def test_arguments_have_an_effect(truck):
    assert course("lane_changes", truck, count=3, speed=20).duration == pytest.approx(1 + 3 * (61 / 20 + 5.5), abs=0.05)
    assert course("straight", truck, duration=12).duration == 12
    assert course("everyday", truck, speed=12, duration=60).speed.max() <= 12 + 1e-9
    one, two = (course("random", truck, seed=seed, duration=20) for seed in (1, 2))
    assert isinstance(one, OpenLoop)
    assert isinstance(two, OpenLoop)
    assert not np.array_equal(one.steer, two.steer)
    assert course("straight", truck, seed=7).speed[0] == KMH_88


@pytest.mark.parametrize("name", PLANT_MANOEUVRES)
def test_braking_reduces_the_speed_and_nothing_else(name, truck):
    """From 1 s on, by 3 m/s per second, to 6 m/s."""
    free, result = course(name, truck), course(name, truck, braking=3.0)
    for field in ("x", "y", "heading", "curvature", "steer", "duration"):
        np.testing.assert_array_equal(getattr(result, field, None), getattr(free, field, None))
    assert (result.speed <= free.speed).all()
    assert result.speed.min() == 6.0
    time = np.interp(result.arc, *_arc_over_time(result)) if isinstance(result, Path) else result.time
    start, speed = result.speed[0], result.speed[time < 1]
    assert (speed == free.speed[time < 1]).all()
    falling = (time > 1.1) & (result.speed > 6.1) & (result.speed < free.speed)
    np.testing.assert_allclose(result.speed[falling], start - 3.0 * (time[falling] - 1), atol=0.01)


def _arc_over_time(path):
    """Arc length and time at the points of a path."""
    mean = (path.speed[1:] + path.speed[:-1]) / 2
    return path.arc, np.concatenate([[0.0], np.cumsum(np.diff(path.arc) / mean)])


def test_above_its_critical_speed_a_truck_needs_a_path():
    with pytest.raises(SignalError, match=r"speed: expected below 27\.6 m/s, .* got 30; .* along a path"):
        course("step", get("auburn_6x4"), speed=30)
    assert isinstance(course("lane_changes", get("auburn_6x4"), speed=30), Path)


@pytest.mark.parametrize(
    ("name", "given", "message"),
    [
        ("lane_change", {}, "manoeuvre: 'lane_change' is not known; choose one of lane_changes, test_track"),
        ("bend", {}, "manoeuvre: 'bend' exists only for the linear model; .* choose one of lane_changes, test_track"),
        ("straight", {"speed": 88}, r"speed: expected 5 to 40 m/s .* got 88 m/s .*; give a road speed"),
        ("straight", {"count": 3}, r"count: straight does not have it, got 3; .* \(straight has speed, duration\)"),
        ("lane_changes", {"duration": 30.0}, "duration: lane_changes does not have it, got 30"),
        ("lane_changes", {"count": 0}, "count: expected a number above 0"),
        ("step", {"duration": -1.0}, "duration: expected a number above 0, got -1"),
        ("random", {"duration": 0.5}, r"duration: expected a period of 0\.05 to 1 Hz within 0\.5 s"),
        ("random", {"seed": -1}, "seed: expected 0 or more"),
        ("straight", {"braking": 6.0}, r"braking: expected a deceleration above 0, up to 5 m/s\^2"),
        ("straight", {"braking": float("nan")}, r"braking: expected a deceleration above 0, up to 5 m/s\^2"),
        ("everyday", {"speed": 6.0}, "speed: expected 8 m/s or more as the highest speed of everyday driving, got 6"),
    ],
)
def test_impossible_courses_are_refused(truck, name, given, message):
    with pytest.raises(SignalError, match=message):
        course(name, truck, **given)
