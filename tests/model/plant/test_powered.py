"""A truck with its powertrain, nonlinear or a point mass: force and power balances from its true signals."""

import math

import numpy as np
import pytest

import fifthwheel as fw
from fifthwheel.model.manoeuvres import course, straight
from fifthwheel.model.plant import DrivenTruck, Plant, Properties
from fifthwheel.model.plant.powered import drive, gravity
from fifthwheel.model.plant.powertrain import GEARS, GRAVITY, Road

pytest.importorskip("mujoco")

TRUCK = fw.vehicle("cheng_cebon_2011")
MASS = sum(unit.mass for unit in TRUCK.units)
G, AIR = 9.80665, 1.225
DRIVEN = DrivenTruck(mass=1.0, hills=0.02, wind=2.0)


@pytest.fixture(scope="module")
def plant():
    return Plant(TRUCK)


@pytest.fixture(scope="module")
def bends(plant):
    """40 s of everyday driving on hills, in wind."""
    return plant.drive(course("everyday", TRUCK, duration=40.0, seed=5), driven=DRIVEN, seed=2)


def forces(run, *axles):
    return sum(run.truth[f"longitudinal_force.{axle}"] for axle in axles)


@pytest.mark.slow
def test_force_balance_on_a_straight_hilly_road(plant):
    """Mass times acceleration is what the tyres give less drag in the wind and the weight along the road."""
    run = plant.drive(straight(speed=20.0, duration=20.0), driven=DRIVEN, seed=4)
    v, axles = run.truth["speed"], [f"{unit.name}.{axle.name}" for unit in TRUCK.units for axle in unit.on_road]
    air = v + run.truth["head_wind"]
    grade = run.truth["grade"]
    expected = forces(run, *axles) - AIR / 2 * 6.0 * air * np.abs(air) - MASS * G * grade / np.sqrt(1 + grade**2)
    smooth = np.ones(100) / 100  # pitch moves the bodies against each other
    actual = np.convolve(MASS * np.gradient(v, run.time), smooth, "valid")
    assert np.ptp(grade) > 0.005
    assert actual == pytest.approx(np.convolve(expected, smooth, "valid"), abs=0.003 * MASS)


@pytest.mark.slow
def test_power_of_the_engine_arrives_at_the_road(bends):
    """Engine torque times speed, less losses and the inertia of engine and wheels, is force times speed of the tyres
    on the driven axle, within the few per cent that tyres lose by slip."""
    x, driven = bends.truth, DRIVEN
    torque, engine = x["engine_torque"] - x["friction_torque"], x["engine_speed"]
    ratio = np.array(GEARS)[x["gear"].astype(int) - 1] * driven.final_drive
    wheel = (x["wheel_speed.tractor.drive.left"] + x["wheel_speed.tractor.drive.right"]) / 2 / 0.5
    steady = (x["driveline_engaged"] == 1) & (x["braking.tractor"] == 0) & (torque > 200)
    steady = np.convolve(steady, np.ones(301), "same") > 300.5
    assert steady.sum() > 300
    assert engine[steady] == pytest.approx((wheel * ratio)[steady], rel=0.01)
    loss = np.where(x["gear"] == len(GEARS), 1.0, 0.988) * driven.efficiency
    acceleration = np.gradient(x["speed"], bends.time) / 0.5
    inertia = driven.engine_inertia * ratio**2
    at_wheels = torque * ratio * loss - inertia * acceleration
    load = x["vertical_force.tractor.drive"]
    at_road = forces(bends, "tractor.drive") * 0.5 + 0.006 * load * 0.5
    assert at_road[steady].sum() == pytest.approx(at_wheels[steady].sum(), rel=0.02)
    slip = 1 - x["speed"] / (wheel * 0.5)
    assert 0.002 < slip[steady].mean() < 0.03


def test_the_engine_at_its_limit_on_a_constant_grade(plant, monkeypatch):
    """At the speed reached uphill, the full load curve of the engine carries all resistances and the acceleration."""
    monkeypatch.setattr(Road, "grade", lambda self, place: 0.04)
    monkeypatch.setattr(Road, "gust", lambda self, k: 0.0)
    run = plant.drive(straight(speed=17.5, duration=16.0), driven=DrivenTruck(mass=1.0), seed=0)
    x = {name: values[-500:].mean() for name, values in run.truth.items()}
    gear, v, acceleration = round(x["gear"]), x["speed"], np.polyfit(run.time[-500:], run.truth["speed"][-500:], 1)[0]
    assert np.ptp(run.truth["gear"][-500:]) == 0
    assert abs(acceleration) < 0.05
    ratio = GEARS[gear - 1] * DRIVEN.final_drive / 0.5
    rpm = v * ratio / (2 * math.pi / 60)
    full_load = 2500 * np.interp(rpm, [600, 950, 1400, 1900], [0.55, 1.0, 1.0, 0.74])
    force = full_load * ratio * DRIVEN.efficiency * (0.988 if gear < len(GEARS) else 1.0)
    resistance = AIR / 2 * 6.0 * v**2 + MASS * G * (0.006 + 0.04) / math.sqrt(1 + 0.04**2)
    rotating = 3.5 * ratio**2 + 12 * 13.5 / 0.5**2  # kg, of engine and wheels
    assert force == pytest.approx(resistance + (MASS + rotating) * acceleration, rel=0.01)


def test_gravity_turns_with_the_road():
    assert gravity(0.0, 0.0, 1.0) == pytest.approx((0.0, 0.0, -G))
    x, y, z = gravity(0.05, 0.0, math.pi / 2)
    assert (x, y) == pytest.approx((0.0, -G * 0.05 / math.sqrt(1 + 0.05**2)), abs=1e-12)
    assert math.hypot(x, y, z) == pytest.approx(G)
    assert gravity(0.0, 0.1, 0.0)[1] == pytest.approx(-G * math.sin(0.1))


def test_a_powered_run_leaves_nothing_in_the_plant(plant):
    path = straight(speed=20.0, duration=2.0)
    before = plant.drive(path)
    plant.drive(path, driven=DRIVEN)
    after = plant.drive(path)
    assert "grade" not in after.truth
    assert all(np.array_equal(before.truth[name], after.truth[name]) for name in before.truth)


@pytest.mark.slow
def test_a_record_has_lateral_and_longitudinal_signals(bends):
    record = bends.record(seed=1, everything=True)
    for name in ("yaw_rate.semitrailer", "engine_torque", "wheel_speed.semitrailer.middle.left", "braking.tractor"):
        assert np.isfinite(record.signals[name]).any()
    assert {"grade", "gear", "head_wind"} <= set(record.reference)
    assert np.isfinite(record.signals["speed"]).mean() == pytest.approx(0.1, abs=0.01)
    assert not np.array_equal(bends.truth["grade"], np.zeros_like(bends.time))


def test_mass_and_resistances_are_those_of_the_vehicle(plant):
    heavy = Plant(TRUCK, Properties(drag_area=9.0)).drive(straight(speed=20.0, duration=2.0), driven=DRIVEN)
    light = plant.drive(straight(speed=20.0, duration=2.0), driven=DRIVEN)
    assert heavy.truth["speed"][-1] < light.truth["speed"][-1]


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
