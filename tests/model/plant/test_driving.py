"""The truck in ordinary driving: its force balance, from its own true signals."""

import numpy as np
import pytest

from fifthwheel.model.plant.powered import GRAVITY, DrivenTruck, drive


@pytest.fixture(scope="module")
def run():
    exact = DrivenTruck(mass=30e3, hills=0.02, speed_delay=0.05)
    return exact, drive(exact, duration=300.0, seed=3)


def test_it_coasts_as_its_resistances_say(run):
    """With the clutch open and without brakes only drag, rolling resistance, wind and grade act."""
    truck, record = run
    v, grade = record.reference["speed"], record.reference["grade"]
    coasting = (record.signals["driveline_engaged"] == 0) & (record.signals["braking.tractor"] == 0) & (v > 3)
    inner = np.convolve(coasting, np.ones(9), "same") == 9
    acceleration = np.gradient(v, record.time)
    wheels = truck.wheels * truck.wheel_inertia / truck.radius**2
    rolling = truck.rolling_resistance * (1 + 0.004 * v)
    expected = -(0.6 * truck.drag_area * v**2 + truck.mass * GRAVITY * (rolling + grade)) / (truck.mass + wheels)
    assert inner.sum() > 50
    assert acceleration[inner] == pytest.approx(expected[inner], abs=0.03)  # gusts of 1 m/s


def test_engine_power_accelerates_it(run):
    """Over the drive, work of the engine less losses is the change of energy: within 3 % where nothing brakes."""
    truck, record = run
    s, v = record.signals, record.reference["speed"]
    torque = s["engine_torque"] - s["friction_torque"]
    power = torque * s["engine_speed"] * np.where(torque > 0, truck.efficiency * 0.988, 1.06)
    driven = (s["driveline_engaged"] == 1) & (s["braking.tractor"] == 0) & (v > 3) & (torque > 300)
    ratio = s["engine_speed"] / np.maximum(v, 1)
    mass = truck.mass + truck.wheels * truck.wheel_inertia / truck.radius**2 + truck.engine_inertia * ratio**2
    rolling = truck.rolling_resistance * (1 + 0.004 * v)
    resisting = (0.6 * truck.drag_area * v**2 + truck.mass * GRAVITY * (rolling + record.reference["grade"])) * v
    kinetic = mass * v * np.gradient(v, record.time)
    assert driven.sum() > 2000
    assert (kinetic + resisting)[driven].sum() == pytest.approx(power[driven].sum(), rel=0.03)


def test_signals_have_the_resolution_of_the_bus(run):
    _, record = run
    steps = record.signals["engine_torque"] / 2500.0 * 100
    assert steps == pytest.approx(np.round(steps), abs=1e-9)
    assert np.unique(record.signals["driveline_engaged"]).tolist() == [0.0, 1.0]


def test_a_seed_gives_the_same_drive():
    rng = (np.random.default_rng(4), np.random.default_rng(4))
    first, second = (drive(DrivenTruck.drawn(20e3, r), duration=20.0, seed=4) for r in rng)
    assert first == second
    assert DrivenTruck.drawn(20e3, np.random.default_rng(0), wind=1.0).wind == 1.0
