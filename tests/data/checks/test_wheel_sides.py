"""Left and right wheel speeds that are exchanged, by the sign of their difference in a turn."""

from dataclasses import replace

import numpy as np
import pytest

from fifthwheel.base.types import Array
from fifthwheel.data.checks import Fault, check
from fifthwheel.data.record import Record

STEER, RATE, RATE2 = "steer.tractor.front", "yaw_rate.tractor", "yaw_rate.semitrailer"
AXLES = {"tractor.front": RATE, "semitrailer.middle": RATE2, "tractor.drive": RATE}
"""By axle the yaw rate of its unit."""
HALF_TRACK = 1.02


def with_wheels(record: Record, *, noise: float = 0.02, late: float = 0.0, differences: Array | float = 1.0) -> Record:
    """With wheel speeds of three axles, 25 a second, whose rolling radii differ by 0.5 %; `differences` multiplies
    those that the turn gives."""
    random, signals = np.random.default_rng(7), {}
    for axle, rate in AXLES.items():
        turned = np.interp(record.time - late, record.time, record.signals[rate]) * HALF_TRACK * differences
        for side, sign in (("left", -1), ("right", 1)):
            wheel = record.signals["speed"] * (1 + 0.0025 * sign) + sign * turned
            wheel = wheel + noise * random.standard_normal(len(record))
            wheel[np.arange(len(record)) % 2 > 0] = np.nan
            signals[f"wheel_speed.{axle}.{side}"] = wheel
    return record.with_signals(signals)


def exchanged(record: Record, *axles: str) -> Record:
    pairs = [(f"wheel_speed.{axle}.left", f"wheel_speed.{axle}.right") for axle in axles]
    both = {a: record.signals[b] for a, b in pairs} | {b: record.signals[a] for a, b in pairs}
    return record.with_signals(both)


@pytest.fixture(scope="module")
def truck(weaving: Record) -> Record:
    return with_wheels(weaving)


@pytest.mark.parametrize("axles", [["semitrailer.middle"], ["tractor.front"], ["semitrailer.middle", "tractor.front"]])
def test_exchanged_sides_of_an_axle(truck: Record, axles: list[str]) -> None:
    assert check(truck) == ()
    findings = check(exchanged(truck, *axles))
    assert [(f.fault, f.severity) for f in findings] == [(Fault.EXCHANGED, "error")] * len(axles)
    sides = {(f"wheel_speed.{axle}.right", (f"wheel_speed.{axle}.left",)) for axle in axles}
    assert {(f.signal, f.others) for f in findings} == sides
    assert all(f.message.endswith("exchange the columns of both in signals.toml") for f in findings)


def test_without_other_signals_the_yaw_rate_may_be_inverted(truck: Record) -> None:
    """Only a yaw rate of the trailer and its wheel speeds; no third signal says which one is wrong."""
    names = ("speed", RATE2, "wheel_speed.semitrailer.middle.left", "wheel_speed.semitrailer.middle.right")
    alone = replace(truck, signals={name: truck.signals[name] for name in names})
    assert check(alone) == ()
    (finding,) = check(exchanged(alone, "semitrailer.middle"))
    assert finding.message.endswith(f"exchange the columns of both in signals.toml, or invert {RATE2}: sign = -1")


def test_an_inverted_gyro_is_no_exchange(truck: Record) -> None:
    (finding,) = check(truck.with_signals({RATE: -truck.signals[RATE]}))
    assert (finding.signal, finding.fault) == (RATE, Fault.SWAPPED_SIGN)


def test_driven_wheels_do_not_count(truck: Record) -> None:
    """No estimator uses their difference."""
    assert check(exchanged(truck, "tractor.drive")) == ()


@pytest.mark.parametrize("late", [0.1, 0.6, 1.2])
def test_late_wheel_speeds_are_not_exchanged(weaving: Record, late: float) -> None:
    assert check(with_wheels(weaving, late=late)) == ()


def test_nothing_is_said_without_a_turn(weaving: Record) -> None:
    """On a straight road, where the wheel speeds are noise, and in a log of less than 6 s."""
    noise = np.random.default_rng(3).standard_normal((3, len(weaving)))
    signals = dict(zip((STEER, RATE, RATE2), noise * [[5e-4], [4e-3], [4e-3]], strict=True))
    straight = replace(weaving, signals={"speed": weaving.signals["speed"], **signals})
    assert check(exchanged(with_wheels(straight), "tractor.front")) == ()
    for duration, count in ((5.9, 0), (6.5, 1)):
        short = with_wheels(weaving.cut(start=10.0, stop=10.0 + duration))
        assert len(check(exchanged(short, "tractor.front"))) == count


@pytest.mark.parametrize("noise", [0.02, 0.1])
def test_nothing_is_said_of_wheel_speeds_that_show_no_turn(weaving: Record, noise: float) -> None:
    assert check(with_wheels(weaving, noise=noise, differences=0.0)) == ()
    for start in np.arange(2.0, 33.0, 3.0).tolist():
        assert not check(with_wheels(weaving.cut(start=start, stop=start + 7.0), noise=noise, differences=0.0))
