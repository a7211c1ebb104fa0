"""Measured time offsets against known delays, on the linear and the nonlinear truck, and false alarms."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from fifthwheel.data.record import Record
from fifthwheel.estimate.time_bases import check_signals
from fifthwheel.estimate.time_bases.offsets import TimeOffset, offsets_of
from fifthwheel.estimate.time_bases.predictions import predict_channels
from fifthwheel.model.manoeuvres import course
from fifthwheel.model.manoeuvres.open_loops import single_sine, single_track_steer
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle, get

TRUCK = get("cheng_cebon_2011_vehicle")
STEER, YAW, YAW2, ROLL2 = "steer.tractor.front", "yaw_rate.tractor", "yaw_rate.semitrailer", "roll_rate.semitrailer"


def stiffer(factor: float) -> Vehicle:
    """The truck with another cornering stiffness of all axles."""
    stiffness = {n: v for n, v in TRUCK.parameters().items() if n.endswith("cornering_stiffness")}
    return TRUCK.replace({name: factor * value for name, value in stiffness.items()})


VEHICLES = {"right": TRUCK, "30 % soft": stiffer(0.7), "40 % stiff": stiffer(1.4)}
each_vehicle = pytest.mark.parametrize(
    "vehicle", ["right", "30 % soft", pytest.param("40 % stiff", marks=pytest.mark.slow)]
)


@cache
def log(name: str) -> Record:
    """A log without delays."""
    if name == "linear lane changes":
        return simulate(TRUCK, count=5)
    if name == "linear random":
        return simulate(TRUCK, manoeuvre="random")
    pytest.importorskip("mujoco")
    from fifthwheel.model.plant import Plant

    options = {"count": 4} if name == "lane_changes" else {"duration": 60.0}
    return Plant(TRUCK).drive(course(name, TRUCK, seed=3, **options)).record(seed=3)


LOGS = ("linear lane changes", "linear random", "lane_changes", "everyday")


def late(record: Record, delay: float, *names: str) -> Record:
    """The record with late channels; missing samples where nothing was measured yet."""
    signals = {}
    for name in names:
        values = np.interp(record.time - delay, record.time, record.signals[name])
        signals[name] = values if name == STEER else np.where(record.time < record.time[0] + delay, np.nan, values)
    return record.with_signals(signals)


def measured(record: Record, vehicle: Vehicle | None) -> dict[str, TimeOffset]:
    prediction = predict_channels(record, vehicle)
    return {offset.name: offset for offset in offsets_of(record, prediction)} if prediction else {}


@each_vehicle
@pytest.mark.parametrize("name", LOGS)
def test_without_delays_nothing_is_significant(name, vehicle):
    offsets = measured(log(name), VEHICLES[vehicle])
    assert {STEER, YAW2} <= set(offsets)
    assert not [offset for offset in offsets.values() if offset.significant]
    assert not check_signals(log(name), VEHICLES[vehicle])
    assert not check_signals(log(name))


@each_vehicle
@pytest.mark.parametrize("names", [(YAW2, ROLL2), (YAW2,), (YAW,), (STEER,)], ids=" ".join)
@pytest.mark.parametrize("delay", [0.35, 0.8, 1.5])
@pytest.mark.parametrize("name", LOGS)
def test_a_delay_is_measured_within_three_sigma(name, delay, names, vehicle):
    if names == (STEER,) and delay > 0.5 and name == "everyday":
        pytest.skip("a steer angle that late does not belong to the speed")
    offsets = measured(late(log(name), delay, *names), VEHICLES[vehicle])
    for late_name in names:
        offset = offsets[late_name]
        assert offset.significant
        assert abs(offset.offset - delay) < 3 * offset.sigma
        assert offset.sigma < 0.12
        assert offset.explained > offset.explained_at_0
    assert not [n for n, offset in offsets.items() if offset.significant and n not in names]


@pytest.mark.parametrize("delay", [-0.5, 0.05, 0.15])
def test_small_and_negative_delays(delay):
    offset = measured(late(log("linear lane changes"), delay, YAW2), TRUCK)[YAW2]
    assert offset.offset == pytest.approx(delay, abs=0.03)
    assert offset.significant == (abs(delay) > 0.2)


def test_without_a_vehicle_only_large_delays():
    assert measured(late(log("lane_changes"), 0.8, YAW2, ROLL2), None)[YAW2].significant
    assert not measured(late(log("lane_changes"), 0.25, YAW2, ROLL2), None)[YAW2].significant


def test_a_time_base_has_one_offset_before_its_channels():
    record = late(log("linear lane changes"), 0.35, YAW2, ROLL2)
    record = replace(record, time_bases={YAW2: "trailer logger", ROLL2: "trailer logger"})
    base, *channels = measured(record, TRUCK).values()
    assert (base.name, set(base.signals)) == ("trailer logger", {YAW2, ROLL2})
    assert base.offset == pytest.approx(0.35, abs=0.02)
    assert base.significant
    assert "trailer logger" not in [channel.name for channel in channels]


def test_an_inverted_signal_has_no_offset():
    record = log("linear lane changes")
    assert YAW2 not in measured(record.with_signals({YAW2: -record.signals[YAW2]}), TRUCK)


def test_a_log_that_cannot_be_predicted_has_no_offsets():
    record = log("linear lane changes")
    straight = record.with_signals({n: np.zeros(len(record)) for n in record.signals if n != "speed"})
    without_speed = replace(record, signals={n: v for n, v in record.signals.items() if n != "speed"})
    for unusable in (straight, without_speed, record.cut(0, 3), record.with_signals({STEER: record.time * np.nan})):
        assert not measured(unusable, TRUCK)


@pytest.mark.parametrize(
    ("offset", "sigma", "significant"), [(0.5, 0.2, False), (-0.5, 0.1, True), (0.15, 0.01, False), (0.25, 0.05, True)]
)
def test_a_significant_offset_exceeds_three_sigma_and_the_smallest_one(offset, sigma, significant):
    channel = TimeOffset(
        name=YAW2, signals=(YAW2,), offset=offset, sigma=sigma, explained_at_0=0.5, explained=0.9, smallest=0.2
    )
    assert channel.significant is significant


@pytest.mark.parametrize("friction", [0.35, 1.0])
def test_no_false_alarm_in_a_turn_to_the_limit_of_adhesion(friction: float) -> None:
    """With a slowly rising steer angle, whose lag hardly shows."""
    pytest.importorskip("mujoco")
    from fifthwheel.model.plant import Plant, Properties

    sine = single_sine(TRUCK, duration=10.0)
    largest = single_track_steer(TRUCK, float(sine.speed[0]), 3.0 if friction < 1 else 6.0)
    turn = replace(sine, steer=largest * np.clip((sine.time - 1) / 8, 0, 1))
    record = Plant(TRUCK, Properties(friction=friction)).drive(turn).record(seed=3)
    for vehicle in (TRUCK, None):
        assert check_signals(record, vehicle) == ()
