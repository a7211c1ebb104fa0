"""The low-speed turn against an independent integrator and the condition of rolling."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fifthwheel.base.errors import VehicleError
from fifthwheel.results.assess.low_speed_turn import (
    FRICTION,
    RADIUS,
    equivalent_axle,
    measure,
    measure_circle,
    turn,
    unstated,
)
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


def of(name):
    """A truck with overhangs at every front end and at the rear of the last unit."""
    plain = Truck(vehicle=get(name))
    between = {f"{plain.vehicle.units[i].name}.front_overhang": 1.5 for i in plain.semitrailers()}
    between |= dict.fromkeys(unstated(plain).get("tail_swing", ())[:-1], 0.0)
    return Truck(vehicle=plain.vehicle, body=Body(rear_overhang=2.0, between=between))


def rolled(truck, ahead, angle, beyond):
    """Outer and inner corners of each unit, front and rear, (N, n) complex, by the velocities of rigid bodies."""
    units, couplings, half = truck.vehicle.units, truck.vehicle.couplings, truck.body.width / 2
    leads = [truck.front_axle.position, *(c.trailing_position for c in couplings)]
    axles = [x - equivalent_axle(unit, x)[0] for unit, x in zip(units, leads, strict=True)]
    outer = truck.front_axle.position + ahead - 1j * half  # in the frame of the first unit

    def turned(s):
        return min(max(s / RADIUS, 0.0), angle)

    def rates(s, headings):
        velocity, arm, result = np.exp(1j * turned(s)), outer - axles[0], []
        for i, heading in enumerate(headings):
            axis = np.exp(1j * heading)
            result.append((velocity / axis).imag / arm.real)  # the axle does not move across its unit
            if i < len(couplings):
                lever = (couplings[i].leading_position - axles[i] - arm) * axis
                velocity, arm = velocity + 1j * result[-1] * lever, couplings[i].trailing_position - axles[i + 1]
        return result

    s = np.arange(0.0, RADIUS * angle + beyond, 0.05)
    psi = solve_ivp(rates, (0, s[-1]), [0.0] * len(units), t_eval=s, rtol=1e-8, atol=1e-10, max_step=1.0).y
    a = np.array([turned(x) for x in s])
    point = RADIUS * (np.sin(a) + 1j - 1j * np.cos(a)) + (s - RADIUS * a) * np.exp(1j * a)
    corners = []
    for i, (rear, front) in enumerate(truck.ends()):
        axis = np.exp(1j * psi[i])
        origin = point - outer * axis if not i else joint - couplings[i - 1].trailing_position * axis  # noqa: F821
        corners.append([[origin + (x + side * half) * axis for side in (-1j, 1j)] for x in (front, rear)])
        joint = origin + couplings[i].leading_position * axis if i < len(couplings) else origin  # noqa: F841
    return np.array(corners)  # unit, end, side, sample


@pytest.mark.parametrize("name", ["cheng_cebon_2011", "a_double", "truck_full_trailer"])
def test_swings_are_those_of_another_integration(name):
    truck = of(name)
    values, corners = measure(truck), rolled(truck, 0.0, math.pi / 2, 80.0)
    assert values["tail_swing"] == pytest.approx(-corners[-1, 1, 0].imag.min(), abs=2e-3)
    front = corners[:, 0, 0]
    assert values["frontal_swing"] == pytest.approx(front[0].real.max() - RADIUS, abs=2e-3)
    lead, differences, maxima = 0, [], []
    for i in truck.semitrailers():
        y = front[i].imag[front[i].imag > 0]
        outside = front[i].real[front[i].imag > 0] - np.interp(y, front[lead].imag, front[lead].real)
        differences.append(outside.max())
        maxima.append(front[i].real.max() - front[lead].real.max())
        lead = i
    assert values.get("frontal_swing_difference") == (pytest.approx(max(differences), abs=3e-3) if maxima else None)
    assert values.get("frontal_swing_maxima") == (pytest.approx(max(maxima), abs=3e-3) if maxima else None)


@pytest.mark.parametrize("name", ["cheng_cebon_2011", "a_double", "truck_full_trailer"])
def test_the_turning_circle_is_that_of_another_integration(name):
    truck = of(name)
    corners = rolled(truck, truck.body.front_overhang, 2 * math.pi, 0.0)
    assert np.abs(corners[0, 0, 0] - 1j * RADIUS) == pytest.approx(RADIUS, abs=1e-9)
    nearest = [  # of points of each unit, across and along
        np.abs(outer + part * (inner - outer) - 1j * RADIUS).min()
        for (front_right, front_left), (rear_right, rear_left) in corners
        for along in np.linspace(0, 1, 101)
        for outer, inner in [
            (along * front_right + (1 - along) * rear_right, along * front_left + (1 - along) * rear_left)
        ]
        for part in np.linspace(0, 1, 11)
    ]
    assert measure_circle(truck)["turning_circle"] == pytest.approx(min(nearest), abs=0.02)


def test_a_semitrailer_tends_to_the_steady_circle_of_the_type_approval():
    """Kingpin over the drive axle: R_2^2 = R_1^2 - L^2 about the middle of the trailer's axle."""
    vehicle = single_axles().replace({"fifth_wheel.leading_position": -3.7, "semitrailer.middle.position": -6.0})
    first = math.sqrt(RADIUS**2 - 5.1**2) - 2.55 / 2
    steady = math.sqrt(first**2 - 6.0**2) - 2.55 / 2
    assert measure_circle(Truck(vehicle=vehicle))["turning_circle"] == pytest.approx(steady, abs=0.02)


def test_the_tail_swing_needs_the_tail_of_a_truck_with_a_drawbar():
    vehicle = get("truck_full_trailer")
    trailer = Truck(vehicle=vehicle, body=Body(rear_overhang=2.0))
    both = Truck(vehicle=vehicle, body=Body(rear_overhang=2.0, between={"truck.rear_overhang": 3.0}))
    assert unstated(trailer)["tail_swing"] == ("truck.rear_overhang",)
    assert "tail_swing" not in measure(trailer)
    assert "tail_swing" not in unstated(both)
    tails = -rolled(both, 0.0, math.pi / 2, 80.0)[:, 1, 0].imag.min(axis=1)
    assert tails[0] > tails[-1] + 0.1
    assert measure(both)["tail_swing"] == pytest.approx(tails[0], abs=2e-3)
