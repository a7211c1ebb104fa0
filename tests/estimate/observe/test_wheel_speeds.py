"""An observer with wheel speeds of a trailer axle."""

import numpy as np
import pytest

from fifthwheel.data.record import Record
from fifthwheel.estimate.observe import Observer, ObserverSettings, States
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle
from tests.estimate.observe.conftest import EXACT, STEER, YAWS, batched, pushed

DIFFERENCE, YAW = "wheel_speed_difference.semitrailer", YAWS[0]
WHEELS = ("wheel_speed.semitrailer.left", "wheel_speed.semitrailer.right")
NOISE = {YAW: 0.004**2, DIFFERENCE: 0.001**2}


def wheel_speeds(record: Record, offset: float = 0.0) -> Record:
    """The record with wheel speeds, 20 a second, in place of their difference; `offset` is added to the difference."""
    difference = record.signals[DIFFERENCE] + offset
    difference[np.arange(len(record)) % 5 > 0] = np.nan
    signals = {name: record.signals[name] for name in ("speed", STEER, YAW)}
    signals |= {
        name: signals["speed"] * (1 + sign * difference / 2) for name, sign in zip(WHEELS, (-1, 1), strict=True)
    }
    return Record(time=record.time, signals=signals, reference=record.reference)


@pytest.fixture(scope="module")
def record(truck: Vehicle) -> Record:
    return simulate(truck, count=2, seed=4, sensors=NOISE)


@pytest.mark.slow
def test_it_forms_the_difference_and_pushes_as_in_a_batch(truck: Vehicle, record: Record) -> None:
    log = wheel_speeds(record)
    observer = Observer(truck, log.signals)
    assert observer.outputs == (YAW, DIFFERENCE)
    assert observer.signals == ("speed", STEER, YAW, *WHEELS)
    one_by_one, together = pushed(observer, log), batched(observer, log)
    for name, values in one_by_one.items():
        np.testing.assert_array_equal(values, together[name], err_msg=name)


@pytest.mark.slow
def test_the_difference_itself_is_a_signal(truck: Vehicle, record: Record) -> None:
    """An exported observer gets it."""
    observer = Observer(truck, record.signals)
    assert observer.signals == observer.inputs + observer.outputs == ("speed", STEER, YAW, DIFFERENCE)
    log = wheel_speeds(record).cut(stop=float(record.time[0]) + 1.0)
    formed, given = (pushed(Observer(truck, signals), log)[YAWS[1]] for signals in (log.signals, record.signals))
    np.testing.assert_array_equal(formed, given)


def states(truck: Vehicle, log: Record, **settings: float) -> States:
    return Observer(truck, log.signals, ObserverSettings(noise=NOISE, **EXACT, **settings)).smooth(log)


@pytest.mark.slow
def test_a_difference_of_the_rolling_radii_is_estimated(truck: Vehicle, record: Record) -> None:
    """0.4 % has no effect on the yaw rate of the trailer; an observer that takes it as 0 is wrong by sigmas."""
    name, straight, different = YAWS[1], wheel_speeds(record), wheel_speeds(record, 0.004)
    without, estimated, exact = (
        states(truck, log, wheel_speed_offset=sigma)
        for log, sigma in ((straight, 0.005), (different, 0.005), (different, 0.0))
    )
    sigma = without.sigma[name][100:]
    assert np.abs(estimated.values[name] - without.values[name])[100:].max() < 0.2 * sigma.min()
    assert np.abs(exact.values[name] - without.values[name])[100:].max() > 2 * sigma.max()


@pytest.mark.slow
def test_it_adds_information_on_the_trailer(truck: Vehicle, record: Record) -> None:
    log = wheel_speeds(record)
    fewer = Record(time=log.time, signals={name: log.signals[name] for name in ("speed", STEER, YAW)})
    noise = {"noise": {YAW: NOISE[YAW]}}
    known = states(truck, log, wheel_speed_offset=0.0)
    alone = Observer(truck, fewer.signals, ObserverSettings(**noise, **EXACT)).smooth(fewer)
    assert np.mean(known.sigma[YAWS[1]][100:]) < 0.9 * np.mean(alone.sigma[YAWS[1]][100:])
