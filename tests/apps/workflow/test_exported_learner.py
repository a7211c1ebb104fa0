"""The learner that is exported: its signals and settings, and what it refuses."""

from dataclasses import replace

import pytest

from fifthwheel.apps.workflow.runs import exported_learner
from fifthwheel.base.errors import SignalError
from fifthwheel.estimate.identify import Identification, OneStage, identify
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import get

TRUCK = get("cheng_cebon_2011")
FIVE = OneStage(given={"others": "exact", "sensors": "exact"}, tyres="linear")


@pytest.fixture(scope="module")
def result() -> Identification:
    return identify([simulate(TRUCK, count=1, seed=1)], TRUCK, FIVE)


def test_of_an_identification(result: Identification) -> None:
    live = exported_learner(result.vehicle, None, result, min_speed=7.0, passes=2, segment=300).live
    assert {*live.setup.inputs, *live.setup.outputs} == set(result.signals)
    assert live.setup.settings == replace(FIVE, min_speed=7.0)
    assert (live.learner.relinearisation.max_passes, live.learner.relinearisation.samples) == (2, 300)


def test_a_misspelled_signal_is_refused(result: Identification) -> None:
    signals = ["speed", "steer.tractor.front", "yaw_rate.tractor", "yaw_rate.semitrailr"]
    with pytest.raises(SignalError, match=r"yaw_rate\.semitrailr: no signal that a learner .*did you mean"):
        exported_learner(TRUCK, signals, result)
