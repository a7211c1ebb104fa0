"""Startability, gradeability, acceleration and braking."""

import math

import numpy as np
import pytest

from fifthwheel.base.errors import VehicleError
from fifthwheel.base.units import STANDARD_GRAVITY as GRAVITY
from fifthwheel.results.assess.longitudinal import DECELERATION, GRADE, measure, measure_braking, notes, unstated
from fifthwheel.results.assess.truck import Body, Truck
from fifthwheel.truck import get
from fifthwheel.truck.driveline import AIR_DENSITY, DRIVELINE
from fifthwheel.truck.loads import unit_cog_height
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


def test_power_and_resistance_balance_on_the_grade():
    truck = get("cheng_cebon_2011")
    speed = of(truck)["grade_speed"]
    resistance = weight_of(truck) * (GRADE + N["rolling_resistance"])
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


@pytest.mark.parametrize("name", ["cheng_cebon_2011", "a_double"])
def test_the_time_for_100_m_is_that_of_a_simulation_in_small_steps(name):
    vehicle = get(name)
    expected = min(simulated(vehicle, start, skip) for start in range(4) for skip in (1, 2, 3))
    assert of(vehicle)["acceleration_time"] == pytest.approx(expected, rel=2e-3)


def noted(**changes):
    truck = Truck(vehicle=with_engine(get("a_double"), **changes))
    return notes(truck, measure(truck))


def test_notes_say_what_limits_the_grade_what_is_missing_and_why_there_is_no_value():
    friction = "the friction of the driven axles (coefficient 0.8), not by the engine"
    assert noted(launch_torque=9e3, engine_torque=9e3) == [f"startability and gradeability: limited by {friction}"]
    assert noted(launch_torque=500.0, engine_torque=9e3) == [
        "startability: limited by the engine",
        f"gradeability: limited by {friction}",
    ]
    truck = Truck(vehicle=rigid())
    assert notes(truck, measure(truck)) == []
    missing = ("launch_torque", "lowest_gear", "final_drive", "tyre_radius")
    assert unstated(rigid())["startability"] == tuple(f"driveline.{key}" for key in missing)
    assert unstated(with_engine(rigid())) == measure(truck) == {}
    assert any(
        "speed on a grade of 1 %: 0, the engine is too" in n for n in noted(engine_torque=100.0, engine_power=9e3)
    )
    assert "time for 100 m from rest: none, the truck does not start" in noted(launch_torque=50.0)[-1]
    slow = {"launch_speed": 195.0}
    assert "acceleration_time" not in of(get("a_double"), **slow)
    assert "time for 100 m from rest: none, after a gear change the engine" in noted(**slow)[-1]


def balanced(vehicle, acceleration, forces):
    """Loads of the axle groups from 3 n equations for the groups, and for force and moment in each coupling."""
    units, couplings, p = vehicle.units, vehicle.couplings, vehicle.parameters()
    paths = [(i, group, unit.group_path(group)) for i, unit in enumerate(units) for group in unit.axle_groups]
    unknown = [path for *_, path in paths]
    for k, coupling in enumerate(couplings):
        hinged = k + 1 < len(couplings) and couplings[k + 1].kind == "turntable"
        unknown += [("x", k)] + ([] if hinged else [("z", k)]) + ([("m", k)] if coupling.kind == "turntable" else [])
    A, b = np.zeros((3 * len(units), len(unknown))), np.zeros(3 * len(units))

    def add(unit, name, x=0.0, z=0.0, m=0.0):
        A[3 * unit : 3 * unit + 3, unknown.index(name)] += [x, z, m]

    for i, group, path in paths:
        add(i, path, z=1.0, m=group.position)  # moments about the origin on the road: x F_z - h F_x
        b[3 * i] -= forces.get(path, 0.0)
    for i, unit in enumerate(units):
        weight, height = unit.mass * GRAVITY, unit_cog_height(p, unit)
        b[3 * i : 3 * i + 3] += [acceleration * weight, weight, weight * unit.cog - height * acceleration * weight]
    for k, c in enumerate(couplings):
        for unit, sign, x in ((k, -1.0, c.leading_position), (k + 1, 1.0, c.trailing_position)):
            add(unit, ("x", k), x=sign, m=-sign * c.height)
            if ("z", k) in unknown:
                add(unit, ("z", k), z=sign, m=sign * x)
            if ("m", k) in unknown:
                add(unit, ("m", k), m=sign)
    solution, *_ = np.linalg.lstsq(A, b, rcond=None)
    assert np.abs(A @ solution - b).max() < 1e-6 * np.abs(b).max()
    return dict(zip(unknown, solution, strict=True))


@pytest.mark.parametrize("name", CATALOGUE)
def test_every_unit_is_in_equilibrium(name):
    vehicle = get(name)
    static = vehicle.axle_loads()
    braking = {path: -0.4 * load for path, load in static.items()}
    climbing = {f"{vehicle.units[0].name}.drive": 0.1 * sum(static.values())}
    for acceleration, forces in ((-0.4, braking), (0.1, climbing)):
        expected = balanced(vehicle, acceleration, forces)
        loads = vehicle.axle_loads(acceleration, forces)
        assert loads == pytest.approx({path: expected[path] for path in static})
        assert sum(loads.values()) == pytest.approx(sum(static.values()))


def test_a_rigid_truck_uses_less_friction_behind():
    """Rear load: m g (l_f - z h) / L."""
    truck = Truck(vehicle=rigid())
    unit = truck.vehicle.units[0]
    height = unit_cog_height(truck.vehicle.parameters(), unit)
    rear = 1 - DECELERATION * height / abs(unit.cog)
    assert measure_braking(truck)["braking_efficiency"] == pytest.approx(rear)


@pytest.mark.parametrize("rear", [0.3, 0.6])
def test_stated_brakes_of_a_rigid_truck(rear):
    """Front and rear need fraction times z over their loads, m g (l_r + z h) / L and m g (l_f - z h) / L."""
    brakes = {"tractor.front": 2 * (1 - rear), "tractor.drive": 2 * rear}  # fractions of any sum
    truck = Truck(vehicle=rigid(), body=Body(brakes=brakes))
    unit = truck.vehicle.units[0]
    front, drive = (group.position for group in unit.axle_groups)
    height = unit_cog_height(truck.vehicle.parameters(), unit)
    on_rear = (front - unit.cog - DECELERATION * height) / (front - drive)
    expected = min((1 - on_rear) / (1 - rear), on_rear / rear)
    assert measure_braking(truck)["braking_efficiency"] == pytest.approx(expected)


def test_brakes_name_axle_groups():
    assert Body.of({"brakes.tractor.drive": "40 %", "brakes.semitrailer": 0.6}).brakes == {
        "tractor.drive": 0.4,
        "semitrailer": 0.6,
    }
    with pytest.raises(VehicleError, match=r"brakes.trailer: no such axle group; did you mean 'semitrailer'"):
        Truck(vehicle=get("cheng_cebon_2011"), body=Body(brakes={"trailer": 1.0}))
    with pytest.raises(VehicleError, match="brakes: expected fractions of 0 or more, one above 0"):
        Body.of({"brakes.semitrailer": 0.0})
    with pytest.raises(VehicleError, match=r"brakes\.semitrailer: expected no standard deviation"):
        Body.of({"brakes.semitrailer": "0.4 +- 0.1"})
