"""The road's bank as a state of the observer."""

import json

import numpy as np
import pytest

from fifthwheel import dynamics
from fifthwheel.errors import SignalError
from fifthwheel.logs import Record
from fifthwheel.logs.noise import GYROS
from fifthwheel.observe import Observer, ObserverSettings, Status, Uncertainty
from fifthwheel.simulate import response, steer_of

from .conftest import STEER, assert_same, batched, pushed
from .exact import OUTPUTS, SPEED, TRUCK

BANK = 0.035
TOLD = ("sideslip.tractor", "sideslip.semitrailer", "roll.tractor", "roll.semitrailer", "bank.road")


def banked(bank: float, *, roll: bool = True, manoeuvre: str = "lane_changes", seed: int = 4) -> Record:
    """30 s of the linear truck on a road that leans from the first sample on."""
    outputs = [name for name in OUTPUTS if roll or not name.startswith("roll")]
    told = [name for name in TOLD if roll or not name.startswith("roll")]
    model = dynamics.model(TRUCK, (*outputs, *told), roll=roll, bank=True)
    time = np.arange(3000) / 100
    steer = steer_of(manoeuvre, TRUCK, SPEED, time, count=3, seed=seed, roll=roll)
    inputs = {"speed": np.full_like(time, SPEED), STEER: steer}
    start = np.eye(len(model.states))[model.states.index("bank.road")] * bank
    _, y = response(model, dynamics.all_parameters(TRUCK, model.outputs), time, inputs, start)
    signals, random = dict(inputs), np.random.default_rng(seed)
    for i, name in enumerate(outputs):
        variance = GYROS[name.split(".")[0]][0 if name.endswith(".tractor") else 1]
        signals[name] = y[:, i] + random.normal(size=len(time)) * np.sqrt(variance)
    reference = {name: y[:, len(outputs) + i] for i, name in enumerate(told)}
    return Record(time=time, signals=signals, reference=reference, name="banked")


def rms(error: np.ndarray) -> float:
    return float(np.sqrt(np.mean(error**2)))


@pytest.mark.parametrize("how", ["batch", "smooth"])
@pytest.mark.parametrize("manoeuvre", ["lane_changes", "random", "straight"])
def test_sideslip_on_a_bank(manoeuvre, how):
    record = banked(BANK, manoeuvre=manoeuvre)
    level, leaning = (
        getattr(Observer(TRUCK, record.signals, ObserverSettings(bank=bank)), how)(record) for bank in (None, 0.03)
    )
    assert "bank.road" not in level.values
    settled = record.time > 5
    for name in TOLD[:4]:
        before, after = ((s.values[name] - record.reference[name])[settled] for s in (level, leaning))
        assert rms(after) < 0.25 * rms(before), name
        assert rms(after / leaning.sigma[name][settled]) < 1.2, name
        assert rms(before / level.sigma[name][settled]) > 4, name
    found, sigma = leaning.values["bank.road"][settled], leaning.sigma["bank.road"][settled]
    assert np.abs((found - BANK) / sigma).max() < 4
    assert rms((found - BANK) / sigma) < 1.2
    assert found.mean() == pytest.approx(BANK, abs=0.1 * BANK)
    assert (sigma < 0.01).all()


def test_sigma_begins_as_given():
    record = banked(BANK)
    sigma = Observer(TRUCK, record.signals, ObserverSettings(bank=0.05)).batch(record).sigma["bank.road"]
    assert sigma[0] == pytest.approx(0.05)
    assert sigma[500] < 0.01


def test_the_yaw_model_knows_a_bank_too():
    record = banked(BANK, roll=False)
    o = Observer(TRUCK, record.signals, ObserverSettings(bank=0.03))
    assert o.reported[-1] == "bank.road"
    found = o.batch(record)
    late = record.time > 5
    assert rms((found.values["bank.road"] - BANK)[late]) < 0.01


def test_a_level_road_stays_level(drive):
    """A state more makes sigma larger, and errors too; none is beyond what sigma says."""
    level, leaning = (Observer(TRUCK, drive.signals, ObserverSettings(bank=bank)).batch(drive) for bank in (None, 0.03))
    assert np.abs(leaning.values["bank.road"] / leaning.sigma["bank.road"]).max() < 4
    for name, truth in drive.reference.items():
        assert np.median(leaning.sigma[name]) > np.median(level.sigma[name]), name
        assert rms((leaning.values[name] - truth) / leaning.sigma[name]) < 1.2, name


def test_push_gives_what_batch_gives_and_goes_on():
    record = banked(BANK).cut(0, 6)
    settings = ObserverSettings(bank=0.03)
    o = Observer(TRUCK, record.signals, settings)
    whole = batched(o, record)
    assert {"bank.road", "bank.road.sigma"} <= whole.keys()
    assert_same(pushed(o, record), whole)
    saved = json.loads(json.dumps(o.save()))
    Observer(TRUCK, record.signals, settings).resume(saved)
    for other in (None, 0.06):
        with pytest.raises(SignalError, match="other signals or settings"):
            Observer(TRUCK, record.signals, ObserverSettings(bank=other)).resume(saved)


def test_a_steer_zero_that_is_not_known_makes_the_bank_unknown():
    """Steer angle over bank is all that the yaw rates tell: half a milliradian of the one is degrees of the other."""
    record = banked(BANK)
    o = Observer(TRUCK, record.signals, ObserverSettings(bank=0.03))
    unsure = Uncertainty(names=(f"{STEER}.offset",), covariance=np.array([[0.0005**2]]))
    plain, found = o.batch(record), o.batch(record, unsure)
    assert (found.status == Status.OK).all()
    late = record.time > 10
    assert (found.sigma["bank.road"][late] > 5 * plain.sigma["bank.road"][late]).all()
    assert (found.sigma["sideslip.semitrailer"][late] > 5 * plain.sigma["sideslip.semitrailer"][late]).all()
    wrong = o.batch(record.with_signals({STEER: record.signals[STEER] + 0.0005}))
    for name in ("bank.road", "sideslip.semitrailer"):
        error = (wrong.values[name] - record.reference[name])[late]
        assert rms(error / found.sigma[name][late]) == pytest.approx(1, abs=0.1), name


@pytest.mark.parametrize("bank", [0.0, -0.1, 2.0, float("nan")])
def test_a_bank_that_no_road_has(bank):
    with pytest.raises(SignalError, match=r"^bank: expected between 0 and 1 rad"):
        ObserverSettings(bank=bank)


def test_only_a_model_with_the_state_shows_it():
    with pytest.raises(SignalError, match=r"^bank\.road: "):
        dynamics.model(TRUCK, ("bank.road",), roll=True)
    assert dynamics.model(TRUCK, ("bank.road",), roll=True, bank=True).outputs == ("bank.road",)
