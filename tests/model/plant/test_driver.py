"""The driver on a model independent of the plant: the linear yaw-roll model."""

import math
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.linalg import expm

from fifthwheel.base.types import Array
from fifthwheel.model import dynamics
from fifthwheel.model.manoeuvres import (
    Course,
    Path,
    constant_radius,
    everyday,
    lane_changes,
    lane_changes_on_test_track,
    step_input,
    straight,
)
from fifthwheel.model.plant.driver import Command, Driver, Pose
from fifthwheel.truck import Vehicle, get


def yaw_roll(vehicle: Vehicle, speed: float) -> tuple[Array, Array, float]:
    """The same for the linear yaw-roll model, with the two states of the tractor first."""
    m = dynamics.matrices(vehicle, speed, roll=True)
    first = [m.states.index(f"{q}.tractor") for q in ("lateral_velocity", "yaw_rate")]
    order = first + [i for i in range(len(m.states)) if i not in first]
    return m.A[np.ix_(order, order)], m.B[order, 0], 0.0


@dataclass
class Motion:
    """Samples at 100 Hz."""

    position: Array  # (N, 2) of the tractor's CoG
    error: Array  # distance of the tractor's CoG to the left of the path, m
    steer: Array
    speed: Array


def simulate(course: Course, vehicle: Vehicle, model=yaw_roll, driver=None, *, start=(0.0, 0.0), heading=0.0) -> Motion:
    """Simulate at 1 ms; the speed follows its command within 2 m/s^2, the steer angle is linear between commands."""
    driver = driver or Driver(course, vehicle)
    speed, model_speed = float(course.speed[0]), -1.0
    A, B, offset = model(vehicle, speed)
    x, y = start[0] - offset * math.cos(heading), start[1] - offset * math.sin(heading)
    state, steer, rows = np.zeros(len(B)), 0.0, []
    for k in range(int(course.duration * 100)):
        cog = x + offset * math.cos(heading), y + offset * math.sin(heading)
        command = driver(k / 100, Pose(*cog, math.remainder(heading, math.tau), speed, float(state[1])))
        rows.append([*cog, command.steer, speed])
        speed += min(max(command.speed - speed, -0.02), 0.02)
        if abs(speed - model_speed) > 0.1:
            A, B, _ = model(vehicle, speed)
            n, model_speed = len(B), speed
            block = expm(0.001 * np.block([[A, B[:, None]], [np.zeros((1, n + 1))]]))
            A, B = block[:n, :n], block[:n, n]
        increment = (command.steer - steer) / 10
        for _ in range(10):
            steer += increment
            state = A @ state + B * steer
            lateral_velocity, yaw_rate = state[:2].tolist()
            heading += 0.001 * yaw_rate
            c, s = math.cos(heading), math.sin(heading)
            x, y = x + 0.001 * (speed * c - lateral_velocity * s), y + 0.001 * (speed * s + lateral_velocity * c)
    samples = np.array(rows)
    position = samples[:, :2]
    error = path_error(course, position - position[0]) if isinstance(course, Path) else np.zeros(len(samples))
    return Motion(position=position, error=error, steer=samples[:, 2], speed=samples[:, 3])


def path_error(path: Path, position: Array) -> Array:
    """Distance to the left of the nearest point of the path, m, (N,); the search starts at the previous point."""
    nearest, errors = 0, []
    for x, y in position:
        candidates = slice(nearest, nearest + 40)
        nearest += int(np.hypot(path.x[candidates] - x, path.y[candidates] - y).argmin())
        angle = path.heading[nearest]
        errors.append(math.cos(angle) * (y - path.y[nearest]) - math.sin(angle) * (x - path.x[nearest]))
    return np.array(errors)


COURSES = {
    "SAE J2179 lane change": (lane_changes(count=2), 0.15),
    "test track": (lane_changes_on_test_track(count=2), 0.3),
    "circle": (constant_radius(duration=30), 0.3),
    "everyday": (everyday(duration=40, seed=2), 0.3),
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "name"),
    [
        ("SAE J2179 lane change", "auburn_6x4"),
        ("test track", "cheng_cebon_2011"),
        ("circle", "cheng_cebon_2011"),
        ("everyday", "auburn_6x4_unladen"),
    ],
)
def test_path_is_followed(kind, name):
    course, limit = COURSES[kind]
    run = simulate(course, get(name))
    assert np.abs(run.error).max() < limit
    assert np.abs(np.diff(run.steer)).max() <= 0.3 * 0.01 + 1e-12
    assert np.abs(run.steer).max() < 0.3


def test_an_error_decays_as_the_settings_say():
    """The path error obeys e'' + 2 zeta w e' + w^2 e = 0."""
    course, truck = straight(duration=12), get("cheng_cebon_2011")
    driver = Driver(course, truck)
    driver(0.0, Pose(0.0, 0.0, 0.0, 24.0, 0.0))
    run = simulate(course, truck, driver=driver, start=(0.0, 0.5))
    error = run.position[:, 1]
    time = np.arange(len(error)) / 100
    frequency = math.sqrt(1 - 0.8**2)
    expected = 0.5 * np.exp(-0.8 * time) * (np.cos(frequency * time) + 0.8 / frequency * np.sin(frequency * time))
    np.testing.assert_allclose(error, expected, atol=0.05)


def test_path_starts_at_the_position_of_the_truck():
    course, truck = lane_changes(count=1), get("cheng_cebon_2011")
    run, shifted = simulate(course, truck), simulate(course, truck, start=(50.0, -3.0))
    shift = np.tile([50.0, -3.0], (len(run.position), 1))
    np.testing.assert_allclose(shifted.position - run.position, shift, atol=1e-6)
    np.testing.assert_allclose(shifted.steer, run.steer, atol=1e-9)


def test_the_last_point_of_a_path_applies_beyond_its_end():
    course, truck = straight(duration=2, speed=10.0), get("cheng_cebon_2011")
    driver = Driver(course, truck)
    for k in range(2000):
        command = driver(k / 100, Pose(k / 10, 0.0, 0.0, 10.0, 0.0))
        assert command == Command(0.0, 10.0)
    assert driver.arc > course.arc[-1]


def test_an_open_loop_is_replayed():
    truck = get("cheng_cebon_2011")
    course = step_input(truck)
    driver, pose = Driver(course, truck), Pose(0.0, 5.0, 1.0, 20.0, 0.1)
    assert driver(0.0, pose) == Command(0.0, pytest.approx(88 / 3.6))
    assert driver(1.05, pose).steer == pytest.approx(course.steer[-1] / 2)
    assert driver(1.055, pose).steer == pytest.approx(course.steer[-1] * 0.55)
    assert driver(99.0, pose).steer == course.steer[-1]
