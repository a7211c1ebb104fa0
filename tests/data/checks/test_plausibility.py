"""Plausibility of a record: every fault is injected, and both sides of every limit."""

from dataclasses import replace

import numpy as np
import pytest

import fifthwheel as fw
from fifthwheel.base.errors import SignalError
from fifthwheel.data.checks import Fault, Finding, check, raise_errors
from fifthwheel.data.logs import SignalMap, read_log
from fifthwheel.data.logs.signal_map import SignalSource
from fifthwheel.data.record import Record
from tests.data.checks.test_samples import TIME, of
from tests.data.logs.conftest import weaving_truck

STEER, RATE, RATE2 = "steer.tractor.front", "yaw_rate.tractor", "yaw_rate.semitrailer"
HITCH, ACCELERATION = "articulation.semitrailer", "lateral_acceleration.tractor"


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
    assert finding.message == (
        "engine_speed: only the mass from driving uses it and friction_torque, and engine_torque is missing for it;"
        " map that in signals.toml too"
    )


def test_missing_samples_of_an_engine_signal_refuse_no_log(weaving):
    record = driven(weaving, "engine_speed", "engine_torque", "braking.tractor")
    torque = np.where((record.time > 2.0) & (record.time < 0.8 * record.time[-1]), np.nan, 1.0)
    (finding,) = check(record.with_signals({"engine_torque": torque}))
    assert (finding.fault, finding.severity) == (Fault.DROPOUT, "warning")
    assert finding.message.endswith("the mass from driving leaves these times out, and nothing else uses it")


@pytest.mark.parametrize(
    ("fault", "signal", "severity", "inject"), INJECTED, ids=lambda v: getattr(v, "name", getattr(v, "__name__", v))
)
def test_exactly_the_injected_fault_is_found(weaving, fault, signal, severity, inject):
    findings = check(inject(weaving))
    assert [(f.fault, f.signal, f.severity) for f in findings] == [(fault, signal, severity)]
    assert findings[0].message.startswith(f"{signal}: ")
    assert "; " in findings[0].message or fault is Fault.SPIKE  # which needs no action
    if severity == "error":
        with pytest.raises(SignalError, match=f"^{signal}: "):
            raise_errors(findings)
    else:
        raise_errors(findings)


@pytest.mark.slow
def test_a_remedy_is_in_keys_of_the_signal_map(weaving):
    """SignalSource accepts the keys, and the message contains them."""
    for fault, _, _, inject in INJECTED:
        for finding in check(inject(weaving)):
            SignalSource.model_validate({"column": "x", **finding.remedy})
            assert all(f"{key} = " in finding.message for key in finding.remedy)
            assert finding.remedy or fault not in (Fault.DEGREES, Fault.UNIT, Fault.SWAPPED_SIGN, Fault.OFFSET)


@pytest.mark.parametrize("signal", [STEER, RATE, RATE2, HITCH, ACCELERATION])
def test_the_remedy_removes_a_swapped_sign_and_degrees(weaving, signal):
    (finding,) = check(scaled(signal, -1)(weaving))
    assert check(scaled(signal, -finding.remedy["sign"])(weaving)) == ()
    if signal != ACCELERATION:
        (finding,) = check(scaled(signal, 180 / np.pi)(weaving))
        assert finding.remedy["unit"] == ("deg" if signal in (STEER, HITCH) else "deg/s")


def test_units_and_axles_that_the_vehicle_does_not_have(weaving):
    units = {"units": ["tractor", "semitrailer"], "steered": ["steer.tractor.front"]}
    assert check(weaving, **units) == ()
    values = weaving.signals[RATE2]
    unknown = weaving.with_signals({"roll_rate.trailer": 0.1 * values, "steer.tractor.fron": weaving.signals[STEER]})
    messages = [str(f) for f in check(unknown, **units) if f.fault is Fault.UNKNOWN_UNIT]
    assert len(messages) == 2
    assert (
        "has no tractor or trailer named 'trailer'; rename the signal in signals.toml, did you mean 'semitrailer'"
        in messages[0]
    )
    assert "did you mean 'steer.tractor.front'?" in messages[1]


def test_gyros_of_tractor_and_trailer_exchanged(weaving):
    exchanged = weaving.with_signals({RATE: weaving.signals[RATE2], RATE2: weaving.signals[RATE]})
    findings = [f for f in check(exchanged) if f.severity == "error"]
    assert (findings[0].signal, findings[0].fault) == (RATE2, Fault.WRONG_COLUMN)
    assert "swap the two columns" in findings[0].message


def test_a_speed_in_m_per_s_read_as_km_per_h(weaving):
    findings = check(scaled("speed", 1 / 3.6)(weaving_truck(speed=25.0)))
    assert (findings[0].signal, findings[0].fault) == ("speed", Fault.UNIT)
    assert 'set unit = "m/s"' in findings[0].message


def test_a_time_in_the_wrong_unit_is_found(weaving):
    part = weaving.cut(0, 5)
    short = Record(time=part.time * 1e-3, signals=part.signals)
    assert ("time", Fault.UNIT) in [(f.signal, f.fault) for f in check(short) if f.severity == "error"]


def test_a_steering_wheel_angle_is_found_by_its_magnitude(weaving):
    alone = Record(time=weaving.time, signals={STEER: 40 * weaving.signals[STEER], "speed": weaving.signals["speed"]})
    (finding,) = check(alone)
    assert (finding.signal, finding.fault) == (STEER, Fault.STEERING_WHEEL)


@pytest.mark.parametrize("speed", [8.0, 28.0])
@pytest.mark.parametrize(("rate", "noise"), [(10, 1), (100, 3), (20, 0)])
def test_a_record_without_faults_passes(speed, rate, noise):
    assert check(weaving_truck(speed=speed, rate=rate, noise=noise, seed=int(speed)), wheelbase=4.0) == ()


def test_noise_in_straight_driving_is_not_judged(weaving):
    random = np.random.default_rng(1)
    signals = {name: 1e-3 * random.standard_normal(len(weaving)) for name in weaving.signals}
    straight = weaving.with_signals(signals | {"speed": weaving.signals["speed"]})
    assert check(straight) == ()
    assert check(straight.with_signals({STEER: np.zeros(len(weaving))})) == ()


def test_a_repeated_and_quantised_steer_angle_is_not_stuck(weaving):
    held = weaving.signals[STEER][np.arange(len(weaving)) // 10 * 10]
    assert check(weaving.with_signals({STEER: np.round(held / 0.002) * 0.002})) == ()


def test_a_channel_of_a_slower_rate_is_no_dropout(weaving):
    slow = np.where(np.arange(len(weaving)) % 10 == 3, weaving.signals[RATE2], np.nan)
    assert check(weaving.with_signals({RATE2: slow})) == ()


def test_two_faults_at_once(weaving):
    findings = check(spiked(scaled(STEER, -1)(weaving)))
    assert [(f.signal, f.fault) for f in findings] == [(STEER, Fault.SWAPPED_SIGN), (RATE, Fault.SPIKE)]
    assert str(findings[1]).startswith("warning: yaw_rate.tractor: 3 spikes left out, the first")


def test_the_start_of_daylight_saving_time_is_named(weaving):
    time = weaving.time + 3600.0 * (weaving.time > 20)
    (finding,) = (f for f in check(Record(time=time, signals=weaving.signals)) if f.signal == "time")
    assert "one hour, as at the start of daylight saving time" in finding.message


def test_a_gap_of_the_time_base_is_found(weaving):
    keep = (weaving.time < 10) | (weaving.time > 13)
    with_gap = Record(time=weaving.time[keep], signals={n: v[keep] for n, v in weaving.signals.items()})
    assert [(f.signal, f.fault) for f in check(with_gap)] == [("time", Fault.DROPOUT)]


def test_records_with_few_signals_or_samples(weaving):
    for names in ([STEER], [RATE], ["speed"], ["speed", STEER], [STEER, RATE], ["speed", RATE2, HITCH]):
        assert check(Record(time=weaving.time, signals={n: weaving.signals[n] for n in names})) == ()
    assert check(weaving.cut(0, 0.03)) == ()
    assert isinstance(check(between("speed", 0, 99, np.nan)(weaving))[0], Finding)


MAP = """
[signals]
speed = "vx"
"steer.tractor.front" = "steer_ang"
"yaw_rate.tractor" = "yaw_rate"
"articulation.semitrailer" = "hitch"
"lateral_acceleration.tractor" = "imu_accel_y"
"yaw_rate.semitrailer" = {sum = ["yaw_rate", "hitch_rate"]}
[reference]
"lateral_velocity.tractor" = "vy"
"""


@pytest.mark.parametrize("run", ["run01_s_bend", "run02_exit_ramp"])
def test_a_real_truck_has_no_errors(data, run):
    record = read_log(data / "real_truck" / f"{run}.csv", SignalMap.parse(MAP))
    assert list(record.reference) == ["lateral_velocity.tractor"]
    findings = check(record)
    raise_errors(findings)
    assert {(f.signal, f.fault) for f in findings} <= {(ACCELERATION, Fault.SPIKE)}


@pytest.mark.parametrize("signal", [STEER, RATE, RATE2, HITCH, ACCELERATION])
def test_a_real_truck_with_a_swapped_sign(data, signal):
    record = read_log(data / "real_truck" / "run02_exit_ramp.csv", SignalMap.parse(MAP))
    errors = [f for f in check(scaled(signal, -1)(record)) if f.severity == "error"]
    assert [(f.signal, f.fault) for f in errors] == [(signal, Fault.SWAPPED_SIGN)]


def with_wheels_and_roll(record, *, wheel=1.0, roll=1.0):
    """With wheel speeds, and the roll rate of a body that rolls by 0.03 rad at 1 m/s^2, multiplied by the factors."""
    random = np.random.default_rng(3)
    speed, sideways = record.signals["speed"], record.signals["speed"] * record.signals[RATE]
    smooth = np.convolve(sideways, np.ones(25) / 25)[
        : len(record)
    ]  # the body rolls with a lag of a quarter of a second
    roll_rate = 0.03 * np.gradient(smooth, record.time) + 0.005 * random.standard_normal(len(record))
    return record.with_signals(
        {"wheel_speed.tractor.front.left": wheel * speed, "roll_rate.semitrailer": roll * roll_rate}
    )


def test_consistent_wheel_speeds_and_roll_rates_pass(weaving):
    assert check(with_wheels_and_roll(weaving)) == ()


@pytest.mark.parametrize(
    ("factors", "fault", "signal"),
    [
        ({"roll": -1}, Fault.SWAPPED_SIGN, "roll_rate.semitrailer"),
        ({"roll": 180 / np.pi}, Fault.DEGREES, "roll_rate.semitrailer"),
        ({"wheel": 3.6}, Fault.UNIT, "wheel_speed.tractor.front.left"),
        ({"wheel": 0.5}, Fault.UNIT, "speed"),
    ],
)
def test_inconsistent_wheel_speeds_and_roll_rates_are_found(weaving, factors, fault, signal):
    errors = [f for f in check(with_wheels_and_roll(weaving, **factors)) if f.severity == "error"]
    assert [(f.signal, f.fault) for f in errors][:1] == [(signal, fault)]


def test_a_slow_run_in_km_per_h(weaving):
    slow = with_wheels_and_roll(weaving_truck(speed=9.0))
    fast = slow.with_signals({"speed": 3.6 * slow.signals["speed"]})
    assert [(f.signal, f.fault) for f in check(fast) if f.fault is Fault.UNIT][:1] == [("speed", Fault.UNIT)]


def test_a_corrupted_timestamp_is_found_without_much_memory(weaving):
    time = np.append(weaving.time[:-1], 4e12)
    findings = check(Record(time=time, signals=weaving.signals))
    assert [(f.signal, f.fault) for f in findings] == [("time", Fault.DROPOUT)]
    with_gap = Record(time=time, signals=between(RATE, 3, 3.1, np.nan)(weaving).signals)
    assert {f.fault for f in check(with_gap)} == {Fault.DROPOUT}


def test_messages_that_come_in_bursts_are_complete(weaving):
    """Two gyros 1 ms apart, as on a bus, and inputs between their samples."""
    time = np.sort(np.concatenate([weaving.time, weaving.time + 1e-3]))
    first = np.arange(time.size) % 2 == 0
    signals = {n: np.interp(time, weaving.time, v, right=np.nan) for n, v in weaving.signals.items()}
    signals[RATE], signals[RATE2] = np.where(first, signals[RATE], np.nan), np.where(first, np.nan, signals[RATE2])
    record = Record(time=time, signals=signals)
    assert check(record) == ()
    assert record.rate == pytest.approx(100, rel=0.01)


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
