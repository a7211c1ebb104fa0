"""Plausibility of a record: every fault is injected, and both sides of every limit."""

import numpy as np
import pytest

import fifthwheel as fw
from fifthwheel.base.errors import SignalError
from fifthwheel.data.checks import Fault, check, raise_errors
from fifthwheel.data.logs import SignalMap, read_log
from fifthwheel.data.logs.signal_map import SignalSource
from fifthwheel.data.record import Record
from tests.data.checks.test_samples import TIME, of
from tests.data.logs.conftest import weaving_truck

STEER, RATE, RATE2 = "steer.tractor.front", "yaw_rate.tractor", "yaw_rate.semitrailer"
HITCH, ACCELERATION = "articulation.semitrailer", "lateral_acceleration.tractor"
WHEEL, ROLL = "wheel_speed.tractor.front.left", "roll_rate.semitrailer"


def scaled(name, factor, offset=0.0):
    return lambda record: record.with_signals({name: factor * record.signals[name] + offset})


def between(name, start, stop, value):
    """The signal replaced by a value from start to stop, s; by its value at start if the value is None."""

    def inject(record):
        values, inside = record.signals[name].copy(), (record.time >= start) & (record.time < stop)
        values[inside] = values[inside][0] if value is None else value
        return record.with_signals({name: values})

    return inject


def spiked(record):
    values = record.signals[RATE].copy()
    values[[400, 900, 1500]] += [0.6, -0.8, 0.5]
    return record.with_signals({RATE: values})


def incomplete(record):
    random = np.random.default_rng(2)
    return record.with_signals({RATE: np.where(random.random(len(record)) < 0.6, np.nan, record.signals[RATE])})


def unrelated(name):
    t = np.arange(0, 40, 0.02)
    return lambda record: record.with_signals({name: 0.08 * np.sin(5.1 * t) * np.cos(0.31 * t)})


INJECTED = [
    (Fault.DROPOUT, RATE2, "warning", between(RATE2, 12, 15, np.nan)),
    (Fault.DROPOUT, RATE2, "error", between(RATE2, 10, 35, np.nan)),
    (Fault.DROPOUT, RATE, "error", incomplete),
    (Fault.DROPOUT, RATE, "error", between(RATE, 0, 99, np.nan)),
    (Fault.SPIKE, RATE, "warning", spiked),
    (Fault.STUCK, RATE, "warning", between(RATE, 12, 15, None)),
    (Fault.STUCK, RATE2, "error", between(RATE2, 8, 40, None)),
    (Fault.STUCK, STEER, "warning", between(STEER, 10, 13.5, None)),
    (Fault.STUCK, HITCH, "error", between(HITCH, 0, 40, 0.0)),
    (Fault.ZERO_SPEED, "speed", "error", scaled("speed", 0.0)),
    (Fault.ZERO_SPEED, "speed", "warning", between("speed", 0, 4, 1.0)),
    (Fault.OUT_OF_RANGE, ACCELERATION, "error", scaled(ACCELERATION, 100)),
    (Fault.OUT_OF_RANGE, "speed", "error", scaled("speed", 1000)),
    (Fault.DEGREES, STEER, "error", scaled(STEER, 180 / np.pi)),
    (Fault.DEGREES, RATE, "error", scaled(RATE, 180 / np.pi)),
    (Fault.DEGREES, RATE2, "error", scaled(RATE2, 180 / np.pi)),
    (Fault.DEGREES, HITCH, "error", scaled(HITCH, 180 / np.pi)),
    (Fault.UNIT, "speed", "error", scaled("speed", 3.6)),
    (Fault.UNIT, ACCELERATION, "error", scaled(ACCELERATION, 1 / 9.81)),
    (Fault.STEERING_WHEEL, STEER, "error", scaled(STEER, 18)),
    (Fault.STEERING_WHEEL, STEER, "error", scaled(STEER, 18 * 180 / np.pi)),
    (Fault.SWAPPED_SIGN, "speed", "error", scaled("speed", -1)),
    *((Fault.SWAPPED_SIGN, name, "error", scaled(name, -1)) for name in (STEER, RATE, RATE2, HITCH, ACCELERATION)),
    (Fault.WRONG_COLUMN, STEER, "error", unrelated(STEER)),
    (Fault.WRONG_COLUMN, RATE, "error", unrelated(RATE)),
    (Fault.WRONG_COLUMN, RATE2, "error", unrelated(RATE2)),
    (Fault.GAIN, STEER, "warning", scaled(STEER, 3)),
    (Fault.OFFSET, STEER, "warning", scaled(STEER, 1, 0.04)),
    (Fault.OFFSET, HITCH, "warning", scaled(HITCH, 1, -0.06)),
    (Fault.DUPLICATE, RATE2, "error", lambda record: record.with_signals({RATE2: 1.01 * record.signals[RATE] + 1e-3})),
]


def test_every_fault_is_injected():
    by_model = {Fault.EXCHANGED, Fault.TIME_OFFSET, Fault.CLOCK_RATE, Fault.MASS}  # tests/estimate
    assert {fault for fault, *_ in INJECTED} == set(Fault) - {Fault.UNKNOWN_UNIT, Fault.UNUSED} - by_model


def driven(record, *names):
    """The record with constant signals of driving."""
    return record.with_signals({name: np.ones(len(record)) for name in names})


def test_engine_signals_are_used_by_the_mass_from_driving(weaving):
    assert not check(driven(weaving, "engine_speed", "engine_torque", "braking.tractor", "braking.tractor.retarder"))
    (finding,) = check(driven(weaving, "engine_speed", "friction_torque", "braking.tractor"))
    assert (finding.fault, finding.others) == (Fault.UNUSED, ("friction_torque",))
    assert "engine_torque is missing for it; map that in signals.toml too" in finding.message
    record = driven(weaving, "engine_speed", "engine_torque", "braking.tractor")
    torque = np.where((record.time > 2.0) & (record.time < 0.8 * record.time[-1]), np.nan, 1.0)
    (finding,) = check(record.with_signals({"engine_torque": torque}))
    assert (finding.fault, finding.severity) == (Fault.DROPOUT, "warning")
    assert finding.message.endswith("the mass from driving leaves these times out, and nothing else uses it")


@pytest.mark.parametrize(
    ("fault", "signal", "severity", "inject"), INJECTED, ids=lambda v: getattr(v, "name", getattr(v, "__name__", v))
)
def test_exactly_the_injected_fault_is_found(weaving, fault, signal, severity, inject):
    """Its remedy is in keys of the signal map, which are in the message."""
    findings = check(inject(weaving))
    assert [(f.fault, f.signal, f.severity) for f in findings] == [(fault, signal, severity)]
    message, remedy = findings[0].message, findings[0].remedy
    assert message.startswith(f"{signal}: ")
    assert "; " in message or fault is Fault.SPIKE  # which needs no action
    SignalSource.model_validate({"column": "x", **remedy})
    assert all(f"{key} = " in message for key in remedy)
    assert remedy or fault not in (Fault.DEGREES, Fault.UNIT, Fault.SWAPPED_SIGN, Fault.OFFSET)
    if fault in (Fault.SWAPPED_SIGN, Fault.DEGREES):
        angle = "deg" if signal in (STEER, HITCH) else "deg/s"
        assert remedy == ({"sign": -1} if fault is Fault.SWAPPED_SIGN else {"unit": angle})
    if severity == "error":
        with pytest.raises(SignalError, match=f"^{signal}: "):
            raise_errors(findings)
    else:
        raise_errors(findings)


def test_units_and_axles_that_the_vehicle_does_not_have(weaving):
    units = {"units": ["tractor", "semitrailer"], "steered": ["steer.tractor.front"]}
    assert check(weaving, **units) == ()
    signals = {"roll_rate.trailer": 0.1 * weaving.signals[RATE2], "steer.tractor.fron": weaving.signals[STEER]}
    unit, axle = [f.message for f in check(weaving.with_signals(signals), **units) if f.fault is Fault.UNKNOWN_UNIT]
    assert "named 'trailer'; rename the signal in signals.toml, did you mean 'semitrailer'" in unit
    assert "did you mean 'steer.tractor.front'?" in axle


def rows(record, keep, time=None):
    """The record with some rows, at other times if they are given."""
    return Record(
        time=(record.time if time is None else time)[keep], signals={n: v[keep] for n, v in record.signals.items()}
    )


ALL = slice(None)
FIRST = {
    "gyros exchanged": (
        lambda r: r.with_signals({RATE: r.signals[RATE2], RATE2: r.signals[RATE]}),
        (RATE2, Fault.WRONG_COLUMN, "swap the two columns"),
    ),
    "m/s as km/h": (
        lambda r: scaled("speed", 1 / 3.6)(weaving_truck(speed=25.0)),
        ("speed", Fault.UNIT, 'set unit = "m/s"'),
    ),
    "slow run in km/h": (
        lambda r: scaled("speed", 3.6)(with_wheels_and_roll(weaving_truck(speed=9.0))),
        ("speed", Fault.UNIT, ""),
    ),
    "time in ms": (lambda r: rows(r, r.time < 5, 1e-3 * r.time), ("time", Fault.UNIT, "")),
    "gap of all": (lambda r: rows(r, (r.time < 10) | (r.time > 13)), ("time", Fault.DROPOUT, "")),
    "one damaged timestamp, which must not need memory": (
        lambda r: rows(between(RATE, 3, 3.1, np.nan)(r), ALL, np.append(r.time[:-1], 4e12)),
        ("time", Fault.DROPOUT, ""),
    ),
    "start of daylight saving time": (
        lambda r: rows(r, ALL, r.time + 3600.0 * (r.time > 20)),
        ("time", Fault.DROPOUT, "one hour, as at the start of daylight saving time"),
    ),
    "steering wheel by its magnitude alone": (
        lambda r: Record(time=r.time, signals={STEER: 40 * r.signals[STEER], "speed": r.signals["speed"]}),
        (STEER, Fault.STEERING_WHEEL, ""),
    ),
    "roll inverted": (lambda r: with_wheels_and_roll(r, roll=-1), (ROLL, Fault.SWAPPED_SIGN, "")),
    "roll in degrees": (lambda r: with_wheels_and_roll(r, roll=180 / np.pi), (ROLL, Fault.DEGREES, "")),
    "wheel in km/h": (lambda r: with_wheels_and_roll(r, wheel=3.6), (WHEEL, Fault.UNIT, "")),
    "wheel at half the speed": (lambda r: with_wheels_and_roll(r, wheel=0.5), ("speed", Fault.UNIT, "")),
}


@pytest.mark.parametrize("case", FIRST)
def test_the_first_finding(weaving, case):
    change, (signal, fault, text) = FIRST[case]
    first = check(change(weaving))[0]
    assert (first.signal, first.fault) == (signal, fault)
    assert text in first.message


def in_bursts(record):
    """Two gyros 1 ms apart, as on a bus, and inputs between their samples."""
    time = np.sort(np.concatenate([record.time, record.time + 1e-3]))
    first = np.arange(time.size) % 2 == 0
    signals = {n: np.interp(time, record.time, v, right=np.nan) for n, v in record.signals.items()}
    signals[RATE], signals[RATE2] = np.where(first, signals[RATE], np.nan), np.where(first, np.nan, signals[RATE2])
    assert Record(time=time, signals=signals).rate == pytest.approx(100, rel=0.01)
    return Record(time=time, signals=signals)


def repeated_and_quantised(record):
    held = record.signals[STEER][np.arange(len(record)) // 10 * 10]
    return record.with_signals({STEER: np.round(held / 0.002) * 0.002})


def straight(record):
    """Noise, without a turn."""
    random = np.random.default_rng(1)
    signals = {name: 1e-3 * random.standard_normal(len(record)) for name in record.signals}
    return record.with_signals(signals | {"speed": record.signals["speed"]})


SOUND = {
    "weaving slowly": lambda r: weaving_truck(speed=8.0, rate=10),
    "weaving with noise": lambda r: weaving_truck(speed=28.0, rate=100, noise=3, seed=28),
    "weaving without noise": lambda r: weaving_truck(speed=28.0, rate=20, noise=0),
    "wheel speeds and roll rates": lambda r: with_wheels_and_roll(r),
    "a slower channel": lambda r: r.with_signals(
        {RATE2: np.where(np.arange(len(r)) % 10 == 3, r.signals[RATE2], np.nan)}
    ),
    "bursts": in_bursts,
    "a repeated and quantised steer angle": repeated_and_quantised,
    "noise in straight driving": straight,
    "a steer angle of 0 in it": lambda r: straight(r).with_signals({STEER: np.zeros(len(r))}),
    "hardly a sample": lambda r: r.cut(0, 0.03),
    **{
        f"only {names}": lambda r, names=names: Record(time=r.time, signals={n: r.signals[n] for n in names})
        for names in ((STEER,), (RATE,), ("speed",), ("speed", STEER), (STEER, RATE), ("speed", RATE2, HITCH))
    },
}


@pytest.mark.parametrize("case", SOUND)
def test_a_record_without_faults_passes(weaving, case):
    assert check(SOUND[case](weaving), wheelbase=4.0) == ()


@pytest.mark.parametrize("run", ["run01_s_bend", "run02_exit_ramp"])
def test_a_real_truck_has_no_errors(data, run):
    names = {"speed": "vx", STEER: "steer_ang", RATE: "yaw_rate", HITCH: "hitch", ACCELERATION: "imu_accel_y"}
    names[RATE2] = {"sum": ["yaw_rate", "hitch_rate"]}
    source = {"signals": names, "reference": {"lateral_velocity.tractor": "vy"}}
    record = read_log(data / "real_truck" / f"{run}.csv", SignalMap.model_validate(source))
    assert list(record.reference) == ["lateral_velocity.tractor"]
    findings = check(record)
    raise_errors(findings)
    assert {(f.signal, f.fault) for f in findings} <= {(ACCELERATION, Fault.SPIKE)}
    for signal in (STEER, RATE, RATE2, HITCH, ACCELERATION) if run == "run02_exit_ramp" else ():
        errors = [f for f in check(scaled(signal, -1)(record)) if f.severity == "error"]
        assert [(f.signal, f.fault) for f in errors] == [(signal, Fault.SWAPPED_SIGN)]


def with_wheels_and_roll(record, *, wheel=1.0, roll=1.0):
    """With wheel speeds, and the roll rate of a body that rolls by 0.03 rad at 1 m/s^2, multiplied by the factors."""
    random = np.random.default_rng(3)
    speed = record.signals["speed"]
    smooth = np.convolve(speed * record.signals[RATE], np.ones(25) / 25)[: len(record)]  # with a lag
    roll_rate = 0.03 * np.gradient(smooth, record.time) + 0.005 * random.standard_normal(len(record))
    return record.with_signals({WHEEL: wheel * speed, ROLL: roll * roll_rate})


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


def test_the_time_base():
    """A pause above half a second and five steps; at most 20 kHz."""
    pauses = [(step, limit + edge, edge > 0) for step, limit in ((0.02, 0.5), (0.2, 1.0)) for edge in (-0.01, 0.01)]
    for step, pause, found in pauses:
        time = step * np.r_[np.arange(50), 49 + np.arange(50) + pause / step]
        findings = check(Record(time=time, signals={"speed": np.full(time.size, 20.0)}))
        assert [f.fault for f in findings] == [Fault.DROPOUT] * found
    for rate, found in ((1.9e4, False), (2.1e4, True)):
        findings = check(Record(time=np.arange(1000) / rate, signals={"speed": np.full(1000, 20.0)}))
        assert [(f.fault, f.severity) for f in findings] == [(Fault.UNIT, "error")] * found


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


def test_roll_angles_of_a_stiff_coupling_are_no_copies():
    """Results of a simulation, without noise: about 5 % more roll of the semitrailer, in proportion."""
    truck = fw.vehicle("cheng_cebon_2011")
    record = fw.simulate(truck, manoeuvre="slowly_increasing_steer", seed=1)
    for digits in (16, 4):
        rolls = {f"roll.{unit.name}": np.round(record.reference[f"roll.{unit.name}"], digits) for unit in truck.units}
        assert not check(record.with_signals(rolls))
        (same,) = check(record.with_signals(rolls | {"roll.semitrailer": rolls["roll.tractor"]}))
        assert (same.fault, same.others) == (Fault.DUPLICATE, ("roll.tractor",))
