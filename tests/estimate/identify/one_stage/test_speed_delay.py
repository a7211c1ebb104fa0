"""The delay of the speed, which a CAN bus gives 50 to 150 ms late."""

import numpy as np
import pytest

import fifthwheel as fw
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import OneStage
from fifthwheel.estimate.identify.given import with_sensors
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.simulation import free_response
from fifthwheel.truck import Vehicle

DELAY = 0.15
STEER = "steer.tractor.front"


def log_with_late_speed(truck: Vehicle) -> Record:
    """Of the linear model in bends, with noise of the gyros; the speed changes by 2.4 m/s^2 at most."""
    time = np.arange(0, 40, 0.02)
    steer = sum(size * np.sin(rate * time + rate) for size, rate in ((0.02, 0.6), (0.015, 2.0), (0.01, 3.3)))
    outputs = [f"{quantity}.{unit.name}" for quantity in ("yaw_rate", "roll_rate") for unit in truck.units]
    inputs = dict.fromkeys(truck.steer_signals(), np.zeros_like(time)) | {STEER: np.asarray(steer)}
    noise = np.random.default_rng(1).normal(size=(len(time), 4))
    model, of_model = dynamics.model(truck, outputs, roll=True, braking=True), dynamics.all_parameters(truck, outputs)
    motion = {"speed": 18 + 4 * np.sin(0.6 * time), dynamics.SPEED_RATE: 2.4 * np.cos(0.6 * time)}
    _, y = free_response(model, of_model, time, inputs | motion)
    gyros = dict(zip(outputs, (y + 0.002 * noise).T, strict=True))
    speed = 18 + 4 * np.sin(0.6 * (time - DELAY))
    return Record(time=time, signals={"speed": speed, STEER: inputs[STEER]} | gyros, name="late speed")


@pytest.mark.slow
def test_it_is_estimated_and_without_it_the_estimates_are_wrong() -> None:
    """They have three times the error, and no smaller sigma. Observers do not correct it."""
    truck, truth = fw.vehicle("cheng_cebon_2011"), fw.vehicle("cheng_cebon_2011").parameters()
    known = {"others": "exact", "*_rate.*.delay": "exact"}
    settings = [OneStage(tyres="linear", given=given) for given in (known, known | {"speed.delay": "exact"})]
    results = [fw.identify([log_with_late_speed(truck)], truck, each) for each in settings]
    (delay,) = [error for error in results[0].sensors if error.name == "speed.delay"]
    assert abs(delay.value - DELAY) < 3 * delay.sigma < 0.02
    errors = [[each.value / truth[each.name] - 1 for each in result.parameters] for result in results]
    assert 3 * np.linalg.norm(errors[0]) < np.linalg.norm(errors[1])
    pairs = zip(*[result.parameters for result in results], strict=True)
    assert all(estimated.sigma < 1.05 * left_out.sigma for estimated, left_out in pairs)
    assert all(abs(each.value - truth[each.name]) < 3 * each.sigma for each in results[0].parameters)
    assert "speed.delay" not in results[0].observer_settings().sensor_errors


def test_it_may_be_stated_in_the_signal_map() -> None:
    stated = fw.SignalMap.parse('[signals.speed]\ncolumn = "v"\ndelay = "50 ms +- 10 ms"').sensors
    settings = with_sensors(fw.vehicle("cheng_cebon_2011"), OneStage(), stated)
    assert settings.given == {"speed.delay": "0.0 s +- 0.01 s"}  # the map has applied the 50 ms


def test_observers_do_not_correct_it() -> None:
    with pytest.raises(fw.SignalError, match=r"speed\.delay: an observer corrects no error of the speed"):
        fw.ObserverSettings(sensor_errors={"speed.delay": 0.1})
