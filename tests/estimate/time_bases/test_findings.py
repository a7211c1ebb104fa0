"""Findings on time bases, clocks and exchanged gyros, their words and cures."""

import re
import tracemalloc
from dataclasses import replace
from time import process_time

import numpy as np
import pytest

from fifthwheel.data.checks import Fault, Finding
from fifthwheel.data.logs.signal_map import SignalSource
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify.dataset import prepare_dataset
from fifthwheel.estimate.identify.settings import OneStage
from fifthwheel.estimate.time_bases import check_signals
from fifthwheel.estimate.time_bases.findings import channel_rates, common_rates, exchanged_pairs
from fifthwheel.estimate.time_bases.predictions import RATE, Prediction, lag_curve
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle, get
from tests.estimate.time_bases.examples import (
    ACCELERATION,
    ANGLE,
    ROLL,
    ROLL2,
    SOURCES,
    STEER,
    TIME,
    WHITE,
    YAW,
    YAW2,
    prediction_of,
    shifted,
    slow_noise,
)

TRUCK = get("cheng_cebon_2011")
BASE = simulate(TRUCK, count=6)
SWEEP = simulate(TRUCK, manoeuvre="sweep")


def resampled(record: Record, time: np.ndarray, *names: str) -> Record:
    """The record with the values that channels had at other times."""
    known = {"left": np.nan, "right": np.nan}
    return record.with_signals({name: np.interp(time, record.time, record.signals[name], **known) for name in names})


def found(record: Record, vehicle: Vehicle) -> list[Finding]:
    """Findings, without those on the samples that are missing at the ends of shifted channels."""
    return [finding for finding in check_signals(record, vehicle) if finding.fault is not Fault.DROPOUT]


LATE = resampled(BASE, BASE.time - 0.35, YAW2, ROLL2)


def test_late_channels_are_one_finding_with_the_cure():
    """`identify` says the same."""
    (finding,) = found(replace(LATE, time_bases={YAW2: "trailer logger", ROLL2: "trailer logger"}), TRUCK)
    assert (finding.fault, finding.severity) == (Fault.TIME_OFFSET, "warning")
    assert {finding.signal, *finding.others} == {YAW2, ROLL2}
    assert finding.remedy["delay"] == pytest.approx(0.35, abs=0.02)
    assert "s late (trailer logger)" in finding.message
    assert f'delay = "{finding.remedy["delay"]} s +- 0.0' in finding.message
    (same,) = prepare_dataset([LATE], TRUCK, OneStage()).findings
    assert (same.message, same.log) == (found(LATE, TRUCK)[0].message, "simulated")
    assert not found(resampled(LATE, BASE.time + SignalSource(column="x", **finding.remedy).delay, YAW2, ROLL2), TRUCK)


def test_two_loggers_are_two_findings():
    findings = found(resampled(LATE, BASE.time - 0.45, ROLL2), TRUCK)
    delays = {finding.signal: finding.remedy["delay"] for finding in findings}
    assert delays == {YAW2: pytest.approx(0.35, abs=0.02), ROLL2: pytest.approx(0.8, abs=0.02)}


def test_a_delay_of_half_a_period_is_not_an_inverted_signal():
    findings = found(resampled(BASE, BASE.time - 1.5, YAW2, ROLL2), TRUCK)
    assert {finding.fault for finding in findings} == {Fault.TIME_OFFSET}
    inverted = BASE.with_signals({YAW2: -BASE.signals[YAW2]})
    assert [(f.fault, f.signal) for f in found(inverted, TRUCK)] == [(Fault.SWAPPED_SIGN, YAW2)]


@pytest.mark.parametrize("rate", [0.07, -0.02])
def test_the_rate_of_a_clock(rate):
    (finding,) = found(resampled(BASE, BASE.time / (1 + rate), YAW2, ROLL2), TRUCK)
    assert finding.fault is Fault.CLOCK_RATE
    assert {finding.signal, *finding.others} == {YAW2, ROLL2}
    shown = float(re.search(r"([\d.]+)% (fast|slow)", finding.message)[1]) / 100
    assert shown == pytest.approx(abs(rate), abs=0.003)
    assert ("fast" if rate > 0 else "slow") in finding.message


def test_a_common_clock_shows_by_the_articulation_angle():
    noise = np.random.default_rng(1).normal(0, 0.002, len(BASE))
    record = BASE.with_signals({ANGLE: BASE.reference[ANGLE] + noise})
    assert not found(record, TRUCK)
    (finding,) = found(replace(record, time=1.06 * record.time), TRUCK)
    assert (finding.fault, finding.signal) == (Fault.CLOCK_RATE, "time")


@pytest.mark.slow
def test_exchanged_gyros():
    for record, pair in ((BASE, (YAW, YAW2)), (SWEEP, (ROLL, ROLL2))):
        one, other = pair
        assert not found(record, TRUCK)
        (finding,) = found(record.with_signals({one: record.signals[other], other: record.signals[one]}), TRUCK)
        assert finding.fault is Fault.EXCHANGED
        assert {finding.signal, *finding.others} == set(pair)
        assert finding.severity == ("error" if one == YAW else "warning")


def test_exchanged_gyros_in_slow_driving():
    """A late and an early gyro explain the log nearly as well."""
    slow = simulate(TRUCK, speed=10.0, rate=25.0, seed=3)
    swapped = slow.with_signals({YAW: slow.signals[YAW2], YAW2: slow.signals[YAW]})
    (finding,) = found(swapped, TRUCK)
    assert (finding.fault, finding.severity) == (Fault.EXCHANGED, "error")


def test_a_late_gyro_of_the_tractor_is_not_an_exchange():
    for delay in (0.3, 0.6, 1.0):
        findings = found(resampled(BASE, BASE.time - delay, YAW), TRUCK)
        assert [(f.fault, f.signal) for f in findings] == [(Fault.TIME_OFFSET, YAW)]


@pytest.mark.slow
def test_a_late_gyro_of_the_tractor_does_not_exchange_wheel_speeds():
    """The sign of their difference is judged by this gyro, and again once it is right."""
    speed, turned = BASE.signals["speed"], BASE.signals[YAW2]
    sides = [f"wheel_speed.semitrailer.{side}" for side in ("left", "right")]
    right = BASE.with_signals(dict(zip(sides, (speed - turned, speed + turned), strict=True)))
    exchanged = BASE.with_signals(dict(zip(sides, (speed + turned, speed - turned), strict=True)))
    assert not found(right, TRUCK)
    findings = found(resampled(right, right.time - 0.6, YAW), TRUCK)
    assert [(f.fault, f.signal) for f in findings] == [(Fault.TIME_OFFSET, YAW)]
    (finding,) = found(exchanged, TRUCK)
    assert (finding.fault, finding.signal, finding.others) == (Fault.EXCHANGED, sides[1], (sides[0],))
    late = found(resampled(exchanged, exchanged.time - 0.6, YAW2), TRUCK)
    assert {(f.fault, f.signal) for f in late} == {(Fault.EXCHANGED, sides[1]), (Fault.TIME_OFFSET, YAW2)}
    with pytest.raises(ValueError, match=f"{sides[1]}: less {sides[0]} contradicts"):
        prepare_dataset([exchanged], TRUCK, OneStage())


def test_a_corrupted_timestamp_or_a_long_gap_costs_no_memory_and_time():
    half = len(BASE) // 2
    time = BASE.time + np.where(np.arange(len(BASE)) < half, 0.0, 1e9)
    split = Record(time=time, signals=BASE.signals, name="gap")
    found(BASE, TRUCK)  # compiled
    tracemalloc.start()
    start = process_time()
    found(split, TRUCK)
    assert process_time() - start < 5
    assert tracemalloc.get_traced_memory()[1] < 100e6
    tracemalloc.stop()


# Of predictions whose drift and lags are known


def drifting(rate, *, duration=60.0, noise=0.05, name=YAW2):
    """The rate that is found for a channel whose clock deviates by a rate, and its sigma."""
    n = round(duration * RATE)
    centre = duration / 2
    measured = np.interp(centre + (TIME[:n] - centre) / (1 + rate), TIME, SOURCES[name]) + noise * WHITE[name][:n]
    prediction = Prediction(
        time=TIME[:n],
        steer=STEER,
        names=(name,),
        measured=measured[:, None],
        predicted=SOURCES[name][None, :n, None],
        generic=False,
    )
    return list(channel_rates(prediction))


def test_the_rate_of_a_drifting_clock_and_its_limits():
    """From 0.005 and three sigma on, up to 0.08, in 30 s or more, and only of yaw, roll and articulation."""
    for rate in (-0.06, -0.01, 0.01, 0.04, 0.07):
        (found,) = drifting(rate)
        assert found.signals == (YAW2,)
        assert abs(found.rate - rate) < max(2 * found.sigma, 0.003)
        assert 0.002 <= found.sigma < 0.01
    assert drifting(0.0) == drifting(0.004) == drifting(-0.004) == []
    assert drifting(0.1) == drifting(-0.1) == []
    assert drifting(0.05, duration=29.9) == []
    assert len(drifting(0.05, duration=31)) == 1
    assert drifting(0.05, noise=2.0) == []
    assert len(drifting(0.05, noise=0.5)) == 1
    assert drifting(0.05, name=ACCELERATION) == []


def articulated(rate, *, noise=0.001, gain=1.0):
    """The rate of a common clock, with the articulation as the integral of the difference of the yaw rates."""
    r1, r2 = 0.05 * SOURCES[YAW], 0.05 * SOURCES[YAW2]
    angle = np.concatenate([[0.0], np.cumsum((r2 - r1)[1:] + (r2 - r1)[:-1]) / 2 / RATE])
    measured = {YAW: r1, YAW2: r2, ANGLE: gain / (1 + rate) * angle + noise * slow_noise(9, 0.02)}
    return list(common_rates(prediction_of(measured)))


def test_the_rate_of_a_common_clock_and_its_limits():
    """From 0.03 and three sigma on, with a sigma below 0.015, and the angle explained by the yaw rates."""
    for rate in (-0.05, -0.04, 0.04, 0.06):
        (found,) = articulated(rate)
        assert found.signals == ()
        assert abs(found.rate - rate) < 3 * found.sigma + 0.004
        assert 0 < found.sigma < 0.01
    assert articulated(0.0) == articulated(0.02) == articulated(-0.02) == []
    assert articulated(0.06, noise=0.05) == []
    assert articulated(0.0, gain=0.0) == []


def crossed(names, *, lag=0.0, explained=0.99, own=0.0):
    """Two channels that follow each other's prediction, and partly their own."""
    one, other = names
    noise = np.sqrt(1 / explained - 1)
    measured = {}
    for name, source in ((one, other), (other, one)):
        pure = (1 - own) * shifted(SOURCES[source], lag) + own * shifted(SOURCES[name], lag)
        measured[name] = pure / np.std(pure) + noise * WHITE[name] / np.std(WHITE[name])
    return list(exchanged_pairs(prediction_of(measured)))


@pytest.mark.parametrize(("names", "least", "too_late"), [((YAW, YAW2), 0.8, 0.6), ((ROLL, ROLL2), 0.5, 0.6)])
def test_exchanged_channels(names, least, too_late):
    """Explained by each other's prediction, by 0.8 of a yaw rate and 0.5 of a roll rate, with a lag up to 0.12 s."""
    assert crossed(names) == [names]
    assert crossed(names, explained=least + 0.02) == [names]
    assert crossed(names, explained=least - 0.02) == []
    assert crossed(names, lag=0.12) == crossed(names, lag=-0.12) == [names]
    assert crossed(names, lag=too_late) == crossed(names, lag=-too_late) == []
    assert crossed(names, own=1.0) == []
    assert crossed((YAW, ROLL2)) == []


@pytest.mark.parametrize(("names", "margin"), [((YAW, YAW2), 0.1), ((ROLL, ROLL2), 0.3)])
def test_an_exchange_needs_a_margin(names, margin):
    """Of the logarithms of the residual variances, summed: similar predictions, and mixtures of them as channels."""
    one, other = names
    expected = {one: SOURCES[one], other: 0.97 * SOURCES[one] + 0.24 * SOURCES[other]}
    differences, found = [], []
    for own in np.linspace(0.0, 0.5, 41):
        measured, straight, cross = {}, 0.0, np.zeros(7)
        for name, source in (names, names[::-1]):
            measured[name] = (1 - own) * expected[source] + own * expected[name] + 0.1 * WHITE[name]
            straight += np.log(1 - lag_curve(measured[name], expected[name]).explained.max())
            cross += np.log(1 - lag_curve(measured[name], expected[source]).explained[52:59])  # lags up to 0.12 s
        differences.append(straight - cross.min())
        found.append(bool(list(exchanged_pairs(prediction_of(measured, [expected])))))
    assert found == [difference > margin for difference in differences]
    assert 0 < sum(found) < 41
