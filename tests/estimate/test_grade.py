"""Grade of the road: on exactly integrated motion, and in the model of the lateral motion."""

import math
from dataclasses import replace

import numpy as np
import pytest

import fifthwheel as fw
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.estimate.filters.step_rows import corrected_inputs
from fifthwheel.estimate.grade import with_grade
from fifthwheel.model.dynamics import SPEED_RATE
from fifthwheel.truck.driveline import AIR_DENSITY, driveline_numbers

TRUCK = fw.vehicle("cheng_cebon_2011")
MASS = sum(unit.mass for unit in TRUCK.units)
STEP = 0.02


def hills(*, duration=200.0, lateral=0.0, brake=0.0):
    """A log on hills of 3 % with the noise of a wheel speed sensor, in a turn with a lateral acceleration, m/s^2.

    Every 50 s, brakes act for 10 s with a force, N, where the road goes down. The slope is exact.
    """
    numbers = {key: value for key, (value, _) in driveline_numbers(TRUCK.driveline, TRUCK.stated).items()}
    time = np.arange(0, duration, STEP)
    slope = 0.03 * np.sin(time / 50 * 2 * np.pi)
    braking = ((time % 50 > 30) & (time % 50 < 40)).astype(float) if brake else np.zeros(time.size)
    total = MASS + sum(TRUCK.tyres().values()) * numbers["rotating_mass"]
    loads = {path: load / STANDARD_GRAVITY for path, load in TRUCK.axle_loads().items()}
    side = {path: load * lateral for path, load in loads.items()}
    by_turn = sum(F**2 / TRUCK.parameters()[f"{path}.cornering_stiffness"] for path, F in side.items())
    force, speed, v = np.empty(time.size), np.empty(time.size), 18.0
    for k in range(time.size):
        speed[k] = v
        drag = AIR_DENSITY / 2 * numbers["drag_area"] * v**2
        level = drag + by_turn + MASS * STANDARD_GRAVITY * numbers["rolling_resistance"]
        climb = MASS * STANDARD_GRAVITY * math.sin(math.atan(slope[k]))
        force[k] = 0.0 if braking[k] else level + climb + 0.5 * MASS * (18.0 - v)
        v += STEP * (force[k] - brake * braking[k] - level - climb) / total
    noise = 0.01 * np.random.default_rng(1).normal(size=speed.size)
    signals = {
        "speed": speed + noise,
        "drive_force": force,
        "braking.tractor": braking,
        "yaw_rate.tractor": lateral / speed,
        "steer.tractor.front": np.zeros(time.size),
    }
    return fw.Record(time=time, signals=signals, name="hills"), slope


@pytest.mark.parametrize("lateral", [0.0, 2.0])
def test_the_balance_of_the_forces_gives_the_grade_on_straights_and_in_turns(lateral):
    record, slope = hills(lateral=lateral)
    found = with_grade(record, TRUCK).signals["grade"]
    assert np.sqrt(np.mean((found - slope) ** 2)) < 0.002  # of 0.021
    assert np.abs(np.mean(found - slope)) < 0.0005


def test_brakes_hide_the_grade_but_for_its_upper_bound():
    record, slope = hills(brake=0.6 * MASS)
    found, braked = with_grade(record, TRUCK).signals["grade"], record.signals["braking.tractor"] > 0
    error = found - slope
    assert np.sqrt(np.mean(error[~braked] ** 2)) < 0.003
    assert 0.003 < np.sqrt(np.mean(error[braked] ** 2)) < 0.012  # interpolated
    stronger, slope = hills(brake=0.05 * MASS)  # the bound is near the grade
    bounded = (with_grade(stronger, TRUCK).signals["grade"] - slope)[braked]
    assert np.sqrt(np.mean(bounded**2)) < np.sqrt(np.mean(error[braked] ** 2))


def test_a_record_with_a_grade_or_without_the_force_is_left_as_it_is():
    record, slope = hills(duration=40.0)
    logged = replace(record, signals=dict(record.signals) | {"grade": slope})
    assert with_grade(logged, TRUCK) is logged
    empty = replace(record, signals=dict(record.signals) | {"grade": np.full(slope.size, np.nan)})
    assert np.abs(with_grade(empty, TRUCK).signals["grade"] - slope).max() < 0.01
    for name in ("drive_force", "braking.tractor"):
        without = replace(record, signals={k: v for k, v in record.signals.items() if k != name})
        assert with_grade(without, TRUCK) is without
    short, _ = hills(duration=15.0)
    assert with_grade(short, TRUCK) is short


def test_gravity_along_the_road_counts_as_acceleration_also_where_samples_are_missing():
    record, _ = hills(duration=40.0)
    grade = np.full(record.time.size, 0.03)
    grade[100:200] = np.nan
    names = ("speed", SPEED_RATE)
    level = corrected_inputs(record, names, {})[SPEED_RATE]
    uphill = corrected_inputs(replace(record, signals=dict(record.signals) | {"grade": grade}), names, {})[SPEED_RATE]
    assert uphill - level == pytest.approx(STANDARD_GRAVITY * math.sin(math.atan(0.03)), abs=1e-12)


def test_a_grade_in_per_cent_is_refused():
    record, slope = hills(duration=40.0)
    log = replace(record, signals=dict(record.signals) | {"grade": 100 * slope})
    with pytest.raises(fw.SignalError, match="grade"):
        fw.identify([log], TRUCK)
