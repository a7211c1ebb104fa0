"""Damping by eigenvalues and by the decay of peaks."""

import numpy as np
import pytest

from fifthwheel.base.errors import VehicleError
from fifthwheel.model.dynamics import critical_speed, linear_system, modes
from fifthwheel.results.assess.truck import Truck
from fifthwheel.results.assess.yaw_damping import (
    PULSE,
    eigenvalue_damping,
    measure,
    measure_pulse,
    measure_zero_damping_speed,
    pulse_damping,
    pulse_response,
)
from fifthwheel.truck import get

TRUCK = get("cheng_cebon_2011")


@pytest.mark.parametrize("damping", [0.1, 0.5])
def test_the_decay_of_a_damped_oscillation_is_its_damping(damping):
    time, w = np.arange(0, 10, 0.002), 3.0
    response = np.exp(-damping * w * time) * np.sin(w * np.sqrt(1 - damping**2) * time)
    assert pulse_damping(time, response) == pytest.approx(damping, rel=1e-3)


@pytest.mark.parametrize("name", ["a_double", "truck_full_trailer", "truck_dolly_semitrailer", "b_double"])
def test_the_decay_of_a_long_combination_begins_at_its_largest_peak(name):
    """The motion reaches the last unit late: peaks that still grow are not part of its decay."""
    truck = Truck(vehicle=get(name))
    dampings = [mode.damping for mode in modes(truck.vehicle, truck.speed) if mode.frequency < 1]
    assert 0.8 * min(dampings) < pulse_damping(*pulse_response(truck)) < max(dampings)


def test_a_ripple_on_a_slow_decay_is_no_oscillation():
    time = np.arange(0, 10, 0.01)
    assert pulse_damping(time, np.exp(-0.1 * time) * (1 + 0.2 * np.sin(5 * time))) == 1.0
    assert pulse_damping(time, np.exp(-time)) == 1.0  # no peaks


def test_a_stiff_truck_has_the_damping_of_the_yaw_model():
    """Without roll there is no mode of roll to choose from; the article's roll has less damping than its yaw."""
    lowest = min(m.damping for m in modes(TRUCK, 88 / 3.6) if m.eigenvalue.imag > 0)
    assert lowest < 0.2 < 0.5 < eigenvalue_damping(Truck(vehicle=TRUCK))
    stiff = {name: 1e3 * value for name, value in TRUCK.parameters().items() if name.endswith("roll_stiffness")}
    truck = Truck(vehicle=TRUCK.replace(stiff))
    expected = min(m.damping for m in modes(truck.vehicle, truck.speed, roll=False) if m.eigenvalue.imag > 0)
    assert eigenvalue_damping(truck) == pytest.approx(expected, rel=0.01)


def test_the_pulse_gives_the_damping_of_one_dominant_mode():
    """Soft tyres of the trailer: its swaying decays much slower than everything else."""
    truck = Truck(vehicle=TRUCK).changed({"semitrailer.cornering_stiffness": 5.0e5})
    assert measure_pulse(truck)["yaw_damping_pulse"] == pytest.approx(eigenvalue_damping(truck), rel=0.1)


def test_the_response_is_that_over_time_to_the_pulse():
    truck = Truck(vehicle=TRUCK)
    time, response = pulse_response(truck)
    system = linear_system(TRUCK, truck.speed, "articulation.semitrailer")
    pulse = np.radians(1.0) * np.where(time < PULSE, np.sin(np.pi * time / PULSE), 0.0)
    expected = system.response(time, {system.inputs[0]: pulse})["articulation.semitrailer"]
    assert response == pytest.approx(expected, abs=1e-6)


def test_above_the_critical_speed():
    vehicle = get("auburn_6x4")
    limit = critical_speed(vehicle)
    assert limit is not None
    truck = Truck(vehicle=vehicle, speed=limit + 0.5)
    for damping in (measure, measure_pulse):
        with pytest.raises(VehicleError, match="unstable"):
            damping(truck)


def test_at_the_zero_damping_speed_a_mode_of_yaw_does_not_decay():
    """A trailer with soft tyres and a large yaw inertia sways; by the eigenvalues at, below and above that speed."""
    changes = {"semitrailer.cornering_stiffness": 3.5e5, "semitrailer.yaw_inertia": 1.0e6}
    truck = Truck(vehicle=TRUCK).changed(changes)
    found = measure_zero_damping_speed(truck)["zero_damping_speed"]

    def lowest(speed):
        return min(m.damping for m in modes(truck.vehicle, speed) if m.eigenvalue.imag > 1e-9)

    assert lowest(found) == pytest.approx(0.0, abs=1e-6)
    assert lowest(found - 1) > 0 > lowest(found + 1)
    assert found == pytest.approx(critical_speed(truck.vehicle), rel=1e-5)


def test_trucks_without_a_zero_damping_speed_say_why():
    with pytest.raises(VehicleError, match="zero-damping speed: none up to 200 km/h"):
        measure_zero_damping_speed(Truck(vehicle=TRUCK))
    with pytest.raises(VehicleError, match=r"zero-damping speed: none, .* at 120 km/h it spins or jackknifes"):
        measure_zero_damping_speed(Truck(vehicle=get("auburn_6x4")))
