"""Sigma of measures: exact where a measure is linear, sampled where it is not."""

from dataclasses import replace

import numpy as np
import pytest

from fifthwheel.base.errors import VehicleError
from fifthwheel.estimate.observe import Uncertainty
from fifthwheel.results.assess.propagation import (
    ASSUMED,
    DRAWS,
    Neighbourhood,
    Spread,
    assumed,
    complete,
    of_identification,
    of_vehicle,
    samples,
)
from fifthwheel.results.assess.truck import HALF_TRACK, Body, Truck
from fifthwheel.truck import get

TRUCK = Truck(vehicle=get("cheng_cebon_2011"))
NAMES = ("tractor.cog", "semitrailer.cog")
P = np.array([[0.004, 0.001], [0.001, 0.009]])


def known() -> Uncertainty:
    return Uncertainty(names=NAMES, covariance=P)


def of(truck: Truck, weights: tuple[float, float]) -> float:
    values = truck.vehicle.parameters()
    return sum(w * values[name] for w, name in zip(weights, NAMES, strict=True))


def test_a_linear_measure_has_the_exact_sigma():
    weights = (2.0, -1.0)
    computed = samples(Neighbourhood(TRUCK, known()), lambda truck: {"m": of(truck, weights)})
    spread = computed.spread(lambda values: values["m"])
    assert spread is not None
    assert spread.order == "linear"
    assert spread.sigma == pytest.approx(np.sqrt(np.array(weights) @ P @ np.array(weights)))
    assert spread.interval[1] - spread.interval[0] == pytest.approx(2 * 1.6448536 * spread.sigma)


def test_the_probability_of_a_linear_margin():
    """One sigma above the threshold: 84.13 %."""
    computed = samples(Neighbourhood(TRUCK, known()), lambda truck: {"m": of(truck, (1.0, 0.0))})
    sigma, centre = np.sqrt(P[0, 0]), TRUCK.vehicle.units[0].cog
    assert computed.probability(lambda values: values["m"] - (centre - sigma)) == pytest.approx(0.8413, abs=1e-4)
    assert computed.probability(lambda values: values["m"] - centre) == pytest.approx(0.5)


def test_a_strongly_nonlinear_measure_is_sampled():
    """The square of a standard normal quantity has mean 1 and variance 2."""
    centre, sigma = TRUCK.vehicle.units[0].cog, np.sqrt(P[0, 0])
    computed = samples(
        Neighbourhood(TRUCK, known()), lambda truck: {"m": ((of(truck, (1.0, 0.0)) - centre) / sigma) ** 2}
    )
    assert len(computed.draws) == DRAWS
    spread = computed.spread(lambda values: values["m"])
    assert spread is not None
    assert spread.order == "sampled"
    assert spread.sigma == pytest.approx(np.sqrt(2), rel=0.3)
    assert computed.probability(lambda values: values["m"] - 1.0) == pytest.approx(0.317, abs=0.08)


def test_a_truck_without_a_measure_does_not_meet_its_threshold():
    """Half of the trucks refuse: the measure has no sigma, and a probability of a half."""

    def half(truck: Truck) -> dict[str, float]:
        if truck.vehicle.units[0].cog > TRUCK.vehicle.units[0].cog:
            raise VehicleError("unstable")
        return {"m": 1.0}

    computed = samples(Neighbourhood(TRUCK, known()), half)
    assert computed.spread(lambda values: values["m"]) == Spread()
    assert computed.probability(lambda values: values["m"] - 0.5) == 0.5


def test_a_vehicle_file_gives_what_it_states_and_priors_for_the_rest():
    vehicle = TRUCK.vehicle.with_stated({"semitrailer.cornering_stiffness": 1e4, "semitrailer.payload.height": 0.0})
    uncertainty = of_vehicle(vehicle)
    sigma = dict(zip(uncertainty.names, np.sqrt(np.diag(uncertainty.covariance)), strict=True))
    assert sigma["semitrailer.cornering_stiffness"] == pytest.approx(1e4)
    assert "semitrailer.payload.height" not in sigma
    front = "tractor.front.cornering_stiffness"
    assert sigma[front] == pytest.approx(ASSUMED["cornering_stiffness"] * vehicle.parameters()[front])
    assert sigma["fifth_wheel.roll_stiffness"] == pytest.approx(0.3 * 3.0e6)  # the longest end of the path
    assert sigma["tractor.mass"] > 0.02 * 7200


def test_an_exact_vehicle_has_no_uncertainty_but_the_half_track():
    exact = TRUCK.vehicle.with_stated(dict.fromkeys(TRUCK.vehicle.parameters(), 0.0))
    assert assumed(exact) == {}
    assert of_vehicle(exact).names == ()
    assert complete(of_vehicle(exact), Body(), stated={}).names == (HALF_TRACK,)
    uncertainty = complete(known(), Body(), replaced=NAMES, stated={"tractor.cog": 0.01})
    assert uncertainty.names == ("tractor.cog", HALF_TRACK)
    assert np.sqrt(np.diag(uncertainty.covariance)) == pytest.approx([0.01, 0.03])


@pytest.mark.slow
def test_an_identification_gives_its_joint_covariance(result):
    identification = result.identification
    uncertainty = of_identification(identification)
    i, j = (uncertainty.names.index(f"tractor.{group}.cornering_stiffness") for group in ("front", "drive"))
    whole = identification.covariance
    k, m = (whole.names.index(uncertainty.names[n]) for n in (i, j))
    assert uncertainty.covariance[i, j] == whole.covariance[k, m] != 0
    assert set(uncertainty.names) <= set(identification.vehicle.parameters())


def test_two_stages_have_independent_sigmas(result):
    two = replace(result.identification, covariance=None)
    uncertainty = of_identification(two)
    name = "tractor.front.cornering_stiffness"
    i = uncertainty.names.index(name)
    assert np.sqrt(uncertainty.covariance[i, i]) == pytest.approx(two[name].sigma)
    assert np.count_nonzero(uncertainty.covariance[i]) == 1


def test_body_from_texts():
    body = Body.of({"half_track": "0.93 m +- 1 %", "rear_overhang": 2.7})
    assert (body.half_track, body.half_track_sigma, body.rear_overhang) == (0.93, pytest.approx(0.0093), 2.7)
    assert Body.of({"half_track": "93 cm"}).half_track_sigma == 0.0
    for values, message in (
        ({"halftrack": 1.0}, "halftrack: no such dimension.*half_track"),
        ({"width": "2 kg"}, "width: .*kg"),
        ({"half_track": 5.0}, "half_track: expected 0.3 to 2 m"),
        ({"width": "2.5 m +- 1 %"}, "only the half track has one"),
    ):
        with pytest.raises(VehicleError, match=message):
            Body.of(values)


def test_a_vehicle_within_the_uncertainty_that_is_not_valid_does_not_count():
    """The CoG of a tractor lies between its axles, 1.03 m and 2.67 m away."""
    wide = Uncertainty(names=("tractor.cog",), covariance=[[4.0]])
    computed = samples(Neighbourhood(TRUCK, wide), lambda truck: {"m": of(truck, (1.0, 0.0))})
    assert 0.5 * DRAWS < len(computed.draws) < DRAWS
    spread = computed.spread(lambda values: values["m"])
    assert spread is not None
    assert -3.7 <= spread.interval[0] < spread.interval[1] <= 0.0
