"""Raised, self-steering and command-steered axles of the nonlinear truck, against the laws and against the model."""

import numpy as np
import pytest

from fifthwheel.base.options import TyreLaw
from fifthwheel.base.units import STANDARD_GRAVITY as GRAVITY
from fifthwheel.model.manoeuvres import constant_radius, lane_changes
from fifthwheel.model.plant import Plant
from fifthwheel.truck import Vehicle
from tests.model.dynamics.test_steered_axles import COMMAND, LIFTED, SELF_STEERING, with_axle
from tests.model.plant.test_truck import NO_RESISTANCE, OUTPUTS, of_groups, response, sine

pytest.importorskip("mujoco")
AXLES = ("front", "middle", "rear")


def in_a_bend(truck: Vehicle) -> dict[str, float]:
    """True signals at the end of a slow bend to the left."""
    run = Plant(truck, NO_RESISTANCE).drive(constant_radius(radius=60.0, speed=8.0, duration=15.0), rate=20)
    return {name: float(values[-1]) for name, values in run.truth.items()}


def geometric_slip(truth: dict[str, float], x: float) -> float:
    """Slip angle of a fixed trailer axle at x by the motion of its unit, rad."""
    v, u, r = (truth[f"{q}.semitrailer"] for q in ("lateral_velocity", "longitudinal_velocity", "yaw_rate"))
    return -np.arctan2(v + (x + 5.5) * r, u)


@pytest.mark.slow
def test_castor_wheels_slip_by_the_rest_of_the_slip_angle():
    truth = in_a_bend(with_axle(SELF_STEERING))
    for axle, x, fraction in zip(AXLES, (-6.7, -8.0, -9.3), (1, 1, 0.2), strict=True):
        expected = fraction * geometric_slip(truth, x)
        assert truth[f"slip_angle.semitrailer.{axle}"] == pytest.approx(expected, rel=0.02, abs=1e-4)


@pytest.mark.slow
def test_command_steering_turns_the_rear_axle_to_the_right_in_a_left_bend():
    truth = in_a_bend(with_axle(COMMAND))
    steer = truth["slip_angle.semitrailer.rear"] - geometric_slip(truth, -9.3)
    assert truth["articulation.semitrailer"] < -0.05
    assert steer == pytest.approx(0.3 * truth["articulation.semitrailer"], rel=0.02)


def test_a_raised_axle_has_neither_load_nor_force():
    truck = with_axle(LIFTED, 0)
    truth = in_a_bend(truck)
    assert "vertical_force.semitrailer.front" not in truth
    load = sum(value for name, value in truth.items() if name.startswith("vertical_force"))
    assert load == pytest.approx(sum(unit.mass for unit in truck.units) * GRAVITY, rel=1e-4)
    of_group = sum(truth[f"vertical_force.semitrailer.{axle}"] for axle in AXLES[1:])
    assert of_group == pytest.approx(truck.axle_loads()["semitrailer"], rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("keys", "tyres", "limit"),
    [(SELF_STEERING, "saturating", 0.08), (COMMAND, "linear", 0.13), (LIFTED, "saturating", 0.08)],
)
def test_model_and_nonlinear_truck_agree(keys: dict[str, object], tyres: TyreLaw, limit: float):
    """As well as with fixed axles; see `test_truck`."""
    truck = with_axle(keys)
    truck = truck.replace(of_groups(truck, "relaxation_length"))
    run = Plant(truck, NO_RESISTANCE).drive(sine(0.004))
    predicted = response(truck, run, tyres=tyres)
    for name in OUTPUTS[:-1]:
        error = np.sqrt(np.mean((predicted[name] - run.truth[name]) ** 2) / np.mean(run.truth[name] ** 2))
        assert error < limit, (name, error)


@pytest.mark.slow
def test_a_castor_axle_amplifies_a_lane_change():
    course = lane_changes(count=1, speed=20.0)
    fixed, castor = (Plant(with_axle(keys)).drive(course).truth for keys in ({}, SELF_STEERING))
    name = "yaw_rate.semitrailer"
    assert np.abs(castor[name]).max() > 1.1 * np.abs(fixed[name]).max()
