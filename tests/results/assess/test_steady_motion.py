"""Steady off-tracking and the path on a crossfall against closed forms of single-axle trucks."""

import numpy as np
import pytest

from fifthwheel.base.errors import VehicleError
from fifthwheel.base.units import STANDARD_GRAVITY as GRAVITY
from fifthwheel.results.assess.propagation import Neighbourhood, of_vehicle, samples
from fifthwheel.results.assess.steady_motion import (
    CROSSFALL,
    lateral_positions,
    measure_straight_path,
    measure_turn,
    measure_understeer,
    off_tracking,
)
from fifthwheel.results.assess.truck import Truck
from fifthwheel.truck import get
from tests.results.assess.trucks import single_axles

VEHICLE = single_axles()
L1, L2 = 3.7, 8.0
E = 0.6
"""The fifth wheel ahead of the drive axle, m."""


def slip_per_acceleration(path: str) -> float:
    """Slip angle of an axle in a steady turn, rad per m/s^2."""
    return VEHICLE.axle_loads()[path] / GRAVITY / VEHICLE.parameters()[f"{path}.cornering_stiffness"]


def test_at_low_speed_it_is_kinematic():
    speed, radius = 1.0, 80.0
    outside = off_tracking(Truck(vehicle=VEHICLE, speed=speed), speed / radius)
    exact = np.sqrt(radius**2 - L1**2 + E**2 - L2**2) - radius
    assert outside == pytest.approx(exact, rel=0.02)


@pytest.mark.parametrize("speed", [15.0, 25.0])
def test_at_high_speed_slip_angles_push_the_axles_outwards(speed):
    """With small angles: L alpha - L^2 / 2R for each length, and the reverse for the fifth wheel ahead of the axle."""
    acceleration = 1.0
    radius = speed**2 / acceleration
    drive, trailer = (slip_per_acceleration(path) * acceleration for path in ("tractor.drive", "semitrailer"))
    expected = (L1 * drive - L1**2 / (2 * radius)) - (E * drive - E**2 / (2 * radius))
    expected += L2 * trailer - L2**2 / (2 * radius)
    outside = off_tracking(Truck(vehicle=VEHICLE, speed=speed), acceleration / speed)
    assert outside == pytest.approx(expected, abs=0.002)


def test_an_unstable_truck_has_none():
    truck = Truck(vehicle=get("auburn_6x4"), speed=30.0)
    with pytest.raises(VehicleError, match="below its critical speed"):
        measure_turn(truck)


def test_on_a_crossfall_the_units_run_askew_by_the_slip_of_their_rear_axles():
    truck = Truck(vehicle=VEHICLE)
    drive, trailer = (slip_per_acceleration(path) * GRAVITY * CROSSFALL for path in ("tractor.drive", "semitrailer"))
    y = lateral_positions(truck)
    front = y[0] + truck.body.front_overhang * (y[1] - y[0]) / (truck.body.front_overhang + L1)
    assert front == pytest.approx(0.0, abs=1e-12)
    assert abs(y[1] - y[0]) == pytest.approx(drive * (L1 + truck.body.front_overhang), rel=1e-6)
    assert abs(y[3] - y[2]) == pytest.approx(trailer * L2, rel=1e-6)
    assert measure_straight_path(truck)["straight_path_width"] == pytest.approx(truck.body.width + np.ptp(y))


def test_the_understeer_gradient_of_single_axles_is_that_of_the_text_books():
    """m_f / C_f - m_r / C_r with the static load over g; and its sigma from a stiffness of 10 %."""
    gradient = slip_per_acceleration("tractor.front") - slip_per_acceleration("tractor.drive")
    assert measure_understeer(Truck(vehicle=VEHICLE))["understeer_gradient"] == pytest.approx(gradient, rel=1e-6)
    exact = dict.fromkeys(VEHICLE.parameters(), 0.0)
    stiffness = VEHICLE.parameters()["tractor.front.cornering_stiffness"]
    uncertain = VEHICLE.with_stated(exact | {"tractor.front.cornering_stiffness": 0.1 * stiffness})
    found = samples(Neighbourhood(Truck(vehicle=uncertain), of_vehicle(uncertain)), measure_understeer)
    sigma = found.spread(lambda values: values["understeer_gradient"]).sigma
    assert sigma == pytest.approx(0.1 * slip_per_acceleration("tractor.front"), rel=0.03)
