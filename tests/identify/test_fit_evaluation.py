"""The free-running model beside a log whose truth is known."""

from dataclasses import replace

import numpy as np
import pytest

from fifthwheel import dynamics
from fifthwheel.dynamics.simulation import linear_response
from fifthwheel.identify import TwoStage, fit_evaluation, parameters
from fifthwheel.identify.dataset import LogData, prepare_dataset
from fifthwheel.identify.fit_evaluation import evaluate_fits, free_run_fits
from fifthwheel.record import Record
from fifthwheel.simulate import simulate
from fifthwheel.vehicle import Vehicle

STEER = "steer.tractor.front"
OUTPUTS = ("yaw_rate.tractor", "yaw_rate.semitrailer", "roll_rate.semitrailer")


@pytest.fixture(scope="module")
def steered(truck: Vehicle) -> Vehicle:
    return truck.with_logged_steering({STEER}, "")


def response(steered: Vehicle, seed: int = 1, count: int = 1) -> Record:
    """Outputs of the linear model without noise, from a moving initial state."""
    record = simulate(steered, count=count, seed=seed, name=f"log {seed}")
    model = dynamics.model(steered, OUTPUTS, roll=True)
    inputs = {name: record.signals[name] for name in ("speed", STEER)}
    x0 = np.array([0.02 if name.startswith("yaw_rate") else 0.0 for name in model.states])
    _, y = linear_response(model, dynamics.all_parameters(steered, OUTPUTS), record.time, inputs, x0)
    return replace(record, signals=inputs | {name: y[:, i] for i, name in enumerate(OUTPUTS)})


def fits(steered: Vehicle, record: Record, vehicle: Vehicle | None = None, values: dict[str, float] | None = None):
    log = LogData(name=record.name, segments=[record])
    unknowns = parameters.sensor_error_unknowns(steered, OUTPUTS, TwoStage())
    model = dynamics.model(steered, OUTPUTS, roll=True)
    result = free_run_fits(model, vehicle or steered, log, unknowns, values=values or {}, identified_on=True)
    return {fit.signal: fit for fit in result}


def test_offsets_and_initial_state_are_fitted(steered: Vehicle) -> None:
    record = response(steered)
    signals = {
        STEER: record.signals[STEER] + 0.004,
        "yaw_rate.tractor": record.signals["yaw_rate.tractor"] + 0.002,
    }
    result = fits(steered, record.with_signals(signals))
    assert result.keys() == set(OUTPUTS)
    assert min(fit.explained for fit in result.values()) > 0.9999


def test_gain_and_delay_are_applied(steered: Vehicle) -> None:
    record = response(steered)
    delayed = np.interp(record.time - 0.08, record.time, record.signals[STEER]) / 1.1
    shown = record.with_signals({STEER: delayed})
    right = {f"{STEER}.gain": 1.1, f"{STEER}.delay": 0.08}
    assert min(fit.explained for fit in fits(steered, shown, values=right).values()) > 0.999
    assert max(fit.explained for fit in fits(steered, shown).values()) < 0.97


def test_outliers_and_gaps_do_not_change_the_prediction(steered: Vehicle) -> None:
    record = response(steered)
    gyro = record.signals["yaw_rate.semitrailer"].copy()
    gyro[::50] += 2.0
    gyro[200:230] = np.nan
    clean, result = fits(steered, record), fits(steered, record.with_signals({"yaw_rate.semitrailer": gyro}))
    for name in OUTPUTS:
        assert result[name].predicted == pytest.approx(clean[name].predicted, abs=2e-4)
    assert np.isnan(result["yaw_rate.semitrailer"].measured[210])


def test_blocks_and_decayed_responses_do_not_change_the_prediction(
    steered: Vehicle, monkeypatch: pytest.MonkeyPatch
) -> None:
    record = response(steered)
    signals = {"yaw_rate.tractor": record.signals["yaw_rate.tractor"] + 0.002}
    signals["yaw_rate.semitrailer"] = np.where(record.time < 1, np.nan, record.signals["yaw_rate.semitrailer"])
    whole = fits(steered, record.with_signals(signals))
    monkeypatch.setattr(fit_evaluation, "BLOCK", 97)  # the last block is shorter, and some responses end before it
    result = fits(steered, record.with_signals(signals))
    for name in OUTPUTS:
        np.testing.assert_allclose(result[name].predicted, whole[name].predicted, rtol=0, atol=1e-9)


def test_a_log_that_outlasts_the_response_to_its_initial_state(
    steered: Vehicle, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without offsets nothing else is fitted, and the last blocks have no unknown."""
    record = response(steered, count=6)
    monkeypatch.setattr(fit_evaluation, "BLOCK", 97)
    model = dynamics.model(steered, OUTPUTS, roll=True)
    log = LogData(name=record.name, segments=[record])
    result = free_run_fits(model, steered, log, [], values={}, identified_on=True)
    assert min(fit.explained for fit in result) > 0.9999


def test_a_channel_that_is_missing_or_constant_has_no_fit(steered: Vehicle) -> None:
    record = response(steered)
    zero, missing = np.zeros(len(record)), np.full(len(record), np.nan)
    result = fits(steered, record.with_signals({"yaw_rate.semitrailer": zero, "roll_rate.semitrailer": missing}))
    assert result.keys() == {"yaw_rate.tractor"}


def test_evaluation(steered: Vehicle) -> None:
    """A wrong truck is not trusted; a predicted log does not count for that, but its other speed is noted."""
    settings = TwoStage(check=False)
    record, other = response(steered), response(steered, seed=2)
    faster = other.with_signals({"speed": 1.2 * other.signals["speed"]})
    dataset = prepare_dataset([record], steered, settings, [faster])
    unknowns = parameters.sensor_error_unknowns(steered, OUTPUTS, settings)
    model = dynamics.model(steered, OUTPUTS, roll=True)
    logs = [log.with_noise(steered, OUTPUTS, {}) for log in dataset.logs]
    right = evaluate_fits(dataset, logs, model, steered, unknowns, {}, settings)
    assert right.trusted
    assert {(fit.log, fit.identified_on) for fit in right.fits} == {("log 1", True), ("log 2", False)}
    assert right.notes == (
        "log 2: speed from 106 to 106 km/h, identified at 88 to 88 km/h; the understeer may differ there.",
    )
    wrong = evaluate_fits(dataset, logs, model, steered, unknowns, {f"{STEER}.gain": -1.0}, settings)
    assert not wrong.trusted
    assert any("yaw_rate.tractor: the model explains 0% of its variance in log 1" in note for note in wrong.notes)
