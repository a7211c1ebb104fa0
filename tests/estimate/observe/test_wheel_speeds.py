"""An observer with wheel speeds of a trailer axle."""

import numpy as np
import pytest

from fifthwheel.data.record import Record
from fifthwheel.estimate.observe import Observer, ObserverSettings, States
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle
from tests.estimate.observe.conftest import EXACT, STEER, YAWS, assert_same, batched, pushed

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
    """The difference itself is a signal too: an exported observer gets it."""
    log = wheel_speeds(record).cut(stop=float(record.time[0]) + 6.0)
    observer, of_difference = Observer(truck, log.signals), Observer(truck, record.signals)
    assert observer.outputs == (YAW, DIFFERENCE)
    assert observer.signals == ("speed", STEER, YAW, *WHEELS)
    assert of_difference.signals == of_difference.inputs + of_difference.outputs == ("speed", STEER, YAW, DIFFERENCE)
    one_by_one = pushed(observer, log)
    assert_same(one_by_one, batched(observer, log))
    np.testing.assert_array_equal(pushed(of_difference, log)[YAWS[1]], one_by_one[YAWS[1]])


@pytest.mark.slow
def test_it_informs_of_the_trailer_with_and_without_a_difference_of_the_rolling_radii(
    truck: Vehicle, record: Record
) -> None:
    """0.4 % has no effect on the yaw rate of the trailer; an observer that takes it as 0 is wrong by sigmas."""
    name, straight, different = YAWS[1], wheel_speeds(record), wheel_speeds(record, 0.004)
    absent = straight.with_signals({wheel: np.full(len(record), np.nan) for wheel in WHEELS})

    def states(log: Record, offset: float) -> States:
        settings = ObserverSettings(noise=NOISE, wheel_speed_offset=offset, **EXACT)
        return Observer(truck, log.signals, settings).smooth(log)

    without, estimated, exact = states(straight, 0.005), states(different, 0.005), states(different, 0.0)
    sigma = without.sigma[name][100:]
    assert np.abs(estimated.values[name] - without.values[name])[100:].max() < 0.2 * sigma.min()
    assert np.abs(exact.values[name] - without.values[name])[100:].max() > 2 * sigma.max()
    known, alone = (np.mean(states(log, 0.0).sigma[name][100:]) for log in (straight, absent))
    assert known < 0.9 * alone
