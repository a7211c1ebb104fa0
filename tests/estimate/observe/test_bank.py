"""The bank of the road in the observer: considered by default, or a state."""

import json
from dataclasses import replace

import numpy as np
import pytest

from fifthwheel.base.errors import SignalError
from fifthwheel.data.channels import channel_of
from fifthwheel.data.record import Record
from fifthwheel.estimate.filters.initial_state import steady_initial_state
from fifthwheel.estimate.observe import Observer, ObserverSettings, Uncertainty, parameter_variance
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.simulation import free_response
from fifthwheel.model.manoeuvres import acceleration_course, inverse_steer
from tests.estimate.observe.conftest import EXACT, STEER, assert_same, batched, pushed
from tests.estimate.observe.exact import OUTPUTS, SPEED, TRUCK

BANK = 0.035
LEVEL = ObserverSettings(**EXACT)
ESTIMATED = ObserverSettings(estimate_bank=True, steer_offset=0.0)
REPORTED = ("sideslip.tractor", "sideslip.semitrailer", "roll.tractor", "roll.semitrailer", "bank.road")


def banked(bank: float, *, manoeuvre: str = "lane_changes", seed: int = 4) -> Record:
    """30 s of the linear vehicle on a banked road, from equilibrium."""
    model = dynamics.model(TRUCK, (*OUTPUTS, *REPORTED), roll=True, bank=True)
    time = np.arange(3000) / 100
    acceleration = acceleration_course(manoeuvre, time, speed=SPEED, count=3, seed=seed)
    steer = inverse_steer(TRUCK, SPEED, time, acceleration, roll=True)
    inputs = {"speed": np.full_like(time, SPEED), STEER: steer}
    first = {name: float(values[0]) for name, values in inputs.items()}
    start = np.append(steady_initial_state(TRUCK, first, {}, roll=True, bank=bank)[0], bank)
    _, y = free_response(model, dynamics.all_parameters(TRUCK, model.outputs), time, inputs, start)
    signals, random = dict(inputs), np.random.default_rng(seed)
    for i, name in enumerate(OUTPUTS):
        variance = channel_of(name).noise[0 if name.endswith(".tractor") else 1]
        signals[name] = y[:, i] + random.normal(size=len(time)) * np.sqrt(variance)
    reference = {name: y[:, len(OUTPUTS) + i] for i, name in enumerate(REPORTED)}
    return Record(time=time, signals=signals, reference=reference, name="banked")


def rms(error: np.ndarray) -> float:
    return float(np.sqrt(np.mean(error**2)))


@pytest.mark.parametrize("manoeuvre", ["lane_changes", "straight"])
def test_sideslip_on_a_banked_road(manoeuvre):
    record = banked(BANK, manoeuvre=manoeuvre)
    level, banked_road = (Observer(TRUCK, record.signals, settings).batch(record) for settings in (LEVEL, ESTIMATED))
    assert "bank.road" not in level.values
    settled = record.time > 5
    for name in REPORTED[:4]:
        without_bank, with_bank = ((s.values[name] - record.reference[name])[settled] for s in (level, banked_road))
        assert rms(with_bank) < 0.25 * rms(without_bank), name
        assert rms(with_bank / banked_road.sigma[name][settled]) < 1.2, name
        assert rms(without_bank / level.sigma[name][settled]) > 4, name
    actual, sigma = banked_road.values["bank.road"][settled], banked_road.sigma["bank.road"][settled]
    assert np.abs((actual - BANK) / sigma).max() < 4
    assert rms((actual - BANK) / sigma) < 1.2
    assert actual.mean() == pytest.approx(BANK, abs=0.1 * BANK)
    assert (sigma < 0.01).all()


def test_first_sigma_is_the_prior():
    record = banked(BANK)
    sigma = Observer(TRUCK, record.signals, replace(ESTIMATED, bank=0.05)).batch(record).sigma["bank.road"]
    assert sigma[0] == pytest.approx(0.05, rel=1e-3)  # after the first sample, which hardly informs of the bank
    assert sigma[500] < 0.01


def test_push_equals_batch_and_resumes():
    record = banked(BANK).cut(0, 6)
    o = Observer(TRUCK, record.signals, ESTIMATED)
    batch_result = batched(o, record)
    assert {"bank.road", "bank.road.sigma"} <= batch_result.keys()
    assert_same(pushed(o, record), batch_result)
    saved = json.loads(json.dumps(o.save()))
    Observer(TRUCK, record.signals, ESTIMATED).resume(saved)
    for other in (LEVEL, replace(ESTIMATED, bank=0.06)):
        with pytest.raises(SignalError, match="expected one of the same vehicle"):
            Observer(TRUCK, record.signals, other).resume(saved)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["batch", "smooth"])
def test_sigma_contains_the_bank_by_default(method):
    """The bank is not visible: its error is that of a level road, one standard deviation here."""
    record = banked(0.03, manoeuvre="straight")
    o = Observer(TRUCK, record.signals, ObserverSettings(steer_offset=0.0))
    actual, level = (getattr(each, method)(record) for each in (o, Observer(TRUCK, record.signals, LEVEL)))
    settled = record.time > 5
    for name in record.reference:
        if name != "bank.road":
            error = (actual.values[name] - record.reference[name])[settled]
            expected = np.sqrt(np.mean(error) ** 2 + level.sigma[name][settled] ** 2)
            np.testing.assert_allclose(actual.sigma[name][settled], expected, rtol=0.05, err_msg=name)
            np.testing.assert_allclose(actual.values[name], level.values[name], rtol=0, atol=1e-12)


def test_the_considered_bank_equals_an_uncertain_parameter(monkeypatch):
    """The filter propagates its effect like `parameter_variance` that of any parameter, if it computes all rows."""
    monkeypatch.setattr(parameter_variance, "SPACING", 0.0)
    record = banked(0.03, manoeuvre="random").cut(0, 10)
    considered = Observer(TRUCK, record.signals, ObserverSettings(gate=1e6)).batch(record)
    uncertain = Uncertainty(names=("bank.road",), covariance=np.array([[0.03**2]]))
    expected = Observer(TRUCK, record.signals, ObserverSettings(gate=1e6, bank=0.0)).batch(record, uncertain)
    for name, sigma in expected.sigma.items():
        np.testing.assert_allclose(considered.values[name], expected.values[name], rtol=0, atol=1e-12)
        np.testing.assert_allclose(considered.sigma[name], sigma, rtol=1e-6, err_msg=name)


@pytest.mark.slow
def test_the_known_bank_of_a_log():
    """Its mean corrects the states, and its sigma, correlated with the steering offset, replaces the prior."""
    record = banked(0.03)
    o = Observer(TRUCK, record.signals, ObserverSettings(bank_mean=0.03, steer_offset=0.0))
    names = (f"{STEER}.offset", "bank.road")
    known, correlated = (
        Uncertainty(names=names, covariance=np.outer(sigma, sigma) * [[1, r], [r, 1]])
        for sigma, r in ((np.array([1e-9, 1e-6]), 0.0), (np.array([1e-4, 0.02]), 0.999))
    )
    actual, prior, joint = (o.batch(record, u) for u in (known, None, correlated))
    for name in REPORTED[:4]:
        error = (actual.values[name] - record.reference[name])[record.time > 5]
        assert rms(error / actual.sigma[name][record.time > 5]) < 1.2, name
        assert np.median(actual.sigma[name]) < 0.3 * np.median(prior.sigma[name]), name
        assert np.median(joint.sigma[name]) < np.median(prior.sigma[name]), name
        np.testing.assert_array_equal(actual.values[name], prior.values[name])


def test_the_offset_of_the_steering_is_estimated():
    """By default; as a known error that is wrong it would bias the sideslip."""
    record = banked(0.0, manoeuvre="random")
    wrong = record.with_signals({STEER: record.signals[STEER] + 0.01})
    o, exact = Observer(TRUCK, record.signals), Observer(TRUCK, record.signals, ObserverSettings(steer_offset=0.0))
    assert_same(pushed(o, wrong.cut(0, 5)), batched(o, wrong.cut(0, 5)))
    settled = record.time > 5
    for name in ("sideslip.tractor", "sideslip.semitrailer"):
        estimated, fixed = ((each.batch(wrong).values[name] - record.reference[name])[settled] for each in (o, exact))
        assert rms(estimated) < 0.1 * rms(fixed), name
