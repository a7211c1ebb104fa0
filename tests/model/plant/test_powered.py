"""A truck with its powertrain, nonlinear or a point mass: force and power balances from its true signals."""

import numpy as np
import pytest

import fifthwheel as fw
from fifthwheel.model.manoeuvres import course, straight
from fifthwheel.model.plant import DrivenTruck, Plant, Properties
from fifthwheel.model.plant.bodies import sprung_bodies
from fifthwheel.model.plant.powered import drive
from fifthwheel.model.plant.powertrain import GEARS

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


def test_a_seed_gives_the_same_drive():
    rng = (np.random.default_rng(4), np.random.default_rng(4))
    first, second = (drive(DrivenTruck.drawn(20e3, r), duration=20.0, seed=4) for r in rng)
    assert first == second
    assert DrivenTruck.drawn(20e3, np.random.default_rng(0), wind=1.0).wind == 1.0


def test_the_engine_drives_the_axles_that_the_vehicle_file_states():
    bus = sprung_bodies(fw.vehicle("articulated_bus"), Properties())
    assert [axle.name for body in bus for axle in body.axles if axle.driven] == ["rear.drive"]
