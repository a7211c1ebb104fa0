"""One stage with a lateral accelerometer whose place, offset, gain and delay are unknown."""

from dataclasses import replace

import numpy as np
import pytest

from fifthwheel.data.channels import LATERAL_ACCELERATION
from fifthwheel.data.record import Record
from fifthwheel.data.record.derived import article_gyro_variance
from fifthwheel.estimate.identify import Identification, OneStage, identify
from fifthwheel.model.simulate import simulate
from fifthwheel.results.diagnose.cautions import identification_cautions
from fifthwheel.truck import Vehicle
from fifthwheel.truck.unit import Accelerometer

pytestmark = pytest.mark.slow

NAME = "lateral_acceleration.tractor"
EXACT = OneStage(tyres="linear", given={"others": "exact", "*_rate.*.delay": "exact", "steer.*.gain": "+- 5 %"})
"""The vehicle file and the latency of gyros are exact; all other sensor errors are estimated."""
TRUE_ERRORS = {"offset": 0.25, "gain": 1.03, "delay": 0.02, "position": -1.53, "height": 0.75}


def placed(truck: Vehicle, position: float, height: float) -> Vehicle:
    """The truck with an accelerometer on the tractor."""
    tractor, *others = truck.units
    tractor = tractor.model_copy(update={"accelerometer": Accelerometer(position=position, height=height)})
    return truck.model_copy(update={"units": (tractor, *others)})


@pytest.fixture(scope="module")
def log(truck: Vehicle) -> Record:
    """Two lane changes of the linear truck with errors of the accelerometer."""
    there = placed(truck, TRUE_ERRORS["position"], TRUE_ERRORS["height"])
    record = simulate(there, count=2, seed=3, sensors=article_gyro_variance(["tractor", "semitrailer"]) | {NAME: 1e-9})
    late = np.interp(record.time - TRUE_ERRORS["delay"], record.time, record.signals[NAME])
    noise = 0.08 * np.random.default_rng(5).normal(size=late.size)
    return record.with_signals({NAME: TRUE_ERRORS["gain"] * late + TRUE_ERRORS["offset"] + noise})


@pytest.fixture(scope="module")
def result(log: Record, guess: Vehicle) -> Identification:
    return identify([log], guess, EXACT)


def test_it_recovers_parameters_and_sensor_errors(result: Identification, truck: Vehicle) -> None:
    truth = truck.parameters()
    for e in result.parameters:
        assert e.verdict == "converged"
        assert abs(e.value - truth[e.name]) < 3 * e.sigma, e.name
    errors = {e.name.removeprefix(f"{NAME}."): e for e in result.sensors if e.name.startswith(NAME)}
    assert errors.keys() == TRUE_ERRORS.keys()
    for kind, true in TRUE_ERRORS.items():
        assert abs(errors[kind].value - true) < 3 * errors[kind].sigma, kind
    assert [errors[kind].unit for kind in TRUE_ERRORS] == ["m/s^2", "1", "s", "m", "m"]
    assert errors["position"].sigma < 0.1 * LATERAL_ACCELERATION.error("position").prior
    assert errors["delay"].sigma < 0.2 * LATERAL_ACCELERATION.error("delay").prior
    assert errors["offset"].log == "simulated"
    assert errors["gain"].log is None


def test_it_adds_information(result: Identification, log: Record, guess: Vehicle) -> None:
    gyros = replace(log, signals={name: values for name, values in log.signals.items() if name != NAME})
    without = identify([gyros], guess, EXACT)
    ratio = {e.name: e.sigma / without[e.name].sigma for e in result.parameters}
    assert all(value < 1.02 for value in ratio.values())
    assert ratio["tractor.front.cornering_stiffness"] < 0.85
    assert min(fit.explained for fit in result.fits if fit.signal == NAME) > 0.98
    settings = result.observer_settings("simulated")
    assert settings.sensor_errors[f"{NAME}.position"] == pytest.approx(TRUE_ERRORS["position"], abs=0.2)
    assert f"{NAME}.position" in result.uncertainty("simulated").names


def test_vibration_is_noise(log: Record, guess: Vehicle) -> None:
    """A channel with little besides vibration contributes little, and does not make the estimates untrustworthy."""
    vibration = 2.4 * np.random.default_rng(6).normal(size=len(log))
    result = identify([log.with_signals({NAME: log.signals[NAME] + vibration})], guess, EXACT)
    assert next(fit.explained for fit in result.fits if fit.signal == NAME) < 0.5
    assert {e.verdict for e in result.parameters} == {"converged"}
    assert not [caution for caution in identification_cautions(result) if NAME in caution.signals]


def test_an_unrelated_channel_is_the_cause_of_a_doubt(log: Record, guess: Vehicle, truck: Vehicle) -> None:
    """An error of this sensor; the other channels determine the parameters."""
    wrong = log.with_signals({NAME: 1.4 * np.sin(1.3 * log.time)})
    result = identify([wrong], guess, replace(EXACT, check=False))
    (doubt,), truth = result.doubts, truck.parameters()
    assert [cause.name.startswith(NAME) for cause in doubt.causes] == [True]
    assert {e.name for e in result.parameters if e.verdict == "doubtful"} == set(doubt.parameters) != set()
    assert all(abs(e.value - truth[e.name]) < 3 * e.sigma for e in result.parameters)
    assert any(note.startswith(f"{NAME}: the model explains") for note in result.notes)
