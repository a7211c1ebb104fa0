"""Identification, states, saved results and C with own equations of the steering, those of the example."""

import pickle
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fifthwheel.apps.cheng_cebon_2011 import TwoStage
from fifthwheel.base.errors import SignalError, VehicleError
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import Identification, OneStage, identify
from fifthwheel.estimate.identify.setup import Setup
from fifthwheel.estimate.identify.unknowns.unknown import Unknown
from fifthwheel.estimate.identify.verdict import Verdict
from fifthwheel.estimate.observe import Observer, ObserverSettings
from fifthwheel.estimate.online import Learner
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics import linear_system
from fifthwheel.model.dynamics.simulation import free_response
from fifthwheel.model.plant import Plant, Properties
from fifthwheel.model.simulate import simulate
from fifthwheel.results.assess.assessment import assess
from fifthwheel.results.report import write_report
from fifthwheel.truck import Vehicle, get

sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "examples"))
from actuator_lag import GYROS, LAG, REAR, simulated, steered, with_lag

pytestmark = pytest.mark.slow

TRUCK = steered(get("cheng_cebon_2011"))
TRUE = with_lag(TRUCK, f"{LAG} s")
STATE, PATH, SIDESLIP = "actuator.semitrailer", "steering.lag", "sideslip.semitrailer"
STIFFNESSES = [name for name in TRUCK.parameters() if name.endswith("cornering_stiffness")]
EXACT = OneStage(tyres="linear", given={"others": "exact", "sensors": "exact"}, check=False)
"""Everything but the estimated parameters and the noise is known."""


def roll_steer(steer, states, motion, p):
    return {REAR: p["coefficient"] * motion["roll.semitrailer"]}, {}


@pytest.fixture(scope="module")
def record() -> Record:
    return simulated(TRUE)


@pytest.fixture(scope="module")
def guess() -> Vehicle:
    return TRUCK.replace({name: 0.85 * TRUCK.parameters()[name] for name in STIFFNESSES})


@pytest.fixture(scope="module")
def own(record: Record, guess: Vehicle) -> Identification:
    return identify([record], with_lag(guess, "0.1 s +- 0.05 s"), EXACT)


def errors(result: Identification) -> dict[str, float]:
    """Error of each estimate over its sigma."""
    return {e.name: (e.value - TRUE.parameters()[e.name]) / e.sigma for e in result.parameters}


def test_the_lag_is_estimated_and_without_it_the_stiffnesses_are_wrong(
    own: Identification, record: Record, guess: Vehicle
) -> None:
    assert all(abs(error) < 3 for error in errors(own).values()), errors(own)
    assert own[PATH].sigma < 0.05 * LAG
    assert own[PATH].verdict is Verdict.CONVERGED
    assert (own[PATH].unit, own[PATH].prior) == ("s", pytest.approx(0.05))
    assert own.vehicle.parameters()[PATH] == own[PATH].value
    without = identify([record], guess, EXACT)
    wrong = errors(without)
    assert max(abs(wrong[name]) for name in STIFFNESSES) > 5
    assert own.log_likelihood > without.log_likelihood + 100


def test_the_prior_is_as_stated() -> None:
    """Normal of a number that may be negative; none without a sigma."""

    def unknowns(truck: Vehicle) -> dict[str, Unknown]:
        return {u.name: u for u in Setup.of(truck, GYROS, EXACT).unknowns}

    for text, logarithmic, centre, scale in (("0 +- 0.1", False, 0.0, 0.1), ("-0.05 +- 0.1", False, -0.05, 0.1)):
        u = unknowns(TRUCK.with_steering(roll_steer, parameters={"coefficient": text}))["steering.coefficient"]
        assert (u.logarithmic, u.centre, u.scale) == (logarithmic, centre, scale)
    truck = TRUCK.with_steering(roll_steer, parameters={"coefficient": "0.05 +- 0.01"})
    assert unknowns(truck)["steering.coefficient"].logarithmic
    assert PATH not in unknowns(with_lag(TRUCK, f"{LAG} s"))


def test_a_saved_result_has_the_equations(own: Identification, record: Record, tmp_path: Path) -> None:
    own.save(tmp_path)
    assert Identification.load(tmp_path) == own
    assert Vehicle.load(tmp_path / "vehicle.toml") == own.vehicle
    assert pickle.loads(pickle.dumps(own)) == own
    write_report(tmp_path / "report.html", own, [record], [own.observer().batch(record)], title="lag")
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "Steering, lag" in text
    assert "Model: yaw and roll, own steering actuator_lag:actuator." in text
    assert "yaw and roll, own steering actuator_lag:actuator" in own.summary()
    file = tmp_path / "identification.json"
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace('"actuator_lag:actuator"', '"elsewhere:actuator"'), encoding="utf-8")
    with pytest.raises(SignalError, match=r"json: equations: expected .* elsewhere:actuator, .* import elsewhere"):
        Identification.load(tmp_path)


def test_an_observer_gives_the_own_state_with_sigma(own: Identification, record: Record) -> None:
    """The true angle is the filtered command. The first angle is uncertain, and forgotten after a second."""
    alpha, angle = np.exp(-(record.rate**-1) / LAG), np.zeros(len(record))
    command = record.signals[REAR]
    for k in range(1, len(record)):
        angle[k] = alpha * angle[k - 1] + (1 - alpha) * (command[k] + command[k - 1]) / 2
    observer = own.observer()
    states = observer.batch(record, own.uncertainty())
    error, known = states.values[STATE] - angle, record.time > 1
    assert np.sqrt(np.mean((error / states.sigma[STATE])[known & (np.abs(angle) > 1e-4)] ** 2)) < 2
    assert np.abs(error[known]).max() < 0.02 * np.abs(angle).max()
    (slip,) = free_response(
        dynamics.model(TRUE, [SIDESLIP], roll=True),
        dynamics.all_parameters(TRUE, [SIDESLIP]),
        record.time,
        record.signals,
    )[1].T
    plain = Observer(TRUCK, record.signals, own.observer_settings()).batch(record)
    of_own, of_plain = (np.std((s.values[SIDESLIP] - slip)[known]) for s in (states, plain))
    assert of_own < 0.3 * of_plain
    pushed = [
        observer.push({"time": t} | {n: v[k] for n, v in record.signals.items()}) for k, t in enumerate(record.time)
    ]
    filtered = observer.batch(record)
    assert [answer[STATE] for answer in pushed] == filtered.values[STATE].tolist()
    assert states.plot(STATE).panels[0].y.unit == "deg"
    assert np.abs(observer.smooth(record).values[STATE] - angle)[known].max() < 0.02 * np.abs(angle).max()


def test_a_learner_has_the_own_equations(record: Record) -> None:
    learner = Learner(with_lag(TRUCK, "0.1 s +- 0.05 s"), record.signals, replace(EXACT, given={"others": "exact"}))
    for k, time in enumerate(record.time):
        learner.push({"time": time} | {name: values[k] for name, values in record.signals.items()})
    lag = next(e for e in learner.parameters if e.name == PATH)
    assert abs(lag.value - LAG) < 2 * lag.sigma < 2 * 0.05
    assert STATE in learner.reported


def test_what_cannot_use_the_equations_refuses_them(record: Record) -> None:
    truck = TRUCK.with_steering(roll_steer, parameters={"coefficient": "0.1"})
    signals = ("speed", *truck.steer_signals(), "yaw_rate.tractor")
    assert not Observer(TRUCK, signals).roll
    assert Observer(truck, signals).roll
    with pytest.raises(VehicleError, match="steering: its equations use roll; use roll=True"):
        Observer(truck, signals, ObserverSettings(roll=False))
    for use in (lambda: simulate(truck, roll=False), lambda: linear_system(truck, 20.0, roll=False)):
        with pytest.raises(VehicleError, match="steering: its equations use roll; use roll=True"):
            use()
    for place, use in {
        "the nonlinear truck": lambda: Plant(vehicle=TRUE, properties=Properties()),
        "assess": lambda: assess(TRUE),
        "the identification in two stages": lambda: identify([record], TRUE, TwoStage()),
    }.items():
        with pytest.raises(VehicleError, match=f"steering: {place} cannot model own equations"):
            use()
