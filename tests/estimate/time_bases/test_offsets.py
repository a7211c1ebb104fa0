"""Measured time offsets against known delays, on the linear and the nonlinear truck, and false alarms."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from fifthwheel.data.record import Record
from fifthwheel.estimate.time_bases import check_signals
from fifthwheel.estimate.time_bases.offsets import TimeOffset, common_offsets, offsets_of
from fifthwheel.estimate.time_bases.predictions import lag_curve, predict_channels
from fifthwheel.model.manoeuvres import course
from fifthwheel.model.manoeuvres.open_loops import single_sine, single_track_steer
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle, get
from tests.estimate.time_bases.examples import (
    ANGLE,
    ROLL2,
    SOURCES,
    STEER,
    TIME,
    WHITE,
    YAW,
    YAW2,
    late,
    prediction_of,
    shifted,
)

TRUCK = get("cheng_cebon_2011_vehicle")


def stiffer(factor: float) -> Vehicle:
    """The truck with another cornering stiffness of all axles."""
    stiffness = {n: v for n, v in TRUCK.parameters().items() if n.endswith("cornering_stiffness")}
    return TRUCK.replace({name: factor * value for name, value in stiffness.items()})


VEHICLES = {"30 % soft": stiffer(0.7), "40 % stiff": stiffer(1.4)}


@cache
def log(name: str) -> Record:
    """A log without delays."""
    if name == "linear lane changes":
        return simulate(TRUCK, count=5)
    if name == "linear random":
        return simulate(TRUCK, manoeuvre="random")
    pytest.importorskip("mujoco")
    from fifthwheel.model.plant import Plant

    options = {"count": 4} if name == "lane_changes" else {"duration": 30.0}
    return Plant(TRUCK).drive(course(name, TRUCK, seed=3, **options)).record(seed=3)


def delayed(record: Record, delay: float, *names: str) -> Record:
    """The record with late channels; missing samples where nothing was measured yet."""
    signals = {}
    for name in names:
        values = np.interp(record.time - delay, record.time, record.signals[name])
        signals[name] = values if name == STEER else np.where(record.time < record.time[0] + delay, np.nan, values)
    return record.with_signals(signals)


def measured(record: Record, vehicle: Vehicle | None) -> dict[str, TimeOffset]:
    prediction = predict_channels(record, vehicle)
    return {offset.name: offset for offset in offsets_of(record, prediction)} if prediction else {}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["linear random", "everyday"])
def test_without_delays_nothing_is_found(name):
    for vehicle in VEHICLES.values():
        offsets = measured(log(name), vehicle)
        assert {STEER, YAW2} <= set(offsets)
        assert not [offset for offset in offsets.values() if offset.significant]
        assert not check_signals(log(name), vehicle)
    assert not check_signals(log(name))


@pytest.mark.slow
def test_no_false_alarm_in_a_turn_to_the_limit_of_adhesion() -> None:
    """With a slowly rising steer angle, whose lag hardly shows."""
    pytest.importorskip("mujoco")
    from fifthwheel.model.plant import Plant, Properties

    sine = single_sine(TRUCK, duration=10.0)
    largest = single_track_steer(TRUCK, float(sine.speed[0]), 3.0)
    turn = replace(sine, steer=largest * np.clip((sine.time - 1) / 8, 0, 1))
    record = Plant(TRUCK, Properties(friction=0.35)).drive(turn).record(seed=3)
    for vehicle in (TRUCK, None):
        assert check_signals(record, vehicle) == ()


@pytest.mark.parametrize(
    ("name", "delay", "names", "vehicle"),
    [
        ("linear random", 1.5, (STEER,), "40 % stiff"),
        ("linear random", 0.35, (YAW2, ROLL2), "40 % stiff"),
        ("lane_changes", 0.35, (STEER,), "30 % soft"),
        ("lane_changes", 1.5, (YAW2, ROLL2), "40 % stiff"),
        ("lane_changes", 1.5, (YAW,), "30 % soft"),
    ],
)
def test_a_delay_is_measured_within_three_sigma(name, delay, names, vehicle):
    offsets = measured(delayed(log(name), delay, *names), VEHICLES[vehicle])
    for late_name in names:
        offset = offsets[late_name]
        assert offset.significant
        assert abs(offset.offset - delay) < 3 * offset.sigma
        assert offset.sigma < 0.12
        assert offset.explained > offset.explained_at_0
    assert not [n for n, offset in offsets.items() if offset.significant and n not in names]


def test_small_and_negative_delays_and_those_without_a_vehicle():
    for delay in (-0.5, 0.05, 0.15):
        offset = measured(delayed(log("linear lane changes"), delay, YAW2), TRUCK)[YAW2]
        assert offset.offset == pytest.approx(delay, abs=0.03)
        assert offset.significant == (abs(delay) > 0.2)
    for delay, significant in ((0.8, True), (0.25, False)):
        late_log = delayed(log("lane_changes"), delay, YAW2, ROLL2)
        assert measured(late_log, None)[YAW2].significant == significant


def test_a_time_base_has_one_offset_before_its_channels():
    record = delayed(log("linear lane changes"), 0.35, YAW2, ROLL2)
    record = replace(record, time_bases={YAW2: "trailer logger", ROLL2: "trailer logger"})
    base, *channels = measured(record, TRUCK).values()
    assert (base.name, set(base.signals)) == ("trailer logger", {YAW2, ROLL2})
    assert base.offset == pytest.approx(0.35, abs=0.02)
    assert base.significant
    assert "trailer logger" not in [channel.name for channel in channels]


def test_a_log_that_cannot_be_predicted_has_no_offsets():
    record = log("linear lane changes")
    straight = record.with_signals({n: np.zeros(len(record)) for n in record.signals if n != "speed"})
    without_speed = replace(record, signals={n: v for n, v in record.signals.items() if n != "speed"})
    for unusable in (straight, without_speed, record.cut(0, 3), record.with_signals({STEER: record.time * np.nan})):
        assert not measured(unusable, TRUCK)


# Of predictions whose lags are known


def offsets(lags, *, time_bases=None, **options):
    """Offsets of channels with known lags by name."""
    measured = late(lags)
    record = Record(time=TIME, signals={STEER: SOURCES[ANGLE], **measured}, time_bases=time_bases or {})
    return {offset.name: offset for offset in offsets_of(record, prediction_of(measured, **options))}


def test_offsets_are_relative_to_the_yaw_rate_of_the_first_unit():
    found = offsets({YAW: 0.08, YAW2: 0.48, ROLL2: -0.4})
    assert list(found) == [STEER, YAW2, ROLL2]
    assert found[STEER].offset == pytest.approx(-0.08, abs=0.005)
    assert found[YAW2].offset == pytest.approx(0.4, abs=0.005)
    assert found[ROLL2].offset == pytest.approx(-0.48, abs=0.005)
    for offset in found.values():
        assert offset.signals == (offset.name,)
        assert offset.sigma == pytest.approx(0.015, abs=0.002)  # of the model; noise is small
        assert offset.explained > 0.99
    at_zero = np.corrcoef(SOURCES[YAW2][100:-100], shifted(SOURCES[YAW2], 0.4)[100:-100])[0, 1] ** 2
    assert found[YAW2].explained_at_0 == pytest.approx(at_zero, abs=0.05)
    assert [o.smallest for o in found.values()] == [0.25, 0.2, 0.2]
    assert [o.smallest for o in offsets({YAW: 0.0, YAW2: 0.0}, generic=True).values()] == [0.3, 0.3]


def test_sigma_contains_noise_and_the_spread_of_the_vehicle():
    """Two variants that explain the channels alike and differ in their lags by 0.2 s: a spread of 0.1 s."""
    lags = {YAW: 0.0, YAW2: 0.3}
    variants = [{YAW: SOURCES[YAW], YAW2: shifted(SOURCES[YAW2], lag)} for lag in (0.2, -0.2)]
    measured = {YAW: SOURCES[YAW] + 0.02 * WHITE[YAW], YAW2: SOURCES[YAW2] + 0.02 * WHITE[YAW2]}
    record = Record(time=TIME, signals=measured)
    found = {o.name: o for o in offsets_of(record, prediction_of(measured, variants))}
    assert found[YAW2].offset == pytest.approx(0.0, abs=0.02)
    assert found[YAW2].sigma == pytest.approx(np.hypot(0.2, 0.015), rel=0.05)
    assert found[STEER].sigma == pytest.approx(0.015, rel=0.05)
    noisy = {name: shifted(SOURCES[name], lag) + WHITE[name] for name, lag in lags.items()}
    alone = [lag_curve(noisy[name], SOURCES[name]).best()[1] for name in noisy]
    found = {o.name: o for o in offsets_of(record.with_signals(noisy), prediction_of(noisy))}
    assert found[STEER].sigma == pytest.approx(np.hypot(alone[0], 0.015))
    assert found[YAW2].sigma == pytest.approx(np.sqrt(alone[0] ** 2 + alone[1] ** 2 + 0.015**2))


@pytest.mark.parametrize(
    ("lags", "expected"),
    [
        ({YAW: 0.5, YAW2: 0.0, ROLL2: 0.0}, {YAW: 0.5, YAW2: 0.0, ROLL2: 0.0}),  # it cannot be late otherwise
        ({YAW: 0.5}, {YAW: 0.5}),
        ({YAW: -0.5, YAW2: -0.5, ROLL2: -0.5}, {STEER: 0.5, YAW2: 0.0, ROLL2: 0.0}),
        ({YAW: -0.5, YAW2: 0.0, ROLL2: 0.0}, {YAW: -0.5, YAW2: 0.0, ROLL2: 0.0}),
        ({YAW: -0.5, YAW2: -0.5, ROLL2: 0.0}, {STEER: 0.5, YAW2: 0.0, ROLL2: 0.5}),
        ({YAW: -0.5}, {STEER: 0.5}),
        ({YAW: -0.28, YAW2: -0.28}, {STEER: 0.28, YAW2: 0.0}),
        ({YAW: 0.28, YAW2: 0.28}, {YAW: 0.28, YAW2: 0.28}),
        ({YAW: 0.23, YAW2: 0.23}, {STEER: -0.23, YAW2: 0.0}),
        ({YAW: 0.23, YAW2: 0.0}, {YAW: 0.23, YAW2: 0.0}),
        ({YAW: 0.17, YAW2: 0.0}, {STEER: -0.17, YAW2: -0.17}),
        ({YAW: 0.23, YAW2: 0.23, ROLL2: 0.0}, {STEER: -0.23, YAW2: 0.0, ROLL2: -0.23}),
        ({YAW2: 0.5, ROLL2: 0.1}, {YAW2: 0.5, ROLL2: 0.1}),
    ],
    ids=lambda value: " ".join(f"{name}={lag}" for name, lag in value.items()),
)
def test_which_of_steer_angle_and_yaw_rate_is_late(lags, expected):
    found = offsets(lags)
    assert {name: offset.offset for name, offset in found.items()} == {
        name: pytest.approx(value, abs=0.01) for name, value in expected.items()
    }


@pytest.mark.parametrize(("explained", "used"), [(0.25, False), (0.35, True)])
def test_a_channel_needs_an_explained_fraction(explained, used):
    """0.3 of its variance."""
    noise = np.sqrt(1 / explained - 1) * WHITE[YAW2] / np.std(WHITE[YAW2])
    measured = late({YAW: 0.0}) | {YAW2: SOURCES[YAW2] + noise}
    record = Record(time=TIME, signals=measured)
    assert (YAW2 in {o.name for o in offsets_of(record, prediction_of(measured))}) == used
    swapped = {YAW: SOURCES[YAW] + np.sqrt(1 / explained - 1) * WHITE[YAW] / np.std(WHITE[YAW])} | late({YAW2: 0.0})
    found = offsets_of(record.with_signals(swapped), prediction_of(swapped))
    assert bool(found) == used  # the reference does not show


def offset_of(name, offset, sigma=0.02, smallest=0.2):
    return TimeOffset(
        name=name, signals=(name,), offset=offset, sigma=sigma, explained_at_0=0.2, explained=0.8, smallest=smallest
    )


def test_similar_offsets_are_one():
    """Up to 0.1 s apart, weighted by 1 / sigma^2. A significant one exceeds three sigma and the smallest one."""
    for offset, sigma, significant in ((0.5, 0.2, False), (-0.5, 0.1, True), (0.15, 0.01, False), (0.25, 0.05, True)):
        assert offset_of(YAW2, offset, sigma).significant is significant
    one, other = offset_of(YAW2, 0.4, 0.01), offset_of(ROLL2, 0.49, 0.03, smallest=0.25)
    other = replace(other, explained=0.4, explained_at_0=0.1)
    (joined,) = common_offsets([one, other])
    assert (joined.name, joined.signals, joined.smallest) == (YAW2, (YAW2, ROLL2), 0.25)
    for field in ("offset", "sigma", "explained", "explained_at_0"):
        mean = 0.9 * getattr(one, field) + 0.1 * getattr(other, field)
        assert getattr(joined, field) == pytest.approx(mean)
    assert [o.name for o in common_offsets([one, offset_of(ROLL2, 0.51)])] == [YAW2, ROLL2]
    assert common_offsets([offset_of(YAW2, 0.19), offset_of(ROLL2, 0.3, sigma=0.11)]) == []
