"""Predicted against measured with changed numbers of the vehicle."""

import numpy as np
import pytest

from fifthwheel import truck as vehicle
from fifthwheel.base.errors import VehicleError
from fifthwheel.estimate.identify import OneStage, identify
from fifthwheel.model.simulate import simulate
from fifthwheel.results.diagnose import LogPrediction

TRUCK = vehicle.get("cheng_cebon_2011")
NAME = "semitrailer.cornering_stiffness"


@pytest.fixture(scope="module")
def record():
    return simulate(TRUCK, count=2, seed=1)


def explained(fits):
    return {fit.signal: fit.explained for fit in fits}


def test_the_true_numbers_predict_best(record):
    prediction = LogPrediction.of(record, TRUCK)
    true, wrong = (explained(prediction.fits(values)) for values in ({}, {NAME: 0.5 * TRUCK.parameters()[NAME]}))
    assert all(true[name] > wrong[name] for name in true)
    assert true["yaw_rate.semitrailer"] > 0.98


def test_the_predictions_are_those_of_an_identification_with_linear_tyres(result):
    """Compared with the fits that the identification of the same log has stored, without softening of the tyres."""
    log = result.records[0]
    given = {"others": "exact", "road.bank": "+- 0.03 rad"}
    identification = identify([log], TRUCK, OneStage(tyres="linear", given=given))
    found = LogPrediction.of(log, identification.vehicle, identification).fits()
    stored = [fit for fit in identification.fits if fit.log == log.name]
    assert [fit.signal for fit in found] == [fit.signal for fit in stored]
    for ours, theirs in zip(found, stored, strict=True):
        scatter = np.nanstd(theirs.measured - theirs.predicted)
        assert np.sqrt(np.mean((ours.predicted - theirs.predicted) ** 2)) < 0.1 * scatter


def test_an_impossible_number_is_refused(record):
    with pytest.raises(VehicleError):
        LogPrediction.of(record, TRUCK).fits({NAME: -1.0})
