"""Limits of the plausibility of a record: both sides of each."""

from dataclasses import replace

import numpy as np
import pytest

import fifthwheel as fw
from fifthwheel.data.checks import Fault, check
from fifthwheel.data.record import Record
from tests.data.checks.test_samples import RATE, RATE2, TIME, of


def wheels(ratio, speed=20.0, count=TIME.size):
    speeds = np.full(TIME.size, speed)
    wheel = np.where(np.arange(TIME.size) < count, ratio * speeds, np.nan)
    return of(speed=speeds, wheel_speed__tractor__front__left=wheel)


@pytest.mark.parametrize(
    ("ratio", "signal", "remedy"),
    [
        (0.86, None, {}),
        (0.84, "speed", {}),
        (1.17, None, {}),
        (1.19, "speed", {}),
        (3.19, "speed", {}),
        (3.21, "wheel_speed.tractor.front.left", {"unit": "km/h"}),
        (3.99, "wheel_speed.tractor.front.left", {"unit": "km/h"}),
        (4.01, "speed", {}),
        (0.32, "speed", {}),
        (0.3, "speed", {"unit": "km/h"}),
        (0.26, "speed", {"unit": "km/h"}),
        (0.24, "speed", {}),
    ],
)
def test_wheel_speeds(ratio, signal, remedy):
    found = [(f.signal, f.fault, dict(f.remedy)) for f in check(wheels(ratio, speed=10.0)) if f.fault is Fault.UNIT]
    assert found == ([(signal, Fault.UNIT, remedy)] if signal else [])


def test_wheel_speeds_are_compared_where_the_truck_moves():
    def found(record):
        return any(f.fault is Fault.UNIT for f in check(record))

    assert not found(wheels(2.0, speed=0.4))
    assert found(wheels(2.0, speed=0.6))
    assert not found(wheels(0.7, speed=0.6))  # the wheel stands
    assert not found(wheels(2.0, count=9))
    assert found(wheels(2.0, count=10))


def test_the_speed_is_high_enough_and_positive():
    def faults(values):
        return [(f.fault, f.severity) for f in check(of(speed=values)) if f.signal == "speed"]

    fraction = (np.arange(TIME.size) + 0.5) / TIME.size
    assert faults(np.full(TIME.size, -0.9)) == [(Fault.ZERO_SPEED, "error")]
    assert faults(np.full(TIME.size, -1.1)) == [(Fault.SWAPPED_SIGN, "error")]
    assert faults(np.where(fraction < 0.985, 4.9, 20.0)) == [(Fault.ZERO_SPEED, "warning")]
    assert faults(np.where(fraction < 0.995, 4.9, 20.0)) == [(Fault.ZERO_SPEED, "error")]
    assert faults(np.where(fraction < 0.025, 4.9, 20.0)) == [(Fault.ZERO_SPEED, "warning")]
    assert faults(np.where(fraction < 0.015, 4.9, 20.0)) == []
    (finding,) = (f for f in check(of(speed=np.where(np.abs(TIME - 20) < 9.99, 20.0, 3.0))) if f.signal == "speed")
    assert "start = 10.02 and stop = 29.98" in finding.message


@pytest.mark.parametrize(
    ("name", "value", "fault"),
    [
        ("roll_rate.tractor", 1.9, None),
        ("roll_rate.tractor", 2.1, Fault.DEGREES),
        ("roll_rate.tractor", 114.0, Fault.DEGREES),
        ("roll_rate.tractor", 116.0, Fault.OUT_OF_RANGE),
        ("lateral_acceleration.tractor", 12.1, Fault.OUT_OF_RANGE),
        ("steer.tractor.front", 1.3, Fault.STEERING_WHEEL),
        ("steer.tractor.front", 15.9, Fault.STEERING_WHEEL),
        ("steer.tractor.front", 16.1, Fault.DEGREES),
        ("steer.tractor.front", 68.0, Fault.DEGREES),
        ("steer.tractor.front", 69.0, Fault.OUT_OF_RANGE),
        ("speed", 44.0, None),
        ("speed", 46.0, Fault.UNIT),
        ("speed", 161.0, Fault.UNIT),
        ("speed", 163.0, Fault.OUT_OF_RANGE),
    ],
)
def test_the_range_of_a_quantity(name, value, fault):
    """Beyond what a truck can do; degrees and km/h where they explain it."""
    values = value * np.where(np.arange(TIME.size) % 50 < 25, 1.0, 0.99)
    record = of(**{name.replace(".", "__"): values})
    record = replace(record, signals={n: v for n, v in record.signals.items() if n in (name, "speed")})
    faults = {f.fault for f in check(record) if f.signal == name}
    assert faults == ({fault} if fault else set())
    for finding in check(record):
        of_wheel = finding.fault is Fault.DEGREES and name.startswith("steer")
        assert ("gain = 1 / steering ratio if it is" in finding.message) == of_wheel
    few = np.where(np.arange(TIME.size) % 110 == 0, values, 1.0 if name != "speed" else 20.0)
    assert not {Fault.OUT_OF_RANGE, Fault.DEGREES, Fault.UNIT} & {
        f.fault for f in check(record.with_signals({name: few}))
    }


def test_the_time_base():
    """A pause above half a second and five steps; at most 20 kHz."""

    def found(time):
        return [(f.fault, f.severity) for f in check(Record(time=time, signals={"speed": np.full(time.size, 20.0)}))]

    for pause, expected in ((0.49, []), (0.51, [(Fault.DROPOUT, "warning")])):
        assert found(np.r_[np.arange(50), 49 + np.arange(50) + pause / 0.02] * 0.02) == expected
    for pause, expected in ((0.99, []), (1.01, [(Fault.DROPOUT, "warning")])):
        assert found(np.r_[np.arange(50), 49 + np.arange(50) + pause / 0.2] * 0.2) == expected
    for rate, expected in ((1.9e4, []), (2.1e4, [(Fault.UNIT, "error")])):
        assert found(np.arange(1000) / rate) == expected


def test_the_same_samples_twice():
    """With its noise, whatever gain and offset; more than 100 samples, and varying."""
    random = np.random.default_rng(6)
    n = TIME.size

    def found(one, other, name=RATE2):
        findings = check(of(**{RATE.replace(".", "__"): one, name.replace(".", "__"): other}))
        return [f.others for f in findings if f.fault is Fault.DUPLICATE]

    rate = 0.05 * np.sin(TIME) + 0.002 * random.normal(size=n)
    assert found(rate, 3 * rate + 0.1) == [(RATE,)]
    assert found(rate, -rate) == []
    assert found(rate, rate, "roll_rate.tractor") == []
    for own, expected in ((0.25, 1), (0.35, 0)):  # of the noise of the other one
        assert len(found(rate, rate + own * 0.002 * random.normal(size=n))) == expected
    assert found(0.05 * np.sin(TIME), 0.05 * np.sin(TIME) + 0.002 * np.cos(0.05 * TIME)) == []
    for count, expected in ((101, 1), (100, 0)):
        few = np.where(np.arange(n) < count, rate, np.nan)
        assert len(found(few, few)) == expected
    assert found(np.ones(n), np.ones(n)) == []


@pytest.mark.parametrize("digits", [16, 4])
def test_roll_angles_of_a_stiff_coupling_are_no_copies(digits):
    """Results of a simulation, without noise: about 5 % more roll of the semitrailer, in proportion."""
    truck = fw.vehicle("cheng_cebon_2011")
    record = fw.simulate(truck, manoeuvre="slowly_increasing_steer", seed=1)
    rolls = {f"roll.{unit}": np.round(record.reference[f"roll.{unit}"], digits) for unit in ("tractor", "semitrailer")}
    assert not check(record.with_signals(rolls))
    (same,) = check(record.with_signals(rolls | {"roll.semitrailer": rolls["roll.tractor"]}))
    assert (same.fault, same.others) == (Fault.DUPLICATE, ("roll.tractor",))
