"""The wheelbase of a trailer as a result, where the logs determine it."""

import re
from dataclasses import replace

import numpy as np
import pytest

from fifthwheel.estimate.identify import OneStage, Verdict, identify
from fifthwheel.estimate.identify.estimates import wheelbases
from fifthwheel.estimate.observe.uncertainty import Uncertainty
from fifthwheel.model.manoeuvres import lane_changes, slow_turns
from fifthwheel.model.plant import Plant, article_sensors
from fifthwheel.results.assess.propagation import of_vehicle
from fifthwheel.results.report import conclude_identification
from fifthwheel.truck import Vehicle, get

TRUCK = get("cheng_cebon_2011")
AXLES = [f"semitrailer.{axle}.position" for axle in ("front", "middle", "rear")]
WRONG = TRUCK.replace({path: TRUCK.parameters()[path] + 0.3 for path in AXLES})


def test_sigma_is_that_of_the_axles_and_the_kingpin() -> None:
    names = (*AXLES, "fifth_wheel.trailing_position")
    covariance = np.diag([0.0, 0.0, 0.0, 0.02**2]) + np.outer([0.1, 0.1, 0.1, 0], [0.1, 0.1, 0.1, 0])
    known = Uncertainty(names=names, covariance=covariance)
    (result,) = wheelbases(WRONG, TRUCK, known, {"semitrailer.axle_positions": 0.3})
    assert (result.name, result.verdict, result.unit) == ("semitrailer.wheelbase", Verdict.CONVERGED, "m")
    assert result.value == pytest.approx(8.0)
    assert result.initial == pytest.approx(7.7)
    assert result.sigma == pytest.approx(np.hypot(0.1, 0.02))
    assert wheelbases(WRONG, TRUCK, known, {"semitrailer.axle_positions": 0.6}) == []
    assert wheelbases(WRONG, TRUCK, known, {}) == []


def wheelbase_sigma(known: Uncertainty) -> float:
    row = np.array([-1 / 3 * (name in AXLES) for name in known.names])
    return float(np.sqrt(row @ known.covariance @ row))


@pytest.mark.slow
def test_slow_turns_determine_it() -> None:
    """A file that is 0.3 m wrong; without the turns the lane change leaves more than half of the stated sigma. Read
    again, the file of the result gives the wheelbase its sigma; what is exact or not stated remains so."""
    stated = WRONG.with_stated(dict.fromkeys(AXLES, 0.4) | {"tractor.cog": 0.05, "tractor.mass": 0.0})
    courses = {"lane change": lane_changes(count=1, speed=80 / 3.6), "turns": slow_turns()}
    records = [
        replace(Plant(TRUCK).drive(course).record(article_sensors(TRUCK), seed=i), name=name)
        for i, (name, course) in enumerate(courses.items())
    ]
    result = identify(records, stated, OneStage())
    change = r"The wheelbase of the trailer is 0\.[23]\d* m longer than in the vehicle file \(\d[.\d]* sigma\)\."
    assert re.search(change, conclude_identification(result).headline)
    wheelbase = result["semitrailer.wheelbase"]
    assert wheelbase.sigma < 0.011 * wheelbase.value
    assert abs(wheelbase.value - 8.0) < 2.5 * wheelbase.sigma
    assert wheelbase.initial == pytest.approx(7.7)
    assert all(e.verdict is Verdict.CONVERGED for e in result.parameters)
    again = Vehicle.loads(result.vehicle.to_toml())
    assert again.stated.keys() == stated.stated.keys()
    assert again.stated["tractor.mass"] == 0.0
    found = wheelbase_sigma(of_vehicle(again))
    assert found == pytest.approx(wheelbase_sigma(result.covariance), rel=6e-3)  # three digits
