"""Courses: their geometry by finite differences, what the standards ask for, limits that hold for every seed."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fifthwheel import dynamics
from fifthwheel.errors import SignalError
from fifthwheel.plant.courses import (
    COURSES,
    OpenLoop,
    Path,
    constant_radius,
    course,
    everyday,
    lane_changes,
    on_test_track,
    random,
    single_sine,
    steer_for,
    straight,
    sweep,
)
from fifthwheel.plant.courses import step as step_steer
from fifthwheel.simulate import LaneChange
from fifthwheel.vehicle import Vehicle, get

G = 9.80665
KMH_88 = 88 / 3.6


@pytest.fixture(scope="module")
def truck() -> Vehicle:
    return get("cheng_cebon_2011")


def check_geometry(path: Path) -> None:
    """x, y, heading and curvature tell of the same road, and arc is its length."""
    step = path.arc[1]
    assert 0 < step <= 0.25
    assert (path.x[0], path.y[0], path.heading[0]) == (0, 0, 0)
    dx, dy, turn = (np.gradient(values, step)[1:-1] for values in (path.x, path.y, path.heading))
    bend, change = np.abs(path.curvature).max(), np.abs(np.diff(path.curvature)).max() / step
    second = step**2 * (bend**2 + change) + 1e-9  # what central differences leave out
    np.testing.assert_allclose(dx, np.cos(path.heading[1:-1]), atol=second)
    np.testing.assert_allclose(dy, np.sin(path.heading[1:-1]), atol=second)
    np.testing.assert_allclose(turn, path.curvature[1:-1], atol=step * change / 2 + 1e-9)
    ride = np.cumsum(step / path.speed)
    assert ride[-1] > path.duration  # the road goes on after the drive


@pytest.mark.parametrize("name", COURSES)
def test_a_course_is_sound(name, truck):
    found = course(name, truck)
    assert found.name == name
    assert found.duration > 5
    assert found.speed.min() >= 5
    if isinstance(found, Path):
        check_geometry(found)
    else:
        np.testing.assert_allclose(np.diff(found.time), 0.01, atol=1e-9)
        assert found.steer[0] == 0
        assert 0 < np.abs(found.steer).max() < 0.1
        assert found.time[-1] == found.duration


@settings(max_examples=20, deadline=None)
@given(
    offset=st.floats(-5, 5),
    length=st.floats(20, 150),
    speed=st.floats(5, 40),
    rest=st.floats(0.5, 9),
    count=st.integers(1, 4),
)
def test_lane_changes_of_any_size(offset, length, speed, rest, count):
    path = lane_changes(count=count, offset=offset, length=length, speed=speed, rest=rest)
    check_geometry(path)
    assert path.y[-1] == pytest.approx(offset * (count % 2))
    assert path.heading[-1] == pytest.approx(0, abs=1e-12)
    assert (np.diff(path.x) > 0).all()


def test_the_lane_change_of_the_standard():
    """1.464 m in 61 m, 0.15 g at 0.4 Hz, as often and as the linear simulation drives them."""
    path = lane_changes(count=4)
    time = path.arc / KMH_88
    acceleration = path.curvature * KMH_88**2
    assert np.abs(acceleration).max() == pytest.approx(0.15 * G, rel=0.01)
    first = time < 4
    assert time[acceleration[first].argmin()] - time[acceleration[first].argmax()] == pytest.approx(0.5 / 0.4, rel=0.02)
    np.testing.assert_allclose(acceleration, LaneChange().acceleration(time, KMH_88, 4), atol=0.02)
    at = np.interp([1.0, 1.0 + 61 / KMH_88, 9.0, 17.0, 33.0], time, path.y)
    np.testing.assert_allclose(at, [0, 1.464, 1.464, 0, 0], atol=1e-3)
    begin = path.x[np.flatnonzero(path.curvature)[0]]
    assert begin == pytest.approx(KMH_88, abs=0.3)
    assert path.duration == 33


def test_the_test_track():
    path = on_test_track()
    assert path.name == "test_track"
    assert path.y.max() == pytest.approx(4)
    assert np.abs(path.curvature * path.speed**2).max() == pytest.approx(0.27 * G, rel=0.05)
    assert ((path.y[:-1] < 2) != (path.y[1:] < 2)).sum() == 10


def test_a_circle_is_one():
    path = constant_radius(radius=80, speed=12, duration=60)
    on = path.curvature == 1 / 80
    middle = np.linalg.lstsq(
        np.column_stack([2 * path.x[on], 2 * path.y[on], np.ones(on.sum())]), path.x[on] ** 2 + path.y[on] ** 2
    )[0]
    np.testing.assert_allclose(np.hypot(path.x[on] - middle[0], path.y[on] - middle[1]), 80, atol=1e-6)
    assert middle[1] > 80  # to the left
    jerk = np.diff(path.curvature) / np.diff(path.arc) * 12**3
    assert jerk.max() == pytest.approx(1, rel=1e-6)


def test_a_rising_speed_on_the_circle():
    path = constant_radius(acceleration=0.1, duration=90)
    time = np.concatenate([[0], np.cumsum(np.diff(path.arc) * 2 / (path.speed[:-1] + path.speed[1:]))])
    rate = np.gradient(path.speed, time)
    assert time[-1] > 90
    assert rate[time > 25] == pytest.approx(0.1, abs=2e-3)
    with pytest.raises(SignalError, match="acceleration: expected 0"):
        constant_radius(acceleration=-0.1)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6), top=st.floats(9, 35))
def test_everyday_driving_keeps_its_limits(seed, top):
    path = everyday(seed=seed, duration=120, top=top)
    check_geometry(path)
    along = np.diff(path.speed**2) / 2 / np.diff(path.arc)
    assert along.min() >= -1 - 1e-6
    assert along.max() <= 0.4 + 1e-6
    assert np.abs(path.curvature * path.speed**2).max() <= 2 + 1e-6
    assert path.speed.min() >= 8 - 1e-6
    assert path.speed.max() <= top + 1e-6


def test_everyday_driving_has_everything_in_it():
    path = everyday(seed=3, duration=600)
    same, other = everyday(seed=3, duration=600), everyday(seed=4, duration=600)
    np.testing.assert_array_equal(path.curvature, same.curvature)
    assert not np.array_equal(path.curvature, other.curvature)
    assert (path.curvature == 0).mean() > 0.2
    assert np.abs(path.curvature * path.speed**2).max() > 1.5
    assert path.curvature.min() < -1e-3 < 1e-3 < path.curvature.max()
    assert np.ptp(path.speed) > 5


@pytest.mark.parametrize("name", ["cheng_cebon_2011", "auburn_6x4", "auburn_6x4_unladen"])
@pytest.mark.parametrize("frequency", [0.01, 0.1, 0.4, 0.8])
def test_the_angle_for_an_acceleration_is_about_that_of_the_whole_truck(name, frequency):
    """Against the linear yaw-roll model, which the plant does not know."""
    vehicle, speed = get(name), 20.0
    m = dynamics.matrices(vehicle, speed, roll=True)
    response = dynamics.frequency_response(vehicle, speed, np.array([frequency]), roll=True)[0, :, 0]
    slip, yaw = (response[m.states.index(f"{q}.tractor")] for q in ("lateral_velocity", "yaw_rate"))
    s, tractor = 2j * np.pi * frequency, vehicle.units[0]
    front = s * (slip + (tractor.axles[0].position - tractor.cog) * yaw) + speed * yaw
    assert steer_for(vehicle, speed, 1.5, frequency) * abs(front) == pytest.approx(1.5, rel=0.3)
    assert steer_for(vehicle, speed, 1.0, 0.002) == pytest.approx(steer_for(vehicle, speed, 1.0), rel=1e-2)


def test_the_steady_angle_is_that_of_the_text_books(truck):
    loads = truck.axle_loads()
    under = loads["tractor.front"] / 475e3 - loads["tractor.drive"] / 766e3
    assert steer_for(truck, 20.0, 2.0) == pytest.approx(2.0 * (3.7 / 400 + under / G))


def test_open_loops_are_what_they_are_called(truck):
    sine = single_sine(truck, frequency=0.5, lead=2.0)
    moving = np.flatnonzero(np.abs(sine.steer) > 1e-12)
    assert sine.time[moving[[0, -1]]] == pytest.approx([2.01, 3.99])
    assert sine.steer.max() == pytest.approx(-sine.steer.min(), rel=1e-3)
    step = step_steer(truck, acceleration=2.0)
    assert step.steer[-1] == steer_for(truck, KMH_88, 2.0)
    rising = step.time[(step.steer > 1e-9) & (step.steer < step.steer[-1] - 1e-9)]
    assert rising == pytest.approx(np.arange(1.01, 1.095, 0.01))
    noise = random(truck, duration=200, seed=5)
    power = np.abs(np.fft.rfft(noise.steer)) ** 2
    frequency = np.fft.rfftfreq(len(noise.steer), 0.01)
    assert power[(frequency > 0.04) & (frequency < 1.01)].sum() > 0.99 * power.sum()
    np.testing.assert_array_equal(noise.steer, random(truck, duration=200, seed=5).steer)
    assert not np.array_equal(noise.steer, random(truck, duration=200, seed=6).steer)
    wave = sweep(truck)
    crossings = wave.time[1:-1][wave.steer[:-2] * wave.steer[1:-1] < 0]
    cycles = 0.1 * crossings + (1.5 - 0.1) * crossings**2 / (2 * 60)  # integral of 0.1 to 1.5 Hz
    np.testing.assert_allclose(cycles, np.arange(1, len(cycles) + 1) / 2, atol=0.02)


def test_beyond_its_critical_speed_a_truck_is_no_case_for_an_open_loop():
    with pytest.raises(SignalError, match=r"speed: expected below 27\.6 m/s, got 30; .* along a path"):
        course("step", get("auburn_6x4"), speed=30)
    assert isinstance(course("lane_changes", get("auburn_6x4"), speed=30), Path)


def test_what_is_given_counts(truck):
    assert course("lane_changes", truck, count=3, speed=20).duration == pytest.approx(1 + 3 * (61 / 20 + 5.5), abs=0.05)
    assert course("straight", truck, duration=12).duration == 12
    assert course("everyday", truck, speed=12, duration=60).speed.max() <= 12 + 1e-9
    one, two = (course("random", truck, seed=seed, duration=20) for seed in (1, 2))
    assert isinstance(one, OpenLoop)
    assert isinstance(two, OpenLoop)
    assert not np.array_equal(one.steer, two.steer)
    assert course("straight", truck, seed=7).speed[0] == KMH_88


@pytest.mark.parametrize(
    ("name", "given", "message"),
    [
        ("lane_change", {}, "'lane_change' is not known; did you mean 'lane_changes'"),
        ("xyz", {}, "everyday"),
        ("straight", {"speed": 88}, "speed: expected 5 to 40 m/s, got 88; give a road speed"),
        ("straight", {"speed": float("nan")}, "speed: expected 5 to 40 m/s, got nan"),
        ("straight", {"count": 3}, "count: straight has none, got 3; leave it out; it has speed, duration"),
        ("lane_changes", {"duration": 30.0}, "duration: lane_changes has none, got 30"),
        ("lane_changes", {"count": 0}, "count: expected a number above 0"),
        ("step", {"duration": -1.0}, "duration: expected a number above 0, got -1"),
        ("random", {"duration": 0.5}, "duration: 0.5 s hold no period"),
        ("random", {"seed": -1}, "seed: expected 0 or more"),
        ("everyday", {"speed": 6.0}, "top speed: expected 8 m/s or more, got 6"),
    ],
)
def test_what_cannot_be_driven(truck, name, given, message):
    with pytest.raises(SignalError, match=message):
        course(name, truck, **given)


def test_arrays_are_checked_and_frozen():
    path = straight(duration=5)
    with pytest.raises(ValueError, match="read-only"):
        path.x[0] = 1.0
    with pytest.raises(SignalError, match="heading: expected 2 finite numbers or more"):
        replace(path, heading=path.heading[1:])
    with pytest.raises(SignalError, match="y: expected 2 finite"):
        replace(path, y=np.full_like(path.y, np.nan))
    with pytest.raises(SignalError, match="arc: expected to rise from 0 in equal steps"):
        replace(path, arc=path.arc**2)
    with pytest.raises(SignalError, match="speed: expected a number above 0, got 0"):
        replace(path, speed=np.zeros_like(path.arc))
