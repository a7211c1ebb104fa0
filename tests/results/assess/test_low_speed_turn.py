"""The low-speed turn against an independent integrator and the condition of rolling."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fifthwheel.base.errors import VehicleError
from fifthwheel.results.assess.low_speed_turn import FRICTION, RADIUS, equivalent_axle, measure, turn
from fifthwheel.results.assess.truck import Body, Truck
from fifthwheel.truck import get
from tests.results.assess.trucks import double, rigid, single_axles

SINGLE = Truck(vehicle=single_axles(), body=Body(rear_overhang=2.7))


@pytest.mark.parametrize(("vehicle", "axles"), [(single_axles(), [-3.7, -8.0]), (double(), [-3.7, -8.0, -8.0])])
def test_no_axle_slips_where_every_unit_has_one(vehicle, axles):
    run = turn(Truck(vehicle=vehicle))
    assert np.abs(run.slips).max() < 1e-12
    for i, x in enumerate(axles):  # the path of each rear axle is along the unit
        axle = run.origins[:, i] + x * np.exp(1j * run.headings[:, i])
        moved = np.diff(axle) * np.exp(-0.5j * (run.headings[1:, i] + run.headings[:-1, i]))
        assert np.abs(moved.imag / moved.real).max() < 1e-3


def test_the_heading_of_the_first_unit_is_that_of_another_integrator():
    run = turn(SINGLE)
    s = np.arange(0, RADIUS * math.pi / 2, 1.0)
    exact = solve_ivp(lambda s, h: np.sin(s / RADIUS - h) / 3.7, (0, s[-1]), [0.0], t_eval=s, rtol=1e-10).y[0]
    stations = -0.2 + 0.2 * np.arange(len(run.steer))
    assert np.interp(s, stations, run.headings[:, 0]) == pytest.approx(exact, abs=2e-3)


def test_the_outer_tyre_follows_the_circle():
    run = turn(SINGLE)
    tyre = run.origins[:, 0] - 0.5j * SINGLE.body.width * np.exp(1j * run.headings[:, 0])
    on_circle = (tyre.real > 0) & (tyre.imag < RADIUS)
    assert np.abs(tyre[on_circle] - 1j * RADIUS) == pytest.approx(RADIUS, abs=1e-9)


def test_equivalent_length_of_a_bogie():
    """Three axles of equal stiffness: (6.7^2 + 8^2 + 9.3^2) / (6.7 + 8 + 9.3)."""
    trailer = get("cheng_cebon_2011").units[1]
    assert equivalent_axle(trailer, 0.0)[0] == pytest.approx((6.7**2 + 8.0**2 + 9.3**2) / 24.0)
    assert equivalent_axle(single_axles().units[1], 0.0)[0] == pytest.approx(8.0)


def test_swept_path_grows_with_the_trailer_and_tail_swing_with_the_overhang():
    near, far = (measure(SINGLE.changed({"semitrailer.middle.position": x})) for x in (-8.0, -10.0))
    assert far["swept_path"] > near["swept_path"] + 0.5
    swings = [measure(Truck(vehicle=SINGLE.vehicle, body=Body(rear_overhang=x)))["tail_swing"] for x in (0.5, 1.5, 3.0)]
    assert swings == sorted(swings)
    assert "tail_swing" not in measure(Truck(vehicle=SINGLE.vehicle))


def test_a_rigid_truck_sweeps_little_more_than_its_steady_turn():
    """On the circle its innermost point tends to sqrt(R_t^2 - L^2) - w; in 90 degrees it does not get further in."""
    truck = Truck(vehicle=rigid())
    w, front = truck.body.width, 3.7 + truck.body.front_overhang
    rear = math.sqrt(RADIUS**2 - 3.7**2) - w  # the inner rear tyre in a steady turn
    outer = math.hypot(rear + w, front)
    assert measure(truck)["swept_path"] == pytest.approx(outer - rear, abs=0.06)


def test_friction_demand_comes_from_bogies():
    assert measure(SINGLE)["friction_demand"] == pytest.approx(0.0, abs=1e-9)
    bogie = Truck(vehicle=get("auburn_6x4"))
    wide = bogie.changed({"tractor.drive_rear.position": -7.0})
    assert 0.02 < measure(bogie)["friction_demand"] < measure(wide)["friction_demand"] < 1


def test_friction_demand_is_that_of_two_equal_axles():
    """A rigid truck with a tandem: the side force of each axle, C alpha / sqrt(1 + (C alpha / (mu N))^2), and the
    aligning moment of its tyres, balanced about the point of the unit without side force."""
    vehicle = get("auburn_6x4")
    path, trail = "tractor.drive", 0.08
    fields = vehicle.model_dump()
    group = fields["units"][0]["axle_groups"][1]
    fields |= {"units": fields["units"][:1], "couplings": (), "stated": {}}
    plain = Truck(vehicle=type(vehicle)(**fields))
    group["pneumatic_trail"] = trail
    truck = Truck(vehicle=type(vehicle)(**fields))
    run, unit = turn(truck), truck.vehicle.units[0]
    tandem, front = unit.axle_groups[1], unit.axle_groups[0]
    loads = truck.vehicle.axle_loads()
    limit, stiffness = FRICTION * loads[path] / 2, tandem.cornering_stiffness / 2
    reference = front.position - equivalent_axle(unit, front.position)[0]
    moment = 0.0
    for axle, slip in zip(tandem.axles, run.slips[:, 1:].T, strict=True):
        sliding = 1 + (stiffness * slip / limit) ** 2
        force = stiffness * slip / np.sqrt(sliding)
        moment = moment + (axle.position - reference - trail / sliding) * force
    expected = np.max(np.abs(moment) / (front.position - reference) / np.cos(run.steer))
    demand = measure(truck)["friction_demand"]
    assert demand == pytest.approx(expected / (FRICTION * loads["tractor.front"]), rel=1e-9)
    assert demand != pytest.approx(measure(plain)["friction_demand"], rel=1e-3)


def test_a_unit_needs_an_axle_behind_its_first():
    fields = rigid().model_dump()
    tractor = fields["units"][0]
    tractor["axle_groups"] = [tractor["axle_groups"][0]]
    tractor["cog"] = 0.0
    with pytest.raises(VehicleError, match="no axle behind"):
        measure(Truck(vehicle=type(SINGLE.vehicle)(**fields)))
