"""The driver, on trucks that the plant does not know: a bicycle with linear tyres, and the linear yaw-roll chain."""

import math
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

from fifthwheel import dynamics
from fifthwheel.errors import SignalError
from fifthwheel.plant.courses import (
    Course,
    Path,
    constant_radius,
    everyday,
    lane_changes,
    on_test_track,
    step,
    straight,
)
from fifthwheel.plant.driver import Command, Driver, DriverSettings, Pose
from fifthwheel.vehicle import Vehicle, get

G = 9.80665
TRUCKS = ["cheng_cebon_2011", "auburn_6x4", "auburn_6x4_unladen"]
Array = NDArray[np.float64]


def bicycle(vehicle: Vehicle, speed: float) -> tuple[Array, Array, float]:
    """A and B of lateral velocity and yaw rate at its CoG, which is so far behind the tractor's, m.

    The tractor, and on its fifth wheel a point mass for what the semitrailer brings.
    """
    loads, unit, length = vehicle.axle_loads(), vehicle.units[0], vehicle.wheelbase
    front, rear = unit.axle_groups
    mf, mr = loads["tractor.front"] / G, loads["tractor.drive"] / G
    m, cf, cr = mf + mr, front.cornering_stiffness, rear.cornering_stiffness
    a, b = mr / m * length, mf / m * length
    inertia = unit.yaw_inertia + (m - unit.mass) * b**2
    damping = np.array([[cf + cr, a * cf - b * cr], [a * cf - b * cr, a * a * cf + b * b * cr]]) / speed
    mass = np.array([m, inertia])
    A = -damping / mass[:, None] - np.array([[0, speed], [0, 0]])
    return A, np.array([cf, a * cf]) / mass, a - (front.position - unit.cog)


def chain(vehicle: Vehicle, speed: float) -> tuple[Array, Array, float]:
    """The same of the linear yaw-roll model, the tractor's two states first."""
    m = dynamics.matrices(vehicle, speed, roll=True)
    first = [m.states.index(f"{q}.tractor") for q in ("lateral_velocity", "yaw_rate")]
    order = first + [i for i in range(len(m.states)) if i not in first]
    return m.A[np.ix_(order, order)], m.B[order, 0], 0.0


@dataclass
class Drive:
    """Rows at 100 Hz."""

    place: Array  # (N, 2) of the tractor's CoG
    error: Array  # of the tractor's CoG, to the left of the path
    steer: Array
    speed: Array


def drive(course: Course, vehicle: Vehicle, model=bicycle, driver=None, *, start=(0.0, 0.0), heading=0.0) -> Drive:
    """At 1 ms; the speed follows what is asked within 2 m/s^2, the steer angle runs from command to command."""
    driver = driver or Driver(course, vehicle)
    speed, turned, known = float(course.speed[0]), heading, -1.0
    A, B, behind = model(vehicle, speed)
    x, y = start[0] - behind * math.cos(heading), start[1] - behind * math.sin(heading)
    state, steer, rows = np.zeros(len(B)), 0.0, []
    for k in range(int(course.duration * 100)):
        at = x + behind * math.cos(turned), y + behind * math.sin(turned)
        wanted = driver(k / 100, Pose(*at, math.remainder(turned, math.tau), speed, float(state[1])))
        rows.append([*at, wanted.steer, speed])
        speed += min(max(wanted.speed - speed, -0.02), 0.02)
        if abs(speed - known) > 0.1:
            A, B, _ = model(vehicle, speed)
            n, known = len(B), speed
            block = expm(0.001 * np.block([[A, B[:, None]], [np.zeros((1, n + 1))]]))
            A, B = block[:n, :n], block[:n, n]
        rise = (wanted.steer - steer) / 10
        for _ in range(10):
            steer += rise
            state = A @ state + B * steer
            slip, yaw_rate = state[:2].tolist()
            turned += 0.001 * yaw_rate
            c, s = math.cos(turned), math.sin(turned)
            x, y = x + 0.001 * (speed * c - slip * s), y + 0.001 * (speed * s + slip * c)
    found = np.array(rows)
    error = beside(course, found[:, :2] - found[0, :2]) if isinstance(course, Path) else np.zeros(len(found))
    return Drive(place=found[:, :2], error=error, steer=found[:, 2], speed=found[:, 3])


def beside(path: Path, place: Array) -> Array:
    """Distance to the left of the nearest point of the path, m, (N,); looked for near the one before."""
    near, found = 0, []
    for x, y in place:
        part = slice(near, near + 40)
        near += int(np.hypot(path.x[part] - x, path.y[part] - y).argmin())
        angle = path.heading[near]
        found.append(math.cos(angle) * (y - path.y[near]) - math.sin(angle) * (x - path.x[near]))
    return np.array(found)


COURSES = {
    "the standard's lane change": (lane_changes(count=2), 0.15),
    "the test track's": (on_test_track(count=2), 0.3),
    "a circle": (constant_radius(duration=30), 0.3),
    "everyday": (everyday(duration=40, seed=2), 0.3),
}


@pytest.mark.parametrize("name", TRUCKS)
@pytest.mark.parametrize("model", [bicycle, chain])
@pytest.mark.parametrize("kind", COURSES)
def test_a_path_is_followed(kind, model, name):
    course, allowed = COURSES[kind]
    run = drive(course, get(name), model)
    assert np.abs(run.error).max() < allowed
    assert np.abs(np.diff(run.steer)).max() <= 0.3 * 0.01 + 1e-12
    assert np.abs(run.steer).max() < 0.3


def test_there_is_no_drift_over_fifteen_lane_changes():
    """And the last is driven like the first."""
    course = lane_changes()
    run = drive(course, get("cheng_cebon_2011"))
    each = [np.abs(run.error[100 + 800 * k : 900 + 800 * k]).max() for k in range(15)]
    assert max(each) < 0.05
    assert each[-1] == pytest.approx(each[0], abs=2e-3)
    assert run.error[-1] == pytest.approx(0, abs=0.01)
    assert run.place[-1, 0] == pytest.approx(88 / 3.6 * 121, rel=1e-3)


def test_an_error_is_steered_out_as_the_settings_say():
    """Beside the path, e'' + 2 zeta w e' + w^2 e = 0 from wherever the truck is put."""
    course, truck = straight(duration=12), get("cheng_cebon_2011")
    driver = Driver(course, truck)
    driver(0.0, Pose(0.0, 0.0, 0.0, 24.0, 0.0))
    run = drive(course, truck, driver=driver, start=(0.0, 0.5))
    error = run.place[:, 1]
    time = np.arange(len(error)) / 100
    damped = math.sqrt(1 - 0.8**2)
    wanted = 0.5 * np.exp(-0.8 * time) * (np.cos(damped * time) + 0.8 / damped * np.sin(damped * time))
    np.testing.assert_allclose(error, wanted, atol=0.05)


def test_a_path_begins_where_the_truck_is():
    course, truck = lane_changes(count=1), get("cheng_cebon_2011")
    here, there = drive(course, truck), drive(course, truck, start=(50.0, -3.0))
    np.testing.assert_allclose(there.place - here.place, np.tile([50.0, -3.0], (len(here.place), 1)), atol=1e-6)
    np.testing.assert_allclose(there.steer, here.steer, atol=1e-9)


def test_left_is_left_and_a_circle_goes_on_and_on():
    run = drive(constant_radius(radius=40, speed=8, duration=70), get("cheng_cebon_2011"))
    assert run.steer[1000:].min() > 0
    assert np.abs(run.error).max() < 0.1  # after more than two turns


def test_what_comes_after_the_end_is_as_the_end():
    course, truck = straight(duration=2, speed=10.0), get("cheng_cebon_2011")
    driver = Driver(course, truck)
    for k in range(2000):
        command = driver(k / 100, Pose(k / 10, 0.0, 0.0, 10.0, 0.0))
        assert command == Command(0.0, 10.0)
    assert driver.arc > course.arc[-1]


def test_an_open_loop_is_played():
    truck = get("cheng_cebon_2011")
    course = step(truck)
    driver, pose = Driver(course, truck), Pose(0.0, 5.0, 1.0, 20.0, 0.1)
    assert driver(0.0, pose) == Command(0.0, pytest.approx(88 / 3.6))
    assert driver(1.05, pose).steer == pytest.approx(course.steer[-1] / 2)
    assert driver(1.055, pose).steer == pytest.approx(course.steer[-1] * 0.55)
    assert driver(99.0, pose).steer == course.steer[-1]


def test_settings_are_checked():
    DriverSettings(preview=0.0)
    with pytest.raises(SignalError, match="bandwidth: expected a number above 0, got 0"):
        DriverSettings(bandwidth=0)
    with pytest.raises(SignalError, match="preview: expected a number 0 or more, got -1"):
        DriverSettings(preview=-1)
    with pytest.raises(SignalError, match="damping"):
        DriverSettings(damping=math.nan)
