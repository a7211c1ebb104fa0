"""Frontal and tail swing and the turning circle against another integration of the rolling units."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fifthwheel.results.assess.low_speed_turn import RADIUS, equivalent_axle, measure, measure_circle, unstated
from fifthwheel.results.assess.truck import Body, Truck
from fifthwheel.truck import get
from tests.results.assess.trucks import CATALOGUE, rigid, single_axles


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


@pytest.mark.parametrize("name", CATALOGUE)
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


@pytest.mark.parametrize("name", CATALOGUE)
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


def test_a_rigid_truck_turns_on_its_circle():
    """(sqrt(R^2 - (L + front overhang)^2) - width) inside."""
    inner = math.sqrt(RADIUS**2 - (3.7 + 1.4) ** 2) - 2.55
    assert measure_circle(Truck(vehicle=rigid()))["turning_circle"] == pytest.approx(inner, abs=0.05)


def test_a_semitrailer_tends_to_the_steady_circle_of_the_type_approval():
    """Kingpin over the drive axle: R_2^2 = R_1^2 - L^2 about the middle of the trailer's axle."""
    vehicle = single_axles().replace({"fifth_wheel.leading_position": -3.7, "semitrailer.middle.position": -6.0})
    first = math.sqrt(RADIUS**2 - 5.1**2) - 2.55 / 2
    steady = math.sqrt(first**2 - 6.0**2) - 2.55 / 2
    assert measure_circle(Truck(vehicle=vehicle))["turning_circle"] == pytest.approx(steady, abs=0.02)


def test_the_tail_of_every_unit_counts():
    vehicle = get("b_double")
    short = Truck(vehicle=vehicle, body=Body(rear_overhang=0.5))
    long = Truck(vehicle=vehicle, body=Body(rear_overhang=0.5, between={"lead.rear_overhang": 3.0}))
    assert measure(long)["tail_swing"] > measure(short)["tail_swing"] + 0.05


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
