"""Raised, self-steering and command-steered axles of the nonlinear truck, against the laws and against the model."""

import numpy as np
import pytest

from fifthwheel.base.units import STANDARD_GRAVITY as GRAVITY
from fifthwheel.model.manoeuvres import constant_radius
from fifthwheel.model.plant import Plant
from fifthwheel.truck import Vehicle
from tests.model.dynamics.test_steered_axles import COMMAND, LIFTED, SELF_STEERING, with_axle
from tests.model.plant.test_truck import NO_RESISTANCE

pytest.importorskip("mujoco")
AXLES = ("front", "middle", "rear")


def in_a_bend(truck: Vehicle) -> dict[str, float]:
    """True signals at the end of a slow bend to the left."""
    run = Plant(truck, NO_RESISTANCE).drive(constant_radius(radius=60.0, speed=8.0, duration=12.0), rate=20)
    return {name: float(values[-1]) for name, values in run.truth.items()}


def geometric_slip(truth: dict[str, float], x: float) -> float:
    """Slip angle of a fixed trailer axle at x by the motion of its unit, rad."""
    v, u, r = (truth[f"{q}.semitrailer"] for q in ("lateral_velocity", "longitudinal_velocity", "yaw_rate"))
    return -np.arctan2(v + (x + 5.5) * r, u)


@pytest.mark.slow
def test_castor_wheels_slip_by_the_rest_of_the_slip_angle_and_command_steering_turns_them():
    """To the right in a left bend."""
    truth = in_a_bend(with_axle(SELF_STEERING))
    for axle, x, fraction in zip(AXLES, (-6.7, -8.0, -9.3), (1, 1, 0.2), strict=True):
        expected = fraction * geometric_slip(truth, x)
        assert truth[f"slip_angle.semitrailer.{axle}"] == pytest.approx(expected, rel=0.02, abs=1e-4)
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
