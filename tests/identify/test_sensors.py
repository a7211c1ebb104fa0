"""A log that the truck was not identified on tells its own sensors' zeros."""

import numpy as np
import pytest

from fifthwheel.errors import SignalError
from fifthwheel.identify import OneStage, identify
from fifthwheel.identify.sensors import sensors_of
from fifthwheel.logs import Record
from fifthwheel.observe import Observer, ObserverSettings
from fifthwheel.simulate import simulate
from fifthwheel.vehicle import get

TRUCK = get("cheng_cebon_2011")
STEER, RATE = "steer.tractor.front", "yaw_rate.tractor"


@pytest.fixture(scope="module")
def known():
    return identify([simulate(TRUCK, count=2, seed=1)], TRUCK, OneStage())


def shifted(steer, rate):
    record = simulate(TRUCK, count=2, seed=2)
    record = Record(time=record.time, signals=record.signals, reference=record.reference, name="another")
    return record.with_signals({STEER: record.signals[STEER] + steer, RATE: record.signals[RATE] + rate})


def test_the_zeros_of_a_new_log_are_found_and_its_band_is_narrow_and_right(known):
    record = shifted(0.004, -0.003)
    settings, unsure = sensors_of(record, known.vehicle, known.uncertainty(record.name))
    errors = {name: unsure.covariance[i, i] ** 0.5 for i, name in enumerate(unsure.names)}
    for name, truth in ((f"{STEER}.offset", 0.004), (f"{RATE}.offset", -0.003)):
        assert abs(settings["zeros"][name] - truth) < 3 * errors[name]
        assert errors[name] < 0.003
    assert {e.name for e in known.parameters if e.verdict == "converged"} <= set(unsure.names)
    found = Observer(known.vehicle, record.signals, ObserverSettings(**settings)).batch(record, unsure)
    blind = Observer(known.vehicle, record.signals, known.observer_settings(record.name)).batch(
        record, known.uncertainty(record.name)
    )
    name = "sideslip.semitrailer"
    error = found.values[name] - record.reference[name]
    late = record.time > 2
    assert np.median(found.sigma[name][late]) < 0.5 * np.median(blind.sigma[name][late])
    assert np.mean(np.abs(error[late]) < 2 * found.sigma[name][late]) > 0.9


def test_without_knowing_the_truck_s_uncertainty_there_are_zeros_only(known):
    settings, unsure = sensors_of(shifted(0.004, 0.0), known.vehicle, None)
    assert settings["zeros"][f"{STEER}.offset"] == pytest.approx(0.004, abs=0.002)
    assert unsure is None


def test_a_log_that_cannot_tell(known):
    record = simulate(TRUCK, count=1, seed=3)
    with pytest.raises(SignalError):
        sensors_of(record.with_signals({"speed": 0 * record.time + 1.0}), known.vehicle, None)
