"""Numbers that a vehicle file lacks, and fits of a log with other numbers."""

import numpy as np
import pytest

from fifthwheel.base.errors import VehicleError
from fifthwheel.base.pages.html import blocks
from fifthwheel.estimate.identify import OneStage, identify
from fifthwheel.estimate.identify.dataset import prepare_dataset
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.summary import summarize
from fifthwheel.model.simulate import simulate
from fifthwheel.results.diagnose import LogPrediction
from fifthwheel.results.diagnose.predictions import assumed_numbers
from fifthwheel.results.report.identification import assumed_numbers as assumed_section
from fifthwheel.results.report.vehicle import vehicle_document
from fifthwheel.truck import Vehicle, get
from tests.results.report.test_terminal import printed
from tests.truck.test_classes import TEXT

ASSUMED = Vehicle.loads(TEXT)


@pytest.fixture(scope="module")
def numbers():
    return {number.path: number for number in assumed_numbers(ASSUMED, 20.0)}


def test_every_assumed_number_has_value_source_and_effect(numbers):
    assert numbers.keys() == ASSUMED.assumed.keys()
    for path, number in numbers.items():
        assert (number.value, number.source) == (ASSUMED.parameters()[path], ASSUMED.assumed[path])
        assert (number.yaw is None) == (number.sigma is None) == path.endswith("sprung.mass")
    effects = [max(number.yaw or 0, number.roll or 0) for number in numbers.values()]
    assert effects == sorted(effects, reverse=True)
    assert effects[0] > 0.1
    assert assumed_numbers(get("cheng_cebon_2011")) == ()
    unstable = ASSUMED.replace({"tractor.drive.cornering_stiffness": 3e5})
    assert all(number.yaw is None for number in assumed_numbers(unstable, 38.0))


def test_the_effect_is_that_of_the_linear_system(numbers):
    path, rate = "tractor.front.cornering_stiffness", "yaw_rate.tractor"
    changed = ASSUMED.replace({path: ASSUMED.parameters()[path] + ASSUMED.stated[path]})
    record = simulate(ASSUMED, count=1, speed=20.0)
    steer = {name: record.signals[name] for name in ASSUMED.steer_signals()}
    before, after = (
        dynamics.linear_system(truck, 20.0, [rate]).response(record.time, steer)[rate] for truck in (ASSUMED, changed)
    )
    assert numbers[path].yaw >= 0.999 * np.sqrt(np.mean((after - before) ** 2) / np.mean(before**2))
    assert numbers[path].yaw < 1.2 * np.sqrt(np.mean((after - before) ** 2) / np.mean(before**2))


def test_the_assumed_numbers_are_shown(numbers):
    text = printed(vehicle_document(ASSUMED, summarize(ASSUMED, 20.0), list(numbers.values())))
    html = blocks([*assumed_section(ASSUMED)]).replace("<wbr/>", "")
    (note,) = [
        n for n in prepare_dataset([simulate(ASSUMED, count=1)], ASSUMED, OneStage()).notes if "are assumed" in n
    ]
    for path in ASSUMED.assumed:
        assert path in text
        assert path in html
    assert note.startswith(f"{len(ASSUMED.assumed)} numbers are not in the vehicle file")
    assert max(map(len, text.splitlines())) <= 80
    assert "The vehicle file states every number" in printed(
        vehicle_document(get("auburn_6x4"), summarize(get("auburn_6x4")), [])
    )


TRUCK = get("cheng_cebon_2011")
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
    with pytest.raises(VehicleError):
        prediction.fits({NAME: -1.0})


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
