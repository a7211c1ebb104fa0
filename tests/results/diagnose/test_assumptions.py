"""Assumed numbers of a vehicle with their effects, where a user sees them."""

import numpy as np
import pytest

from fifthwheel.base.pages.html import blocks
from fifthwheel.estimate.identify import OneStage
from fifthwheel.estimate.identify.dataset import prepare_dataset
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.summary import summarize
from fifthwheel.model.simulate import simulate
from fifthwheel.results.diagnose.predictions import assumed_numbers
from fifthwheel.results.report.identification import assumed_numbers as assumed_section
from fifthwheel.results.report.vehicle import vehicle_document
from fifthwheel.truck import Vehicle, get
from tests.results.report.test_terminal import printed
from tests.truck.test_classes import TEXT

TRUCK = Vehicle.loads(TEXT)


@pytest.fixture(scope="module")
def numbers():
    return {number.path: number for number in assumed_numbers(TRUCK, 20.0)}


def test_every_assumed_number_has_value_source_and_effect(numbers):
    assert numbers.keys() == TRUCK.assumed.keys()
    for path, number in numbers.items():
        assert (number.value, number.source) == (TRUCK.parameters()[path], TRUCK.assumed[path])
        assert (number.yaw is None) == (number.sigma is None) == path.endswith("sprung.mass")
    effects = [max(number.yaw or 0, number.roll or 0) for number in numbers.values()]
    assert effects == sorted(effects, reverse=True)
    assert effects[0] > 0.1


def test_the_effect_is_that_of_the_linear_system(numbers):
    path, rate = "tractor.front.cornering_stiffness", "yaw_rate.tractor"
    changed = TRUCK.replace({path: TRUCK.parameters()[path] + TRUCK.stated[path]})
    record = simulate(TRUCK, count=1, speed=20.0)
    steer = {name: record.signals[name] for name in TRUCK.steer_signals()}
    before, after = (
        dynamics.linear_system(truck, 20.0, [rate]).response(record.time, steer)[rate] for truck in (TRUCK, changed)
    )
    assert numbers[path].yaw >= 0.999 * np.sqrt(np.mean((after - before) ** 2) / np.mean(before**2))
    assert numbers[path].yaw < 1.2 * np.sqrt(np.mean((after - before) ** 2) / np.mean(before**2))


def test_a_vehicle_without_classes_assumes_nothing():
    assert assumed_numbers(get("cheng_cebon_2011")) == ()


def test_an_unstable_vehicle_has_no_effects():
    unstable = TRUCK.replace({"tractor.drive.cornering_stiffness": 3e5})
    assert all(number.yaw is None for number in assumed_numbers(unstable, 38.0))


def test_the_assumed_numbers_are_shown(numbers):
    text = printed(vehicle_document(TRUCK, summarize(TRUCK, 20.0), list(numbers.values())))
    html = blocks([*assumed_section(TRUCK)]).replace("<wbr/>", "")
    (note,) = [n for n in prepare_dataset([simulate(TRUCK, count=1)], TRUCK, OneStage()).notes if "are assumed" in n]
    for path in TRUCK.assumed:
        assert path in text
        assert path in html
    assert note.startswith(f"{len(TRUCK.assumed)} numbers are not in the vehicle file")
    assert max(map(len, text.splitlines())) <= 80
    assert "No number is assumed" in printed(vehicle_document(get("auburn_6x4"), summarize(get("auburn_6x4")), []))
