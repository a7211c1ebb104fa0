"""Estimates, derived quantities and sensor errors, from values and sigmas."""

import numpy as np
import pytest

from fifthwheel.apps.cheng_cebon_2011 import TwoStage
from fifthwheel.apps.cheng_cebon_2011.problem import parameter_unknowns
from fifthwheel.base.errors import SignalError
from fifthwheel.estimate.identify import Estimate, Verdict
from fifthwheel.estimate.identify.estimates import (
    derived_from_covariance,
    derived_from_payload_height,
    fixed_estimate,
    parameter_estimate,
    sensor_error_unit,
)
from fifthwheel.estimate.observe.uncertainty import Uncertainty
from fifthwheel.truck import Vehicle

HEIGHT, STIFFNESS = "semitrailer.payload.height", "tractor.front.cornering_stiffness"
PAYLOAD = "semitrailer.payload.mass"
STEER, RATE = "steer.tractor.front", "yaw_rate.tractor"


def height_estimate(truck: Vehicle, sigma_z: float = 0.05) -> Estimate:
    (unknown,) = parameter_unknowns(truck, [HEIGHT], TwoStage())
    return parameter_estimate(unknown, 1.3, sigma_z, Verdict.CONVERGED, stage=2, settling_time=4.0)


def test_parameter_estimate(truck: Vehicle) -> None:
    """Sigma of a stiffness, which is estimated by its logarithm, is proportional to the estimate."""
    (unknown,) = parameter_unknowns(truck, [STIFFNESS], TwoStage())
    estimate = parameter_estimate(unknown, 5.0e5, 0.1, Verdict.AT_BOUND)
    assert estimate.sigma == pytest.approx(0.1 * 0.3 * 5.0e5)
    assert estimate.prior == pytest.approx(0.3 * truck.parameters()[STIFFNESS])
    assert (estimate.initial, estimate.unit, estimate.stage) == (truck.parameters()[STIFFNESS], "N/rad", 1)
    assert height_estimate(truck).sigma == pytest.approx(0.05)
    fixed = fixed_estimate(STIFFNESS, 4.0e5)
    assert (fixed.value, fixed.initial, fixed.sigma, fixed.verdict) == (4.0e5, 4.0e5, None, Verdict.FIXED)
    assert derived_from_payload_height(truck, []) == []  # without information
    assert all(e.sigma is None for e in derived_from_payload_height(truck, [fixed_estimate(HEIGHT, 1.0)]))
    uncertainty = Uncertainty(names=(STIFFNESS,), covariance=np.eye(1))
    assert derived_from_covariance(truck, truck, [height_estimate(truck)], uncertainty) == []


def test_derived_quantities_of_a_payload_that_is_as_heavy_as_its_unit_allows(truck: Vehicle) -> None:
    """A heavier payload is impossible, so the derivative is one-sided."""
    values, unit = truck.parameters(), truck.unit("semitrailer")
    heaviest = (unit.mass - unit.sprung.mass) * (1 - 1e-6)
    vehicle, height = truck.replace({PAYLOAD: heaviest}), height_estimate(truck)
    uncertainty = Uncertainty(names=(HEIGHT, PAYLOAD), covariance=np.diag([0.0, (0.01 * heaviest) ** 2]))
    found = {e.name: e.sigma for e in derived_from_covariance(truck, vehicle, [height], uncertainty)}
    lighter = vehicle.replace({PAYLOAD: 0.99 * heaviest}).derived()
    assert values[PAYLOAD] < heaviest
    for name, sigma in found.items():
        assert sigma == pytest.approx(abs(vehicle.derived()[name] - lighter[name]), rel=0.02)


def test_both_ways_to_derived_quantities_agree_if_only_the_height_is_uncertain(truck: Vehicle) -> None:
    """Forward differences against central differences with a covariance; and the CoG height by hand, equation (8)."""
    height = height_estimate(truck)
    vehicle = truck.replace({HEIGHT: height.value})
    uncertainty = Uncertainty(names=(HEIGHT, f"{RATE}.gain"), covariance=np.diag([height.sigma**2, 1.0]))
    simple = derived_from_payload_height(vehicle, [height])
    joint = derived_from_covariance(truck, vehicle, [height], uncertainty)
    assert [e.name for e in simple] == [e.name for e in joint] == ["semitrailer.cog_height", "semitrailer.roll_inertia"]
    for one, other in zip(simple, joint, strict=True):
        assert (one.value, one.unit, one.verdict) == (other.value, other.unit, other.verdict)
        assert one.value == vehicle.derived()[one.name]
        assert one.sigma == pytest.approx(other.sigma, rel=2e-4)
        assert one.stage == other.stage == 2
        at_height = truck.replace({HEIGHT: height.initial})
        assert (one.initial, other.initial) == (at_height.derived()[one.name], truck.derived()[one.name])
        assert (one.settling_time, other.settling_time) == (4.0, None)
    trailer = truck.unit("semitrailer")
    fraction = trailer.payload.mass / (trailer.payload.mass + trailer.sprung.mass)
    assert simple[0].sigma == pytest.approx(fraction / 2 * height.sigma, rel=1e-3)  # CoG at half the payload height


def test_the_sigma_of_derived_quantities_contains_correlations(truck: Vehicle) -> None:
    """Of a body with its own CoG height and roll inertia: sqrt(g P g'), and the worst verdict that matters."""
    lumped = truck.lumped()
    names = ("semitrailer.sprung.cog_height", "semitrailer.sprung.roll_inertia", f"{RATE}.gain")
    S = np.diag([0.1, 900.0, 1.0])
    P = S @ np.array([[1, 0.6, 0.3], [0.6, 1, 0.0], [0.3, 0.0, 1]]) @ S
    rest = {"value": 1.0, "sigma": 0.1, "unit": "1", "initial": 1.0, "stage": 1}
    verdicts = zip(names[:2], (Verdict.CONVERGED, Verdict.DOUBTFUL), strict=True)
    estimates = [Estimate(name=name, verdict=verdict, **rest) for name, verdict in verdicts]
    derived = derived_from_covariance(lumped, lumped, estimates, Uncertainty(names=names, covariance=P))
    height, inertia = derived
    assert (height.name, inertia.name) == ("semitrailer.cog_height", "semitrailer.roll_inertia")
    trailer = lumped.unit("semitrailer")
    lever = trailer.sprung.cog_height - trailer.roll_axis_height
    slope = 2 * trailer.sprung.mass * lever  # the inertia is about the roll axis: J + m h^2
    assert height.sigma == pytest.approx(0.1)
    assert inertia.sigma == pytest.approx(np.sqrt((0.1 * slope) ** 2 + 900**2 + 2 * 0.6 * 0.1 * 900 * slope), rel=1e-5)
    assert (height.verdict, inertia.verdict) == (Verdict.CONVERGED, Verdict.DOUBTFUL)


def test_units_of_sensor_errors() -> None:
    names = (f"{STEER}.offset", f"{STEER}.gain", f"{STEER}.delay", "roll_rate.semitrailer.offset")
    assert [sensor_error_unit(name) for name in names] == ["rad", "1", "s", "rad/s"]
    with pytest.raises(SignalError, match="expected the name of a sensor error"):
        sensor_error_unit(STEER)
