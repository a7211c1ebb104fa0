"""The observer that is exported: its default signals, and what it refuses."""

import pytest

from fifthwheel.apps.workflow.runs import exported_observer
from fifthwheel.base.errors import SignalError, VehicleError
from fifthwheel.base.options import ObserverOptions
from fifthwheel.estimate.identify import OneStage, identify
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import get

TRUCK = get("cheng_cebon_2011")


def test_default_signals() -> None:
    observer = exported_observer(TRUCK, options=ObserverOptions(min_speed=7.0, friction=0.3, half_track=0.92))
    assert (observer.settings.friction, observer.settings.half_track) == (0.3, 0.92)
    assert observer.inputs == ("speed", *TRUCK.steer_signals())
    assert len(observer.outputs) == 4
    assert observer.settings.min_speed == 7.0


def test_of_an_identification() -> None:
    record = simulate(TRUCK, count=1, seed=1)
    result = identify([record], TRUCK, OneStage(given={"others": "exact", "road.bank": "+- 0.03 rad"}))
    observer = exported_observer(result.vehicle, None, result)
    assert {*observer.inputs, *observer.outputs} == set(record.signals)
    assert observer.settings == result.observer_settings()
    with pytest.raises(VehicleError, match=r"auburn.*not those of the identification.*vehicle\.toml"):
        exported_observer(get("auburn_6x4"), None, result)


def test_a_misspelled_signal_is_refused() -> None:
    signals = ["speed", "steer.tractor.front", "yaw_rate.tractor", "yaw_rate.semitrailr"]
    with pytest.raises(SignalError, match=r"yaw_rate\.semitrailr: no signal that an observer .*did you mean"):
        exported_observer(TRUCK, signals)
