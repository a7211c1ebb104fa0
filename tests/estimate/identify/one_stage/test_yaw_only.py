"""One stage with `roll=False`: the yaw model, without the signals that contain roll."""

import re
from dataclasses import replace

import numpy as np
import pytest

from fifthwheel.base.errors import SignalError, VehicleError
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import Identification, OneStage, identify
from fifthwheel.estimate.identify.given import applied
from fifthwheel.estimate.observe import Observer, ObserverSettings
from fifthwheel.estimate.online import Learner
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import get

TRUCK = get("cheng_cebon_2011")
YAW = OneStage(roll=False, tyres="linear", given={"others": "exact", "sensors": "exact"})
HEIGHT = "semitrailer.payload.height"


@pytest.fixture(scope="module")
def record() -> Record:
    """Two lane changes of a truck without roll, with roll rates of noise."""
    record = simulate(TRUCK, count=2, roll=False)
    noise = np.random.default_rng(0).normal(0, 0.01, len(record))
    return replace(record, signals=dict(record.signals) | {"roll_rate.semitrailer": noise})


@pytest.fixture(scope="module")
def result(record: Record) -> Identification:
    guess = {n: 0.85 * v for n, v in TRUCK.parameters().items() if n.endswith("cornering_stiffness")}
    return identify([record], TRUCK.replace(guess), YAW)


@pytest.mark.slow
def test_the_parameters_of_a_truck_without_roll(result: Identification) -> None:
    names = [e.name for e in result.parameters]
    assert HEIGHT not in names
    assert "semitrailer.yaw_inertia" in names
    assert all(abs(e.value - TRUCK.parameters()[e.name]) < 3 * e.sigma < 0.2 * e.value for e in result.parameters)
    assert result.vehicle.parameters()[HEIGHT] == TRUCK.parameters()[HEIGHT]


def test_the_result_says_which_model_it_is(result: Identification, record: Record) -> None:
    assert not result.models_roll
    assert "one-stage method, yaw only" in result.summary()
    assert "roll_rate.semitrailer is not used, because roll=False." in result.notes
    assert "roll_rate.semitrailer" not in result.signals
    assert not result.observer(record.signals).roll
    assert replace(result, settings=replace(YAW, roll=True)).models_roll


def test_an_observer_without_roll_has_the_yaw_model(record: Record) -> None:
    signals = [*record.signals, "lateral_acceleration.tractor"]
    yaw, both = (Observer(TRUCK, signals, ObserverSettings(roll=roll)) for roll in (False, True))
    assert (yaw.roll, both.roll) == (False, True)
    assert set(both.signals) - set(yaw.signals) == {"roll_rate.semitrailer", "lateral_acceleration.tractor"}
    assert not any(name.startswith("roll") for name in yaw.reported)
    same = Observer(TRUCK, [name for name in signals if not name.startswith(("roll", "lateral"))])
    states = [observer.batch(record).values["sideslip.semitrailer"] for observer in (yaw, same)]
    assert (states[0] == states[1]).all()
    with pytest.raises(SignalError, match="an observer needs at least one yaw rate"):
        Observer(TRUCK, ["speed", "steer.tractor.front", "roll_rate.tractor"], ObserverSettings(roll=False))


@pytest.mark.parametrize(
    ("name", "text"),
    [(HEIGHT, "free"), ("payload.height", "+- 20 %"), ("semitrailer.sprung.cog_height", "1.5 m +- 0.2 m")],
)
def test_contradictions_are_refused_with_name_and_cure(name: str, text: str) -> None:
    expected = "expected a number of the yaw motion, because roll=False; remove it, or use roll=True"
    with pytest.raises(VehicleError, match=re.escape(f"{name}={text}: {expected}")):
        applied(TRUCK, OneStage(roll=False, tyres="linear", given={name: text}))


def test_what_would_be_dropped_is_refused() -> None:
    with pytest.raises(SignalError, match=r"uniform_payload: expected the default, .*; remove it, or use roll=True"):
        OneStage(roll=False, uniform_payload=False)


@pytest.mark.slow
def test_earlier_logs_may_have_had_roll(record: Record, result: Identification) -> None:
    log = simulate(TRUCK, count=1, seed=2)
    both = identify([log], TRUCK, replace(YAW, roll=True))
    yaw = identify([record], TRUCK, YAW, knowledge=both.knowledge)
    name = "tractor.drive.cornering_stiffness"
    assert yaw[name].sigma < result[name].sigma
    assert identify([log], TRUCK, replace(YAW, roll=True), knowledge=result.knowledge)[HEIGHT].sigma < 0.5


def test_a_learner_models_roll(record: Record) -> None:
    with pytest.raises(SignalError, match="roll: expected True, because a learner models roll, got False"):
        Learner(TRUCK, record.signals, YAW)


def test_only_roll_rates_and_accelerations_inform_nothing(record: Record) -> None:
    only = {name: values for name, values in record.signals.items() if not name.startswith(("yaw", "artic"))}
    only["lateral_acceleration.tractor"] = np.zeros(len(record))
    with pytest.raises(SignalError, match=r"yaw_rate\.tractor: in none of the logs"):
        identify([replace(record, signals=only)], TRUCK, replace(YAW, check=False))
