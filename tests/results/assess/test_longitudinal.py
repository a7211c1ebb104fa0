"""Startability, gradeability and acceleration against closed forms and a simulation in small steps."""

import math

import pytest

from fifthwheel.base.units import STANDARD_GRAVITY as GRAVITY
from fifthwheel.results.assess.longitudinal import GRADE, measure, notes, unstated
from fifthwheel.results.assess.truck import Truck
from fifthwheel.truck import get
from fifthwheel.truck.driveline import AIR_DENSITY, DRIVELINE
from tests.results.assess.trucks import CATALOGUE, ENGINE, rigid, with_engine

N = {path.partition(".")[2]: value for path, value in ENGINE.items()}
N |= {key: figure.value for key, figure in DRIVELINE.items()}
RATIO = N["final_drive"] / N["tyre_radius"]


def of(vehicle, **changes):
    return measure(Truck(vehicle=with_engine(vehicle, **changes)))


def weight_of(vehicle):
    return sum(unit.mass for unit in vehicle.units) * GRAVITY


@pytest.mark.parametrize("name", CATALOGUE)
def test_the_engine_holds_the_truck_on_the_grade(name):
    """A weak engine: its force is that along the grade and the rolling resistance."""
    for measured, torque in (("startability", "launch_torque"), ("gradeability", "engine_torque")):
        angle = math.atan(of(get(name), **{torque: 500.0})[measured])
        needed = weight_of(get(name)) * (math.sin(angle) + N["rolling_resistance"] * math.cos(angle))
        assert needed == pytest.approx(500.0 * N["efficiency"] * N["lowest_gear"] * RATIO)


@pytest.mark.parametrize("name", CATALOGUE)
def test_the_driven_axles_do_not_slip_on_the_grade(name):
    """A strong engine: the friction of the driven group, with its load on that grade, is what the truck needs."""
    vehicle = get(name)
    grade, driven = of(vehicle, launch_torque=9e3)["startability"], f"{vehicle.units[0].name}.drive"
    weight = weight_of(vehicle)
    load = vehicle.axle_loads(grade, {driven: grade * weight})[driven]
    assert load > vehicle.axle_loads()[driven]
    assert 0.8 * load == pytest.approx((grade + N["rolling_resistance"]) * weight)


def test_a_rigid_truck_by_hand():
    """tan a = (mu l_f / L - c) / (1 - mu h / L), all weight over axles that are 3.7 m apart."""
    vehicle = rigid()
    unit = vehicle.units[0]
    fraction, height = -unit.cog / 3.7, unit.sprung.cog_height
    expected = (0.8 * fraction - N["rolling_resistance"]) / (1 - 0.8 * height / 3.7)
    assert of(vehicle)["startability"] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("name", CATALOGUE)
def test_power_and_resistance_balance_on_the_grade(name):
    speed = of(get(name))["grade_speed"]
    slope = math.atan(GRADE)
    resistance = weight_of(get(name)) * (GRADE + N["rolling_resistance"] / math.cos(slope) * math.cos(slope))
    resistance += AIR_DENSITY / 2 * N["drag_area"] * speed**2
    power = N["efficiency"] * N["engine_power"]
    assert speed * resistance == pytest.approx(power, rel=1e-3)


def test_the_governor_limits_the_speed_and_a_weak_engine_has_none():
    assert of(rigid())["grade_speed"] == pytest.approx(N["governed_speed"] / (N["highest_gear"] * RATIO))
    assert of(get("a_double"), engine_torque=100.0, engine_power=9e3)["grade_speed"] == 0.0
    assert "acceleration_time" not in of(get("a_double"), launch_torque=50.0)


def simulated(vehicle, start, skip, step=2e-3):
    """Time for 100 m in steps of equal time."""
    weight, wheels = weight_of(vehicle), sum(vehicle.tyres().values())
    friction = 0.8 * vehicle.axle_loads()[f"{vehicle.units[0].name}.drive"]
    count = round(math.log(N["lowest_gear"] / N["highest_gear"]) / math.log(N["gear_step"]))
    gear, t, x, v, pause = start, 0.0, 0.0, 0.0, 0.0
    while x < 100:
        ratio = N["lowest_gear"] * (N["highest_gear"] / N["lowest_gear"]) ** (gear / count) * RATIO
        engine, inertia = v * ratio, N["engine_inertia"] * ratio**2
        if pause > 0:
            torque, inertia, pause = 0.0, 0.0, pause - step
        elif engine < N["launch_speed"]:
            if x > 0 and gear != start:
                return math.inf
            torque, inertia = N["launch_torque"], 0.0
        elif engine < N["governed_speed"]:
            torque = min(N["engine_torque"], N["engine_power"] / engine)
        elif gear < count:
            gear, pause = min(gear + skip, count), N["shift_time"]
            continue
        else:
            torque = 0.0
        force = min(torque * N["efficiency"] * ratio, friction)
        force -= AIR_DENSITY / 2 * N["drag_area"] * v**2 + weight * N["rolling_resistance"]
        rate = force / (weight / GRAVITY + wheels * N["rotating_mass"] * (pause <= 0) + inertia)
        t, x, v = t + step, x + (v + rate * step / 2) * step, v + rate * step
    return t


@pytest.mark.parametrize("name", CATALOGUE)
def test_the_time_for_100_m_is_that_of_a_simulation_in_small_steps(name):
    vehicle = get(name)
    expected = min(simulated(vehicle, start, skip) for start in range(4) for skip in (1, 2, 3))
    assert of(vehicle)["acceleration_time"] == pytest.approx(expected, rel=2e-3)


def test_what_is_missing_has_its_path():
    assert unstated(with_engine(rigid())) == {}
    assert unstated(rigid())["startability"] == tuple(
        f"driveline.{key}" for key in ("launch_torque", "lowest_gear", "final_drive", "tyre_radius")
    )
    assert measure(Truck(vehicle=rigid())) == {}


def noted(**changes):
    truck = Truck(vehicle=with_engine(get("a_double"), **changes))
    return notes(truck, measure(truck))


def test_the_notes_say_what_limits_the_grade():
    friction = "the friction of the driven axles (coefficient 0.8), not by the engine"
    assert noted(launch_torque=9e3, engine_torque=9e3) == [f"startability and gradeability: limited by {friction}"]
    assert noted(launch_torque=500.0, engine_torque=9e3) == [
        "startability: limited by the engine",
        f"gradeability: limited by {friction}",
    ]
    truck = Truck(vehicle=rigid())
    assert notes(truck, measure(truck)) == []


def test_what_has_no_value_has_a_note_with_the_reason():
    assert any(
        "speed on a grade of 1 %: 0, the engine is too" in n for n in noted(engine_torque=100.0, engine_power=9e3)
    )
    assert "time for 100 m from rest: none, the truck does not start" in noted(launch_torque=50.0)[-1]
    slow = {"launch_speed": 195.0}
    assert "acceleration_time" not in of(get("a_double"), **slow)
    assert "time for 100 m from rest: none, after a gear change the engine" in noted(**slow)[-1]
