"""The lane change of the linear model, integrated again over time, and of the nonlinear truck."""

import numpy as np
import pytest

from fifthwheel.base.units import STANDARD_GRAVITY as GRAVITY
from fifthwheel.model.dynamics import linear_system, rearward_amplification
from fifthwheel.model.plant import Plant, Properties
from fifthwheel.results.assess import lane_change, nonlinear
from fifthwheel.results.assess.lane_change import ACCELERATION, linear, measure, measure_peak
from fifthwheel.results.assess.steady_motion import measure_turn
from fifthwheel.results.assess.truck import Body, Truck
from fifthwheel.truck import get
from tests.results.assess.trucks import CATALOGUE

TRUCK = Truck(vehicle=get("cheng_cebon_2011"))


def test_it_is_the_response_over_time_to_its_steer_angle():
    run = linear(TRUCK)
    outputs = ["cog_acceleration.tractor", "cog_acceleration.semitrailer", "roll.semitrailer"]
    system = linear_system(TRUCK.vehicle, TRUCK.speed, outputs)
    response = system.response(run.time, {system.inputs[0]: run.steer})
    for unit in ("tractor", "semitrailer"):
        assert run.acceleration[unit] == pytest.approx(response[f"cog_acceleration.{unit}"], abs=0.002)
    assert run.roll["semitrailer"] == pytest.approx(response["roll.semitrailer"], abs=1e-4)
    assert run.x["tractor"][0] == pytest.approx(-3.7)
    assert run.x["semitrailer"][0] == pytest.approx(-3.1 - 9.3)


def test_the_front_axle_follows_the_course():
    run = linear(TRUCK)
    course = lane_change.course(TRUCK.speed)
    assert np.max(run.acceleration["front"]) == pytest.approx(ACCELERATION, rel=1e-3)
    assert run.y["front"][-1] == pytest.approx(course.offset, abs=1e-3)
    path = course.path(count=1, speed=TRUCK.speed)
    on_path = np.interp(run.x["front"], path.x, path.y)
    assert run.y["front"] == pytest.approx(on_path, abs=0.01)
    assert run.y["semitrailer"][-1] == pytest.approx(course.offset, abs=0.01)


@pytest.mark.parametrize("speed", [15.0, 25.0, 30.0])
def test_the_peak_of_the_frequency_response(speed):
    truck = Truck(vehicle=TRUCK.vehicle, speed=speed)
    peak, _ = rearward_amplification(TRUCK.vehicle, speed, np.linspace(0.05, 1.5, 5801))
    assert measure_peak(truck)["rearward_amplification_peak"] == pytest.approx(peak, rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("name", CATALOGUE)
def test_the_rear_set_is_weighted_by_the_moments_of_its_sprung_masses(name):
    """By the response over time, and with the moments m h of body and payload added up part by part."""
    truck = Truck(vehicle=get(name))
    rear = {
        "cheng_cebon_2011": ("tractor", "semitrailer"),
        "b_double": ("tractor", "lead", "semitrailer"),
        "truck_dolly_semitrailer": ("dolly", "semitrailer"),
        "a_double": ("dolly", "second"),
        "truck_full_trailer": ("dolly", "trailer"),
    }[name]
    run, moments = linear(truck), {}
    for unit in map(truck.vehicle.unit, rear):
        moments[unit.name] = unit.sprung.mass * unit.sprung.cog_height
        if load := unit.payload:
            moments[unit.name] += load.mass * (load.floor_height + load.height / 2)
    system = linear_system(truck.vehicle, truck.speed, [f"cog_acceleration.{unit}" for unit in rear])
    response = system.response(run.time, {system.inputs[0]: run.steer})
    weighted = sum(moments[unit] * response[f"cog_acceleration.{unit}"] for unit in rear) / sum(moments.values())
    expected = np.abs(weighted).max() / np.abs(run.acceleration["front"]).max()
    assert measure(truck)["rearward_amplification_set"] == pytest.approx(expected, rel=2e-3)


def test_the_dynamic_threshold_is_the_acceleration_of_a_load_transfer_ratio_of_1():
    values, run = measure(TRUCK), linear(TRUCK)
    narrow = Truck(vehicle=TRUCK.vehicle, body=Body(half_track=0.5))
    assert measure(narrow)["load_transfer_ratio"] == pytest.approx(2 * values["load_transfer_ratio"], rel=1e-9)
    grown = values["rollover_threshold_dynamic"] * GRAVITY / np.abs(run.acceleration["front"]).max()
    assert grown * np.abs(run.load_transfer).max() == pytest.approx(1.0)


@pytest.mark.slow
def test_the_nonlinear_truck_agrees():
    """An independent model: at 0.15 g its tyres are almost linear.

    Its driver rounds off the course, so that the rearward amplification of that course is 10 % higher. With the steer
    angle of that driver the linear model has the same ratio of the peaks of both units, within 1 %.
    """
    pytest.importorskip("mujoco")
    plant = Plant(TRUCK.vehicle, Properties(half_track=TRUCK.body.half_track))
    run = nonlinear.drive_lane_change(TRUCK, plant)
    assert run.x["front"][0] == 0.0
    assert run.x["semitrailer"][0] == pytest.approx(-3.1 - 9.3, abs=0.05)
    outputs = [f"cog_acceleration.{unit}" for unit in ("tractor", "semitrailer")]
    system = linear_system(TRUCK.vehicle, TRUCK.speed, outputs)
    peaks = [np.abs(response).max() for response in system.response(run.time, {system.inputs[0]: run.steer}).values()]
    actual = np.abs(run.acceleration["semitrailer"]).max() / np.abs(run.acceleration["tractor"]).max()
    assert actual == pytest.approx(peaks[1] / peaks[0], rel=0.01)
    ratio = lane_change.measures(run)["load_transfer_ratio"]
    assert ratio == pytest.approx(measure(TRUCK)["load_transfer_ratio"], rel=0.2)
    off_tracking = nonlinear.steady_off_tracking(TRUCK, plant)
    assert off_tracking == pytest.approx(measure_turn(TRUCK)["steady_off_tracking"], rel=0.15)
