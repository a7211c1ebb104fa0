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
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle, get

TRUCK = get("cheng_cebon_2011")
YAW, YAW2, ROLL, ROLL2 = "yaw_rate.tractor", "yaw_rate.semitrailer", "roll_rate.tractor", "roll_rate.semitrailer"
ANGLE = "articulation.semitrailer"
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
    (finding,) = found(replace(LATE, time_bases={YAW2: "trailer logger", ROLL2: "trailer logger"}), TRUCK)
    assert (finding.fault, finding.severity) == (Fault.TIME_OFFSET, "warning")
    assert {finding.signal, *finding.others} == {YAW2, ROLL2}
    assert finding.remedy["delay"] == pytest.approx(0.35, abs=0.02)
    assert "s late (trailer logger)" in finding.message
    assert f"delay = {finding.remedy['delay']}" in finding.message
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


def test_identify_says_the_same():
    (finding,) = found(LATE, TRUCK)
    (same,) = prepare_dataset([LATE], TRUCK, OneStage()).findings
    assert (same.message, same.log) == (finding.message, "simulated")


@pytest.mark.parametrize("rate", [0.07, 0.05, -0.02])
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


@pytest.mark.parametrize(("record", "pair"), [(BASE, (YAW, YAW2)), (SWEEP, (YAW, YAW2)), (SWEEP, (ROLL, ROLL2))])
def test_exchanged_gyros(record, pair):
    one, other = pair
    exchanged = record.with_signals({one: record.signals[other], other: record.signals[one]})
    assert not found(record, TRUCK)
    (finding,) = found(exchanged, TRUCK)
    assert finding.fault is Fault.EXCHANGED
    assert {finding.signal, *finding.others} == set(pair)
    assert finding.severity == ("error" if one == YAW else "warning")


def test_a_late_gyro_of_the_tractor_is_not_an_exchange():
    for delay in (0.3, 0.6, 1.0):
        findings = found(resampled(BASE, BASE.time - delay, YAW), TRUCK)
        assert [(f.fault, f.signal) for f in findings] == [(Fault.TIME_OFFSET, YAW)]


def test_a_late_gyro_of_the_tractor_does_not_exchange_wheel_speeds():
    """The sign of their difference is judged by this gyro, and again once it is right."""
    speed, turned = BASE.signals["speed"], BASE.signals[YAW2]
    sides = [f"wheel_speed.semitrailer.{side}" for side in ("left", "right")]
    right = BASE.with_signals(dict(zip(sides, (speed - turned, speed + turned), strict=True)))
    exchanged = BASE.with_signals(dict(zip(sides, (speed + turned, speed - turned), strict=True)))
    assert not found(right, TRUCK)
    for delay in (0.6, 1.0):
        findings = found(resampled(right, right.time - delay, YAW), TRUCK)
        assert [(f.fault, f.signal) for f in findings] == [(Fault.TIME_OFFSET, YAW)]
    (finding,) = found(exchanged, TRUCK)
    assert (finding.fault, finding.signal, finding.others) == (Fault.EXCHANGED, sides[1], (sides[0],))
    late = found(resampled(exchanged, exchanged.time - 0.6, YAW2), TRUCK)
    assert {(f.fault, f.signal) for f in late} == {(Fault.EXCHANGED, sides[1]), (Fault.TIME_OFFSET, YAW2)}
    with pytest.raises(ValueError, match=f"{sides[1]}: less {sides[0]} contradicts"):
        prepare_dataset([exchanged], TRUCK, OneStage())


@pytest.mark.parametrize("gap", [1e4, 1e5, 1e9])
def test_a_corrupted_timestamp_or_a_long_gap_costs_no_memory_and_time(gap):
    half = len(BASE) // 2
    time = BASE.time + np.where(np.arange(len(BASE)) < half, 0.0, gap)
    split = Record(time=time, signals=BASE.signals, name="gap")
    found(BASE, TRUCK)  # compiled
    tracemalloc.start()
    start = process_time()
    found(split, TRUCK)
    assert process_time() - start < 5
    assert tracemalloc.get_traced_memory()[1] < 100e6
    tracemalloc.stop()
