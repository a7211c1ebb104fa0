"""Faults of one channel: both sides of every limit, and the running median against NumPy."""

import numpy as np
import pytest

from fifthwheel.data.channels import CHANNELS, channel_of
from fifthwheel.data.checks import Fault, check
from fifthwheel.data.checks.samples import (
    dropouts,
    impossible_samples,
    spike_mask,
    spikes,
    stuck,
    without_outliers,
    without_spikes,
)
from fifthwheel.data.record import Record

STEER, RATE, RATE2 = "steer.tractor.front", "yaw_rate.tractor", "yaw_rate.semitrailer"
TIME = np.arange(0, 40, 0.02)


def of(**signals):
    """A record of 40 s at 50 Hz with a speed of 20 m/s and the tractor's weave."""
    every = {"speed": np.full(TIME.size, 20.0), RATE: 0.05 * np.sin(TIME)}
    return Record(time=TIME, signals=every | {name.replace("__", "."): v for name, v in signals.items()})


@pytest.mark.parametrize(
    ("start", "stop", "severity", "text"),
    [
        (10, 10.24, None, ""),
        (10, 10.28, "warning", "between 9.98"),
        (10, 10.5, "warning", "between 9.98"),
        (10, 10.54, "warning", "longest gap is 10.00 to 10.54 s"),
        (10, 29.9, "warning", "longest gap is 10.00 to 29.90 s"),
        (10, 30.2, "error", "longest gap is 10.00 to 30.20 s"),
        (38.44, 99, "warning", "longest gap is 38.44 to 39.98 s"),
        (38.52, 99, "warning", "between 34.98"),
        (38.78, 99, None, ""),
        (-1, 1.52, "warning", "longest gap is 0.00 to 1.52 s"),
        (-1, 1.48, "warning", "between 0.00"),
        (-1, 1.22, None, ""),
    ],
)
def test_gaps(start, stop, severity, text):
    """Up to 5 % may be missing within five seconds, and a second at each end; a gap above half a second is named; an
    error above half of all, and a single sample."""
    values = np.where((start < TIME) & (stop > TIME), np.nan, 0.05 * np.sin(TIME))
    findings = list(dropouts(of(yaw_rate__semitrailer=values), RATE2))
    assert [(f.fault, f.severity) for f in findings] == ([(Fault.DROPOUT, severity)] if severity else [])
    assert all(text in f.message for f in findings)
    for count in (0, 1, 2):
        few = np.where(np.arange(TIME.size) < count, 0.1, np.nan)
        (finding,) = dropouts(of(yaw_rate__semitrailer=few), RATE2)
        assert (finding.severity, f"{count} samples" in finding.message) == ("error", count < 2)


@pytest.mark.parametrize(("every", "found"), [(12, True), (30, False)])
def test_single_missing_samples(every, found):
    """One in twelve is 8 %, one in thirty 3 %; up to 5 % within five seconds is permitted. A pause of all channels
    lacks no sample."""
    values = np.where((np.arange(TIME.size) % every == 3) & (TIME > 10) & (TIME < 15), np.nan, 0.05 * np.sin(TIME))
    (message,) = [f.message for f in dropouts(of(yaw_rate__semitrailer=values), RATE2)] or [""]
    assert ("8% between 9.98 and 14.98 s" in message) == found
    keep = (TIME < 10) | (TIME > 14)
    paused = Record(time=TIME[keep], signals={RATE2: values[keep]})
    assert list(dropouts(paused, RATE2)) == []


def reference_spikes(time, values, jump):
    """By NumPy: the median of the samples within 0.15 s, at least five, with mirrored ends, and its robust sigma."""
    step = np.median(np.diff(time))
    half = max(round(0.15 / step), 2)
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(values, half, mode="reflect"), 2 * half + 1)
    deviation = np.abs(values - np.median(windows, axis=1))
    sigma = 1.4826 * np.median(deviation)  # the deviations are from a median, not from their own
    return (deviation > 8 * sigma) & (deviation > jump * max(0.75, step / 0.1))


@pytest.mark.parametrize(
    ("step", "noise", "size"), [(0.01, 0.0, 0.13), (0.01, 0.1, 1.2), (0.5, 0.0, 0.9), (0.5, 0.0, 0.6)]
)
def test_spikes_equal_those_of_numpy(step, noise, size):
    random = np.random.default_rng(5)
    values = noise * random.normal(size=500)
    rows = random.permutation(500)[:20]
    values[rows] += size * random.uniform(0.5, 2.0, 20)
    values[[0, -1]] += size
    time = step * np.arange(500)
    mask = spike_mask(RATE, time, values)
    assert np.array_equal(mask, reference_spikes(time, values, 0.15))
    assert 0 < mask.sum() < 22


@pytest.mark.parametrize(("seconds", "found"), [(0.02, True), (0.16, True), (0.18, False)])
def test_a_burst_is_one_spike(seconds, found):
    burst = (TIME > 9.99) & (9.99 + seconds > TIME)
    record = of(yaw_rate__semitrailer=np.where(burst, 0.5, 0.0))
    messages = [finding.message for finding in spikes(record, RATE2)]
    assert messages == [f"{RATE2}: 1 spike left out, the first 0.5 rad/s at 10.00 s"] * found
    assert np.array_equal(np.isnan(without_spikes(record).signals[RATE2]), burst & found)


@pytest.mark.parametrize(("count", "found"), [(0, False), (1, True), (199, True), (200, False)])
@pytest.mark.parametrize("name", [STEER, RATE2])
def test_spikes_up_to_a_tenth_of_the_samples(name, count, found):
    """They are left out of inputs and measurements, also beside samples that are missing."""
    values = np.zeros(TIME.size)
    values[5 : 5 + 10 * count : 10] = 0.5
    values[2] = np.nan
    record = of(**{name.replace(".", "__"): values})
    text = f"{count} spike{'s' * (count > 1)} left out, the first 0.5"
    findings = list(spikes(record, name))
    assert [(f.fault, f.severity) for f in findings] == [(Fault.SPIKE, "warning")] * found
    assert all(text in f.message and "at 0.10 s" in f.message for f in findings)
    clean = without_spikes(record)
    assert np.array_equal(clean.signals[name], np.where((values > 0) & found, np.nan, values), equal_nan=True)
    assert np.array_equal(clean.signals[RATE], record.signals[RATE])
    assert found or clean is record


def test_impossible_samples():
    """Ten times the range of the quantity, below 1 % of the samples; where they are more, only above 1e9."""
    for count, expected in ((9, 9), (10, 0)):
        values = np.zeros(1000)
        values[:count] = -15.01
        assert impossible_samples(RATE, values).sum() == expected
        values[999] = 1.1e9
        assert impossible_samples(RATE, values).sum() == (10 if count < 9 else 1)
    values = np.zeros(1000)
    values[:5] = 14.99
    assert not impossible_samples(RATE, values).any()
    values[:4] = [1e9, 1.01e9, -1.01e9, np.inf]
    assert impossible_samples("time_of_day", values).tolist()[:4] == [False, True, True, True]
    everywhere = np.full(10, np.inf)
    assert not impossible_samples(RATE, everywhere).any()


@pytest.mark.parametrize(("seconds", "severity"), [(0.96, None), (1.06, "warning"), (3.9, "warning"), (4.1, "error")])
def test_a_constant_value_in_a_turn(seconds, severity):
    """Longer than a second; an error from a tenth of the record on."""
    values = 0.04 * np.sin(TIME + 1)
    values[(TIME >= 12) & (12 + seconds >= TIME)] = 0.123
    findings = list(stuck(of(yaw_rate__semitrailer=values), RATE2, 5.0))
    assert [f.severity for f in findings] == ([severity] if severity else [])
    for f in findings:
        assert f"constant at 0.123 rad/s from 12.00 to {12 + seconds:.2f} s" in f.message


def test_a_value_repeated_by_a_slow_sensor_is_not_stuck():
    """Three times the typical time of a value is permitted."""
    slow = 0.04 * np.sin(np.floor(TIME / 0.5) * 0.5)
    assert not list(stuck(of(yaw_rate__semitrailer=slow), RATE2, 5.0))
    for seconds, found in ((1.4, False), (1.6, True)):
        held = np.where((TIME >= 12) & (12 + seconds > TIME), 0.2, slow)
        assert bool(list(stuck(of(yaw_rate__semitrailer=held), RATE2, 5.0))) == found


@pytest.mark.parametrize(("speed", "change", "found"), [(20, 0.04, True), (20, 0.02, False), (4.9, 0.04, False)])
def test_a_constant_value_needs_a_turn_of_another_signal(speed, change, found):
    """A yaw rate changes by more than 0.03 rad/s in a turn, for a constant steer angle by more than twice that."""
    ramp = change / 0.8 * np.clip((TIME - 20) / 4, 0, 1)  # 80 % of it between the quantiles of 10 and 90 %
    inside = (TIME >= 20) & (TIME <= 24)
    record = of(yaw_rate__semitrailer=np.where(inside, 0.0, 0.04 * np.sin(TIME)), yaw_rate__tractor=ramp)
    record = record.with_signals({"speed": np.full(TIME.size, float(speed))})
    assert bool(list(stuck(record, RATE2, 5.0))) == found
    steer = record.with_signals({STEER: record.signals[RATE2], RATE2: np.zeros(TIME.size)})
    assert not list(stuck(steer, STEER, 5.0))
    twice = steer.with_signals({RATE: 2 * ramp})
    assert bool(list(stuck(twice, STEER, 5.0))) == found


def test_the_trailer_still_turns_when_the_steering_stops():
    """Its yaw rate does not show a stuck steer angle within 4 s."""
    for begin, found in ((20.0, False), (22.0, False), (24.5, True)):
        swing = 0.2 * np.clip((TIME - begin) / 0.2, 0, 1) * (begin + 1.5 > TIME)
        steer = np.where(TIME < 20, 0.02 * np.sin(TIME), 0.0)
        record = of(steer__tractor__front=steer, yaw_rate__semitrailer=swing, yaw_rate__tractor=0.0 * TIME)
        assert bool(list(stuck(record.cut(10.0, 26.0), STEER, 5.0))) == found


QUANTITIES = {
    # signal: magnitude, jump, and change in a turn, SI
    "speed": (45.0, 2.0, None),
    STEER: (1.2, 0.08, 0.01),
    RATE2: (1.5, 0.15, 0.03),
    "articulation.semitrailer": (1.7, 0.06, 0.02),
    "lateral_acceleration.tractor": (12.0, 3.0, 1.0),
    "lateral_velocity.tractor": (10.0, 1.0, None),
    "sideslip.tractor": (1.0, 0.1, None),
    "roll.tractor": (0.5, 0.05, 0.02),
    "roll_rate.tractor": (2.0, 0.4, None),
    "wheel_speed.tractor.front.left": (45.0, 2.0, None),
    "longitudinal_acceleration.tractor": (12.0, 3.0, None),
    "wheel_speed_difference.semitrailer": (0.5, 0.1, None),
    "grade": (0.4, 0.1, None),
    "axle_load.tractor.drive": (5e5, 1e5, None),
    "weight.semitrailer": (1e6, 1e5, None),
    "gross_weight": (5e6, 1e6, None),
}


@pytest.mark.parametrize("name", QUANTITIES)
def test_magnitude_jump_and_turn_of_each_quantity(name):
    """What a truck can reach, what it can reach within 0.1 s, and what tells a turn from straight driving."""
    assert {channel_of(n) for n in QUANTITIES} == {channel for channel in CHANNELS.values() if channel.limit}
    magnitude, jump, turn = QUANTITIES[name]
    ranges = {Fault.OUT_OF_RANGE, Fault.DEGREES, Fault.UNIT, Fault.STEERING_WHEEL}
    for factor, beyond in ((0.999, False), (1.001, True)):
        values = factor * magnitude * np.where(np.arange(TIME.size) % 2, 1.0, -1.0)
        record = Record(time=TIME, signals={name: values})
        assert bool(ranges & {f.fault for f in check(record)}) == beyond
        spike = np.zeros(TIME.size)
        spike[700] = factor * 0.75 * jump  # over the median, with the fastest change before and after
        assert bool(list(spikes(Record(time=TIME, signals={name: spike}), name))) == beyond
        other = RATE if name != RATE else RATE2
        turning = {name: (turn or magnitude) * factor / 0.8 * np.clip((TIME - 20) / 4, 0, 1)}
        still = {"roll_rate.semitrailer": np.where(np.abs(TIME - 22) <= 2, 0.0, 0.01 * np.sin(TIME)), other: 0 * TIME}
        record = Record(time=TIME, signals={"speed": np.full(TIME.size, 20.0), **still, **turning})
        if name != "speed":
            found = bool(list(stuck(record, "roll_rate.semitrailer", 5.0)))
            assert found == (beyond and turn is not None)


def test_a_single_outlier_is_left_out_of_means() -> None:
    rng, time = np.random.default_rng(1), np.arange(500) / 100
    values = 0.1 * np.sin(time) + 1e-3 * rng.normal(size=500)
    wrong = values.copy()
    wrong[[100, 300]] += [0.02, -0.05]
    record = Record(time=time, signals={"yaw_rate.tractor": wrong, "speed": np.full(500, 20.0)})
    kept = without_outliers(record, ["yaw_rate.tractor", "speed"], 6.0)
    assert np.flatnonzero(np.isnan(kept.signals["yaw_rate.tractor"])).tolist() == [100, 300]
    clean = record.with_signals({"yaw_rate.tractor": values})
    assert without_outliers(clean, ["yaw_rate.tractor"], 6.0) is clean
    steps = record.with_signals({"yaw_rate.tractor": np.repeat(values[::10], 10)})
    assert without_outliers(steps, ["yaw_rate.tractor"], 6.0) is steps, "a sample that is repeated does not change"
