"""Sensor errors of a log that was not used for the identification."""

from dataclasses import replace

import numpy as np
import pytest

from fifthwheel.base.errors import SignalError
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import OneStage, identify
from fifthwheel.estimate.identify.sensor_errors import estimate_sensor_errors
from fifthwheel.estimate.observe import Observer, ObserverSettings
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import get

TRUCK = get("cheng_cebon_2011")
STEER, RATE = "steer.tractor.front", "yaw_rate.tractor"


def shifted(steer, rate):
    record = simulate(TRUCK, count=2, seed=2)
    record = Record(time=record.time, signals=record.signals, reference=record.reference, name="new")
    return record.with_signals({STEER: record.signals[STEER] + steer, RATE: record.signals[RATE] + rate})


@pytest.mark.slow
def test_offsets_of_a_new_log_and_the_sigma_of_its_states():
    """Also without the uncertainty of the vehicle; a log that cannot be used is refused."""
    identified = identify([simulate(TRUCK, count=2, seed=1)], TRUCK, OneStage(tyres="linear"))
    record = shifted(0.004, -0.003)
    settings, uncertainty = estimate_sensor_errors(record, identified.vehicle, identified)
    errors = {name: uncertainty.covariance[i, i] ** 0.5 for i, name in enumerate(uncertainty.names)}
    for name, truth in ((f"{STEER}.offset", 0.004), (f"{RATE}.offset", -0.003)):
        assert abs(settings["sensor_errors"][name] - truth) < 3 * errors[name]
        assert errors[name] < 0.003
    assert {e.name for e in identified.parameters if e.verdict == "converged"} <= set(uncertainty.names)
    states = Observer(identified.vehicle, record.signals, ObserverSettings(**settings)).batch(record, uncertainty)
    unknown = identified.observer_settings(record.name, steer_offset=0.0)  # not estimated by the observer either
    with_old_errors = Observer(identified.vehicle, record.signals, unknown).batch(
        record, identified.uncertainty(record.name)
    )
    name = "sideslip.semitrailer"
    error = states.values[name] - record.reference[name]
    late = record.time > 2
    assert np.median(states.sigma[name][late]) < 0.5 * np.median(with_old_errors.sigma[name][late])
    assert np.mean(np.abs(error[late]) < 2 * states.sigma[name][late]) > 0.9
    certain = replace(identified, covariance=None)
    settings, uncertainty = estimate_sensor_errors(record, identified.vehicle, certain)
    assert settings["sensor_errors"][f"{STEER}.offset"] == pytest.approx(0.004, abs=0.002)
    assert uncertainty is None
    with pytest.raises(SignalError):
        estimate_sensor_errors(record.with_signals({"speed": 0 * record.time + 1.0}), identified.vehicle, identified)
