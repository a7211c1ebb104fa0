"""One stage with `roll=False`: the yaw model, without the signals that contain roll."""

import re
from dataclasses import replace

import numpy as np
import pytest

from fifthwheel.base.errors import SignalError, VehicleError
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import Identification, OneStage, identify
from fifthwheel.estimate.identify.doubts import DoubtKind
from fifthwheel.estimate.identify.given import applied
from fifthwheel.estimate.observe import Observer, ObserverSettings
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
def test_a_truck_without_roll(result: Identification, record: Record) -> None:
    """Its parameters, its result, and a log that follows one with roll."""
    names = [e.name for e in result.parameters]
    assert HEIGHT not in names
    assert "semitrailer.yaw_inertia" in names
    assert all(abs(e.value - TRUCK.parameters()[e.name]) < 3 * e.sigma < 0.2 * e.value for e in result.parameters)
    assert result.vehicle.parameters()[HEIGHT] == TRUCK.parameters()[HEIGHT]
    assert not result.models_roll
    assert "one-stage method, yaw only" in result.summary()
    assert "roll_rate.semitrailer is not used, because roll=False." in result.notes
    assert "roll_rate.semitrailer" not in result.signals
    assert not result.observer(record.signals).roll
    assert replace(result, settings=replace(YAW, roll=True)).models_roll
    both = identify([simulate(TRUCK, count=1, seed=2)], TRUCK, replace(YAW, roll=True))
    yaw = identify([record], TRUCK, YAW, knowledge=both.knowledge)
    name = "tractor.drive.cornering_stiffness"
    assert yaw[name].sigma < result[name].sigma


@pytest.mark.slow
def test_a_truck_near_its_critical_speed() -> None:
    """Drive tyres of 70 %: its motion is hardly damped, and beyond the range of linear tyres, which is the only doubt;
    prediction errors identify all parameters."""
    name = "tractor.drive.cornering_stiffness"
    soft = TRUCK.replace({name: 0.7 * TRUCK.parameters()[name]})
    result = identify([simulate(soft, count=1, roll=False)], TRUCK, YAW)
    assert any("from prediction errors" in note for note in result.notes)
    assert [doubt.kind for doubt in result.doubts] == [DoubtKind.RANGE]
    for e in result.parameters:
        assert e.verdict == "doubtful", e.name
        assert abs(e.value - soft.parameters()[e.name]) < 3 * e.sigma, e.name


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


def test_contradictions_are_refused_with_name_and_cure() -> None:
    expected = "expected a number of the yaw motion, because roll=False; remove it, or use roll=True"
    texts = {HEIGHT: "free", "payload.height": "+- 20 %", "semitrailer.sprung.cog_height": "1.5 m +- 0.2 m"}
    for name, text in texts.items():
        with pytest.raises(VehicleError, match=re.escape(f"{name}={text}: {expected}")):
            applied(TRUCK, OneStage(roll=False, tyres="linear", given={name: text}))
    with pytest.raises(SignalError, match=r"uniform_payload: expected the default, .*; remove it, or use roll=True"):
        OneStage(roll=False, uniform_payload=False)


def test_only_roll_rates_and_accelerations_inform_nothing(record: Record) -> None:
    only = {name: values for name, values in record.signals.items() if not name.startswith(("yaw", "artic"))}
    only["lateral_acceleration.tractor"] = np.zeros(len(record))
    with pytest.raises(SignalError, match=r"yaw_rate\.tractor: in none of the logs"):
        identify([replace(record, signals=only)], TRUCK, replace(YAW, check=False))
