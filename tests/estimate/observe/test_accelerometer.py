"""An observer with a lateral accelerometer."""

import numpy as np
import pytest

from fifthwheel.data.record import Record
from fifthwheel.estimate.observe import Observer, ObserverSettings, Uncertainty
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.simulation import free_response
from fifthwheel.model.dynamics.unit_equations import BANK
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle
from tests.estimate.observe.conftest import EXACT, STEER, YAWS

NAME, SIDESLIP = "lateral_acceleration.tractor", "sideslip.tractor"


@pytest.fixture(scope="module")
def banked(truck: Vehicle, lane_changes: Record) -> Record:
    """Lane changes of the linear truck on a road with a bank of 0.03 rad."""
    outputs = (*YAWS, NAME, SIDESLIP)
    model = dynamics.model(truck, outputs, roll=True, bank=True)
    start = np.zeros(len(model.states))
    start[model.states.index(BANK)] = 0.03
    inputs = {name: lane_changes.signals.get(name, np.zeros(len(lane_changes))) for name in model.inputs}
    _, y = free_response(model, dynamics.all_parameters(truck, outputs), lane_changes.time, inputs, start)
    noise = np.random.default_rng(1).normal(size=y.shape) * [0.004, 0.004, 0.1, 0.0]
    values = dict(zip(outputs, (y + noise).T, strict=True))
    signals = {name: inputs[name] for name in ("speed", STEER)} | {name: values[name] for name in (*YAWS, NAME)}
    return Record(time=lane_changes.time, signals=signals, reference={SIDESLIP: values[SIDESLIP]})


@pytest.mark.slow
def test_it_bounds_the_sideslip_on_an_unknown_bank(truck: Vehicle, banked: Record) -> None:
    """An exact accelerometer measures the side forces of the tyres, whatever the bank; the observer assumes a level
    road."""
    rms, settings = [], ObserverSettings(noise={NAME: 0.1**2}, acceleration_offset=0.0, **EXACT)
    for signals in ((*YAWS, NAME), YAWS):
        states = Observer(truck, ("speed", STEER, *signals), settings).batch(banked)
        error = states.values[SIDESLIP] - banked.reference[SIDESLIP]
        rms.append(float(np.sqrt(np.mean(error[200:] ** 2))))
    assert rms[0] < 0.6 * rms[1]


def test_its_offset_is_estimated(truck: Vehicle) -> None:
    """An offset of 0.3 m/s^2 does not change the sideslip; an observer that takes it as exact is wrong by sigmas."""
    sensors = {**dict.fromkeys(YAWS, 0.004**2), NAME: 0.05**2}
    record = simulate(truck, count=2, seed=4, sensors=sensors)
    biased = record.with_signals({NAME: record.signals[NAME] + 0.3})
    truth = record.reference[SIDESLIP]

    def errors(log: Record, **settings: float) -> tuple[np.ndarray, np.ndarray]:
        states = Observer(truck, log.signals, ObserverSettings(noise=sensors, **EXACT, **settings)).batch(log)
        return np.abs(states.values[SIDESLIP] - truth)[100:], states.sigma[SIDESLIP][100:]

    (without, _), (estimated, sigma), (exact, small) = (
        errors(record),
        errors(biased),
        errors(biased, acceleration_offset=0.0),
    )
    assert np.abs(estimated - without).max() < 0.1 * sigma.min()
    assert (estimated < 1.645 * sigma).mean() > 0.9
    assert (exact < 1.645 * small).mean() < 0.2


@pytest.mark.slow
def test_the_offset_is_exact_or_uncertain_or_estimated(truck: Vehicle, banked: Record) -> None:
    """An uncertain offset adds to sigma only if the observer does not estimate it."""
    uncertain = Uncertainty(names=(f"{NAME}.offset",), covariance=[[0.3**2]])
    for sigma, adds in ((0.0, True), (0.3, False)):
        observer = Observer(truck, banked.signals, ObserverSettings(acceleration_offset=sigma, **EXACT))
        assert observer.outputs == (*YAWS, NAME)
        assert "roll.tractor" in observer.reported
        known, more = observer.batch(banked).sigma[SIDESLIP], observer.batch(banked, uncertain).sigma[SIDESLIP]
        assert (more > 1.05 * known).any() == adds
