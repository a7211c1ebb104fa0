"""Axle loads under longitudinal forces against the equilibrium of every unit, written out."""

import numpy as np
import pytest

from fifthwheel.base.errors import VehicleError
from fifthwheel.base.units import STANDARD_GRAVITY as GRAVITY
from fifthwheel.results.assess.braking import DECELERATION, measure
from fifthwheel.results.assess.truck import Body, Truck
from fifthwheel.truck import get
from fifthwheel.truck.loads import unit_cog_height
from tests.results.assess.trucks import CATALOGUE, rigid


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
    assert measure(truck)["braking_efficiency"] == pytest.approx(rear)


def test_a_truck_that_would_tip_has_no_efficiency():
    high = Truck(vehicle=rigid()).changed({"tractor.sprung.cog_height": 9.0})
    assert measure(high)["braking_efficiency"] == 0.0


@pytest.mark.parametrize("rear", [0.3, 0.6])
def test_stated_brakes_of_a_rigid_truck(rear):
    """Front and rear need fraction times z over their loads, m g (l_r + z h) / L and m g (l_f - z h) / L."""
    brakes = {"tractor.front": 2 * (1 - rear), "tractor.drive": 2 * rear}  # fractions of any sum
    truck = Truck(vehicle=rigid(), body=Body(brakes=brakes))
    unit = truck.vehicle.units[0]
    front, drive = (group.position for group in unit.axle_groups)
    height = unit_cog_height(truck.vehicle.parameters(), unit)
    on_rear = (front - unit.cog - DECELERATION * height) / (front - drive)
    assert measure(truck)["braking_efficiency"] == pytest.approx(min((1 - on_rear) / (1 - rear), on_rear / rear))


@pytest.mark.parametrize("name", CATALOGUE)
def test_brakes_in_proportion_to_the_static_loads_are_the_default(name):
    vehicle = get(name)
    stated = Truck(vehicle=vehicle, body=Body(brakes=vehicle.axle_loads()))
    assert measure(stated) == pytest.approx(measure(Truck(vehicle=vehicle)))


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
