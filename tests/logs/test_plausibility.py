import numpy as np
import pytest

from fifthwheel.errors import SignalError
from fifthwheel.logs import Fault, Finding, Record, SignalMap, check, raise_errors, read
from fifthwheel.logs.samples import without_spikes

from .conftest import drive

STEER, RATE, RATE2 = "steer.tractor.front", "yaw_rate.tractor", "yaw_rate.semitrailer"
HITCH, ACCELERATION = "articulation.semitrailer", "lateral_acceleration.tractor"


def scaled(name, factor, offset=0.0):
    return lambda record: record.with_signals({name: factor * record.signals[name] + offset})


def between(name, start, stop, value):
    """The signal replaced by a value within start to stop, s; by the one it has there when the value is None."""

    def inject(record):
        values, inside = record.signals[name].copy(), (record.time >= start) & (record.time < stop)
        values[inside] = values[inside][0] if value is None else value
        return record.with_signals({name: values})

    return inject


def spiked(record):
    values = record.signals[RATE].copy()
    values[[400, 900, 1500]] += [0.6, -0.8, 0.5]
    return record.with_signals({RATE: values})


def thinned(record):
    random = np.random.default_rng(2)
    return record.with_signals({RATE: np.where(random.random(len(record)) < 0.6, np.nan, record.signals[RATE])})


def another(name):
    t = np.arange(0, 40, 0.02)
    return lambda record: record.with_signals({name: 0.08 * np.sin(5.1 * t) * np.cos(0.31 * t)})


INJECTED = [
    (Fault.DROPOUT, RATE2, "warning", between(RATE2, 12, 15, np.nan)),
    (Fault.DROPOUT, RATE2, "error", between(RATE2, 10, 35, np.nan)),
    (Fault.DROPOUT, RATE, "error", thinned),
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
    (Fault.WRONG_COLUMN, STEER, "error", another(STEER)),
    (Fault.WRONG_COLUMN, RATE, "error", another(RATE)),
    (Fault.WRONG_COLUMN, RATE2, "error", another(RATE2)),
    (Fault.GAIN, STEER, "warning", scaled(STEER, 3)),
    (Fault.OFFSET, STEER, "warning", scaled(STEER, 1, 0.04)),
    (Fault.OFFSET, HITCH, "warning", scaled(HITCH, 1, -0.06)),
]


def test_every_fault_is_injected():
    assert {fault for fault, *_ in INJECTED} == set(Fault) - {Fault.UNKNOWN_UNIT}  # that is below


@pytest.mark.parametrize(
    ("fault", "signal", "severity", "inject"), INJECTED, ids=lambda v: getattr(v, "name", getattr(v, "__name__", v))
)
def test_a_fault_is_found_and_nothing_else(a_drive, fault, signal, severity, inject):
    findings = check(inject(a_drive))
    assert [(f.fault, f.signal, f.severity) for f in findings] == [(fault, signal, severity)]
    assert findings[0].message.startswith(f"{signal}: ")
    assert "; " in findings[0].message
    if severity == "error":
        with pytest.raises(SignalError, match=f"^{signal}: "):
            raise_errors(findings)
    else:
        raise_errors(findings)


def test_units_and_axles_that_the_vehicle_does_not_have(a_drive):
    units = {"units": ["tractor", "semitrailer"], "steered": ["steer.tractor.front"]}
    assert check(a_drive, **units) == ()
    values = a_drive.signals[RATE2]
    strange = a_drive.with_signals({"roll_rate.trailer": 0.1 * values, "steer.tractor.fron": a_drive.signals[STEER]})
    found = [str(f) for f in check(strange, **units) if f.fault is Fault.UNKNOWN_UNIT]
    assert len(found) == 2
    assert "has no unit 'trailer'; did you mean 'semitrailer'" in found[0]
    assert "did you mean 'steer.tractor.front'?" in found[1]


def test_gyros_of_tractor_and_trailer_exchanged(a_drive):
    exchanged = a_drive.with_signals({RATE: a_drive.signals[RATE2], RATE2: a_drive.signals[RATE]})
    findings = [f for f in check(exchanged) if f.severity == "error"]
    assert (findings[0].signal, findings[0].fault) == (RATE2, Fault.WRONG_COLUMN)
    assert "look exchanged" in findings[0].message


def test_a_speed_in_metres_taken_for_kilometres(a_drive):
    findings = check(scaled("speed", 1 / 3.6)(drive(speed=25.0)))
    assert (findings[0].signal, findings[0].fault) == ("speed", Fault.UNIT)
    assert 'set unit = "m/s"' in findings[0].message


def test_a_time_in_the_wrong_unit_is_blamed(a_drive):
    short = Record(time=a_drive.time * 1e-3, signals=a_drive.signals)
    assert ("time", Fault.UNIT) in [(f.signal, f.fault) for f in check(short) if f.severity == "error"]


def test_a_steering_wheel_by_its_size_alone(a_drive):
    alone = Record(time=a_drive.time, signals={STEER: 40 * a_drive.signals[STEER], "speed": a_drive.signals["speed"]})
    (finding,) = check(alone)
    assert (finding.signal, finding.fault) == (STEER, Fault.STEERING_WHEEL)


@pytest.mark.parametrize("speed", [8.0, 14.0, 22.0, 28.0])
@pytest.mark.parametrize(("rate", "noise"), [(10, 1), (100, 3), (20, 0)])
def test_a_good_drive_passes(speed, rate, noise):
    assert check(drive(speed=speed, rate=rate, noise=noise, seed=int(speed)), wheelbase=4.0) == ()


def test_noise_on_a_straight_is_not_judged(a_drive):
    random = np.random.default_rng(1)
    signals = {name: 1e-3 * random.standard_normal(len(a_drive)) for name in a_drive.signals}
    straight = a_drive.with_signals(signals | {"speed": a_drive.signals["speed"]})
    assert check(straight) == ()
    assert check(straight.with_signals({STEER: np.zeros(len(a_drive))})) == ()


def test_a_held_and_quantised_steer_is_not_stuck(a_drive):
    held = a_drive.signals[STEER][np.arange(len(a_drive)) // 10 * 10]
    assert check(a_drive.with_signals({STEER: np.round(held / 0.002) * 0.002})) == ()


def test_a_channel_of_a_slower_rate_is_no_dropout(a_drive):
    slow = np.where(np.arange(len(a_drive)) % 10 == 3, a_drive.signals[RATE2], np.nan)
    assert check(a_drive.with_signals({RATE2: slow})) == ()


def test_two_faults_at_once(a_drive):
    findings = check(spiked(scaled(STEER, -1)(a_drive)))
    assert [(f.signal, f.fault) for f in findings] == [(STEER, Fault.SWAPPED_SIGN), (RATE, Fault.SPIKE)]
    assert str(findings[1]).startswith("warning: yaw_rate.tractor: 3 spikes, the first")


def test_a_hole_of_the_clock_is_told(a_drive):
    keep = (a_drive.time < 10) | (a_drive.time > 13)
    holed = Record(time=a_drive.time[keep], signals={n: v[keep] for n, v in a_drive.signals.items()})
    assert [(f.signal, f.fault) for f in check(holed)] == [("time", Fault.DROPOUT)]


def test_little_to_go_by(a_drive):
    for names in ([STEER], [RATE], ["speed"], ["speed", STEER], [STEER, RATE], ["speed", RATE2, HITCH]):
        assert check(Record(time=a_drive.time, signals={n: a_drive.signals[n] for n in names})) == ()
    assert check(a_drive.cut(0, 0.03)) == ()
    assert isinstance(check(between("speed", 0, 99, np.nan)(a_drive))[0], Finding)


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
    record = read(data / "real_truck" / f"{run}.csv", SignalMap.parse(MAP))
    assert list(record.reference) == ["lateral_velocity.tractor"]
    findings = check(record)
    raise_errors(findings)
    assert {(f.signal, f.fault) for f in findings} <= {(ACCELERATION, Fault.SPIKE)}


@pytest.mark.parametrize("signal", [STEER, RATE, RATE2, HITCH, ACCELERATION])
@pytest.mark.parametrize("run", ["run01_s_bend", "run02_exit_ramp"])
def test_a_real_truck_with_a_swapped_sign(data, run, signal):
    record = read(data / "real_truck" / f"{run}.csv", SignalMap.parse(MAP))
    errors = [f for f in check(scaled(signal, -1)(record)) if f.severity == "error"]
    assert [(f.signal, f.fault) for f in errors] == [(signal, Fault.SWAPPED_SIGN)]


def with_wheels_and_roll(record, *, wheel=1.0, roll=1.0):
    """Wheel speeds, and the roll rate of a body that leans by 0.03 rad at 1 m/s^2, in the units of the factors."""
    random = np.random.default_rng(3)
    speed, sideways = record.signals["speed"], record.signals["speed"] * record.signals[RATE]
    smooth = np.convolve(sideways, np.ones(25) / 25)[: len(record)]  # a body takes a quarter of a second
    lean = 0.03 * np.gradient(smooth, record.time) + 0.005 * random.standard_normal(len(record))
    return record.with_signals({"wheel_speed.tractor.front.left": wheel * speed, "roll_rate.semitrailer": roll * lean})


def test_wheels_and_a_body_that_rolls_outwards(a_drive):
    assert check(with_wheels_and_roll(a_drive)) == ()


@pytest.mark.parametrize(
    ("factors", "fault", "signal"),
    [
        ({"roll": -1}, Fault.SWAPPED_SIGN, "roll_rate.semitrailer"),
        ({"roll": 180 / np.pi}, Fault.DEGREES, "roll_rate.semitrailer"),
        ({"wheel": 3.6}, Fault.UNIT, "wheel_speed.tractor.front.left"),
        ({"wheel": 0.5}, Fault.UNIT, "speed"),
    ],
)
def test_wheels_and_rolling_that_contradict(a_drive, factors, fault, signal):
    errors = [f for f in check(with_wheels_and_roll(a_drive, **factors)) if f.severity == "error"]
    assert [(f.signal, f.fault) for f in errors][:1] == [(signal, fault)]


def test_a_slow_drive_in_km_per_h(a_drive):
    slow = with_wheels_and_roll(drive(speed=9.0))
    fast = slow.with_signals({"speed": 3.6 * slow.signals["speed"]})
    assert [(f.signal, f.fault) for f in check(fast) if f.fault is Fault.UNIT][:1] == [("speed", Fault.UNIT)]


def test_a_stamp_that_has_gone_wild_is_told_and_costs_no_memory(a_drive):
    time = np.append(a_drive.time[:-1], 4e12)
    findings = check(Record(time=time, signals=a_drive.signals))
    assert [(f.signal, f.fault) for f in findings] == [("time", Fault.DROPOUT)]
    holed = Record(time=time, signals=between(RATE, 3, 3.1, np.nan)(a_drive).signals)
    assert {f.fault for f in check(holed)} == {Fault.DROPOUT}


def test_messages_that_come_in_bursts_are_whole(a_drive):
    """Two gyros 1 ms apart, as messages on a bus come, and inputs that lie between their samples."""
    time = np.sort(np.concatenate([a_drive.time, a_drive.time + 1e-3]))
    first = np.arange(time.size) % 2 == 0
    signals = {n: np.interp(time, a_drive.time, v, right=np.nan) for n, v in a_drive.signals.items()}
    signals[RATE], signals[RATE2] = np.where(first, signals[RATE], np.nan), np.where(first, np.nan, signals[RATE2])
    record = Record(time=time, signals=signals)
    assert check(record) == ()
    assert record.rate == pytest.approx(100, rel=0.01)


def test_lone_samples_of_inputs_are_left_out_of_an_identification(a_drive):
    steer = a_drive.signals[STEER].copy()
    steer[700] = 1.6
    clean = without_spikes(a_drive.with_signals({STEER: steer}))
    assert np.flatnonzero(np.isnan(clean.signals[STEER])).tolist() == [700]
    assert np.array_equal(clean.signals[RATE], a_drive.signals[RATE])
    assert without_spikes(a_drive) is a_drive
