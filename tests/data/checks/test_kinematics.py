"""The comparison of a signal with the leading yaw rate: both sides of every limit, and its parts against SciPy."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal as filters

from fifthwheel.base.types import Array
from fifthwheel.data.checks import Fault, check
from fifthwheel.data.checks.kinematics import (
    Relation,
    kinematic_findings,
    relations,
)
from fifthwheel.data.record import Record
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import get

STEER, RATE, RATE2 = "steer.tractor.front", "yaw_rate.tractor", "yaw_rate.semitrailer"
HITCH, ACCELERATION, ROLL = "articulation.semitrailer", "lateral_acceleration.tractor", "roll_rate.semitrailer"
WHEELS = "wheel_speed_difference.semitrailer"

GOOD = Relation(
    signal=STEER, leading=RATE, correlation=0.99, coherence=0.99, best=0.99, inverted=0.0, lead=0.0, gain=1.0,
    gain_sigma=0.0, offset=0.0, excited=True, wheelbase=4.5,
)  # fmt: skip


def test_the_fault_of_a_relation():
    """Without excitation only a wrong unit is one."""
    turned = {"correlation": -0.9, "inverted": 1.0}
    for name, fields, excited, otherwise in [
        (STEER, {"coherence": 0.29, "correlation": 0.1}, Fault.WRONG_COLUMN, None),
        (STEER, turned, Fault.SWAPPED_SIGN, None),
        (STEER, turned | {"inverted": 0.98}, None, None),
        (RATE2, {"lead": 0.41}, Fault.WRONG_COLUMN, None),
        (RATE2, {"lead": 0.39}, None, None),
        (STEER, {"gain": 18, "lead": 1.0}, Fault.STEERING_WHEEL, Fault.STEERING_WHEEL),
        (STEER, {"gain": 18, "correlation": 0.79}, None, None),
        (STEER, {"gain": 40}, Fault.DEGREES, Fault.DEGREES),
        (STEER, {"gain": 301}, Fault.STEERING_WHEEL, Fault.STEERING_WHEEL),
        (RATE2, {"gain": 18}, None, None),
        *((STEER, {"gain": gain}, Fault.GAIN, None) for gain in (0.34, 2.3)),
        *((STEER, {"gain": gain}, None, None) for gain in (0.36, 2.1)),
        (HITCH, {"gain": 57} | turned, Fault.SWAPPED_SIGN, Fault.DEGREES),
        *((ACCELERATION, {"gain": gain}, Fault.UNIT, Fault.UNIT) for gain in (0.06, 0.39, 2.6, 4.9)),
        *((ACCELERATION, {"gain": gain}, None, None) for gain in (0.41, 2.4, 5.1, 57)),
        (STEER, {"offset": 0.021}, Fault.OFFSET, None),
        (STEER, {"offset": 0.019}, None, None),
        (STEER, {"gain": 0.01}, Fault.DEGREES, Fault.DEGREES),
        (ROLL, {"gain": 57}, Fault.DEGREES, Fault.DEGREES),
        (ROLL, {"gain": 3, "offset": 1.0, "lead": 1.0, "coherence": 0.1, "correlation": 0.1}, None, None),
        *(
            (WHEELS, {"inverted": 0.9, "best": best}, fault, None)
            for best, fault in ((0, Fault.SWAPPED_SIGN), (0.91, None))
        ),
    ]:
        relation = replace(GOOD, signal=name, **fields)
        assert (relation.fault, replace(relation, excited=False).fault) == (excited, otherwise), (name, fields)


def lagged(values, time_constant, step=0.05):
    weight = step / (time_constant + step)
    return filters.lfilter([weight], [1, weight - 1], values, zi=[(1 - weight) * values[0]])[0]


def test_the_relations_of_a_known_turn():
    """All signals by the stated equations at constant speed, solved by SciPy: correlation 1, gain 1, offset 0."""
    time = np.arange(0, 60, 0.05)
    u, wheelbase = 16.0, 3.7
    rate = 0.05 * np.sin(0.7 * time) + 0.03 * np.sin(0.21 * time + 1)
    towed = lagged(rate, 8.0 / u)
    acceleration = u * rate
    roll = 0.03 * np.gradient(lagged(lagged(u * towed, 0.15), 0.15), 0.05)
    exact = {RATE2: towed, HITCH: -towed * 8.0 / u, ACCELERATION: acceleration, ROLL: roll}
    record = Record(time=time, signals={"speed": np.full(time.size, u), RATE: rate, **exact})
    found = {r.signal: r for r in relations(record, wheelbase=wheelbase, min_speed=5.0)}
    assert set(found) == set(exact)
    for r in found.values():
        assert (r.leading, r.wheelbase, r.excited, r.lead) == (RATE, wheelbase, True, 0.0)
        assert (r.correlation, r.coherence) == pytest.approx((1.0, 1.0), abs=1e-4)
        assert r.gain == pytest.approx(1.0, rel=1e-3)
        assert r.offset == pytest.approx(0.0, abs=1e-4)
    steer = rate * (wheelbase + 0.004 * u**2) / u
    later = record.with_signals({STEER: np.interp(time + 0.25, time, steer), RATE2: np.interp(time + 0.6, time, towed)})
    found = {r.signal: r for r in relations(later, wheelbase=wheelbase, min_speed=5.0)}
    assert found[STEER].gain == pytest.approx(1.0, abs=0.03)
    assert found[STEER].correlation > 0.995
    assert found[RATE2].lead == pytest.approx(0.6)
    turned = record.with_signals({RATE2: 0.05 - 2 * towed})
    (found,) = (r for r in relations(turned, wheelbase=wheelbase, min_speed=5.0) if r.signal == RATE2)
    assert (found.correlation, found.gain) == pytest.approx((-1.0, 2.0), rel=1e-3)
    assert found.offset == pytest.approx(0.05, rel=0.01)


def test_only_fast_and_common_samples_are_compared():
    """More than three seconds above the lowest and below the highest speed, and with the yaw rate."""
    time = np.arange(0, 40, 0.05)
    rate, fast = 0.1 * np.sin(time), np.full(800, 20.0)
    for speed, trailer, count in [
        (fast, rate, 1),
        *((np.where(time < end, fast, wrong), rate, end > 3) for end in (2.8, 3.1) for wrong in (4.9, 46.0)),
        (fast, np.where(time < 3.0, rate, np.nan), 1),  # 0.5 s longer
        (fast, np.where(time < 2.2, rate, np.nan), 0),
    ]:
        record = Record(time=time, signals={"speed": speed, RATE: rate, RATE2: trailer})
        assert len(list(relations(record, wheelbase=4.0, min_speed=5.0))) == count


@pytest.mark.parametrize("wrong", [(RATE,), (STEER,), (STEER, HITCH)])
def test_the_smallest_number_of_swapped_signs_explains_all(weaving, wrong):
    """Of five signals that contradict each other, the fewest are wrong."""
    swapped = weaving.with_signals({name: -weaving.signals[name] for name in wrong})
    findings = list(kinematic_findings(swapped, wheelbase=4.0, min_speed=5.0))
    assert {f.signal for f in findings} == set(wrong)
    assert {f.fault for f in findings} == {Fault.SWAPPED_SIGN}


@pytest.mark.parametrize(
    ("gain", "text"),
    [
        (27.9, "set gain = 1 / steering ratio"),
        (28.1, 'unit = "deg" or gain'),
        (37.9, 'unit = "deg" or gain'),
        (301.0, 'unit = "deg" and gain'),
    ],
)
def test_how_a_steering_wheel_angle_is_corrected(weaving, gain, text):
    (relation,) = (r for r in relations(weaving, wheelbase=4.0, min_speed=5.0) if r.signal == STEER)
    scaled = weaving.with_signals({STEER: gain / relation.gain * weaving.signals[STEER]})
    (finding,) = (f for f in kinematic_findings(scaled, wheelbase=4.0, min_speed=5.0) if f.signal == STEER)
    assert (finding.fault, finding.severity) == (Fault.STEERING_WHEEL, "error")
    assert f"{gain:.0f} times the value expected" in finding.message
    assert text in finding.message


def test_a_trailer_that_lags_by_half_a_period_is_not_inverted() -> None:
    truck = get("truck_full_trailer")
    record = simulate(truck, manoeuvre="sweep", duration=20.0)
    found = list(relations(record, wheelbase=4.0, min_speed=3.0))
    trailer = next(relation for relation in found if relation.signal == "yaw_rate.trailer")
    assert trailer.correlation < -0.5
    assert not [r.signal for r in found if r.fault in (Fault.SWAPPED_SIGN, Fault.WRONG_COLUMN)]


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


@pytest.mark.parametrize("axles", [["semitrailer.middle"], ["semitrailer.middle", "tractor.front"]])
def test_exchanged_sides_of_an_axle(truck: Record, axles: list[str]) -> None:
    """Driven wheels do not count: no estimator uses their difference."""
    assert check(truck) == check(exchanged(truck, "tractor.drive")) == ()
    findings = check(exchanged(truck, *axles))
    assert [(f.fault, f.severity) for f in findings] == [(Fault.EXCHANGED, "error")] * len(axles)
    sides = {(f"wheel_speed.{axle}.right", (f"wheel_speed.{axle}.left",)) for axle in axles}
    assert {(f.signal, f.others) for f in findings} == sides
    assert all(f.message.endswith("exchange the columns of both in signals.toml") for f in findings)
    (finding,) = check(truck.with_signals({RATE: -truck.signals[RATE]}))
    assert (finding.signal, finding.fault) == (RATE, Fault.SWAPPED_SIGN)


def test_without_other_signals_the_yaw_rate_may_be_inverted(truck: Record) -> None:
    """Only a yaw rate of the trailer and its wheel speeds; no third signal says which one is wrong."""
    names = ("speed", RATE2, "wheel_speed.semitrailer.middle.left", "wheel_speed.semitrailer.middle.right")
    alone = replace(truck, signals={name: truck.signals[name] for name in names})
    assert check(alone) == ()
    (finding,) = check(exchanged(alone, "semitrailer.middle"))
    assert finding.message.endswith(f"exchange the columns of both in signals.toml, or invert {RATE2}: sign = -1")


def test_nothing_is_said_without_a_turn(weaving: Record) -> None:
    """On a straight road, where the wheel speeds are noise, in less than 6 s, of late wheel speeds, or of those that
    show no turn."""
    noise = np.random.default_rng(3).standard_normal((3, len(weaving)))
    signals = dict(zip((STEER, RATE, RATE2), noise * [[5e-4], [4e-3], [4e-3]], strict=True))
    straight = replace(weaving, signals={"speed": weaving.signals["speed"], **signals})
    assert check(exchanged(with_wheels(straight), "tractor.front")) == ()
    for duration, count in ((5.9, 0), (6.5, 1)):
        short = with_wheels(weaving.cut(start=10.0, stop=10.0 + duration))
        assert len(check(exchanged(short, "tractor.front"))) == count
    for late in (0.1, 0.6, 1.2):
        assert check(with_wheels(weaving, late=late)) == ()
    for start in (2.0, 11.0, 20.0, 29.0):
        assert not check(with_wheels(weaving.cut(start=start, stop=start + 7.0), noise=0.1, differences=0.0))
