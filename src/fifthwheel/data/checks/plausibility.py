"""Plausibility of a record, checked before an estimator turns faults of signals into wrong parameters."""

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from fifthwheel.base.errors import suggestion
from fifthwheel.base.formatting import enumerated
from fifthwheel.data.channels import (
    BRAKING,
    DRIVING,
    MEASURED,
    STEER,
    WHEEL_SPEED,
    SignalName,
    channel_of,
    is_of,
    limit_of,
    missing_for_mass,
    names_of,
    si_unit,
)
from fifthwheel.data.checks.findings import Fault, Finding, error, remedy_text, warning
from fifthwheel.data.checks.kinematics import kinematic_findings
from fifthwheel.data.checks.samples import dropouts, present_samples, spikes, stuck, without_spikes
from fifthwheel.data.record.derived import estimate_noise_variance
from fifthwheel.data.record.record import Record
from fifthwheel.data.record.timestamps import is_hour

MIN_SPEED = 5.0
"""m/s; below it the lateral equations, which divide by speed, are inaccurate."""
_DEGREE = np.pi / 180
_MAX_STEERING_WHEEL = 16.0
"""rad; a steering wheel turns by up to 2.5 revolutions to either side."""
_MAX_RATE = 2e4
"""Hz; no log of a truck has a higher sampling rate."""
_OWN_NOISE = 0.3
"""Of the noise of one signal, what a copy of it has of its own: two sensors differ by more than the noise of one."""
_DEFAULT_WHEELBASE = 4.5
"""m"""


def check(
    record: Record, *, wheelbase: float | None = None, units: Sequence[str] = (), steered: Sequence[str] = ()
) -> tuple[Finding, ...]:
    """Findings on the signals of a record, errors first. Reference signals are not checked.

    Each channel is checked on its own (missing samples, spikes, constant values, range) and against the others by the
    kinematics of a turn (sign, degrees, steering-wheel angle, wrong column, offset). A signal that varies too little is
    not judged.

    Args:
        record: the record.
        wheelbase: of the leading unit, m; makes the relation of steer angle to yaw rate more accurate. Default: 4.5 m.
        units: names of the vehicle's units; signals of other units are errors. Default: not checked.
        steered: steer signals that the vehicle can have; others are errors. Default: not checked.
    """
    wheelbase = _DEFAULT_WHEELBASE if wheelbase is None else wheelbase
    spiky = [finding for name in record.signals for finding in spikes(record, name)]
    record = without_spikes(record)
    kinematic = list(kinematic_findings(record, wheelbase=wheelbase, min_speed=MIN_SPEED))
    explained = {finding.signal for finding in kinematic if finding.fault in (Fault.DEGREES, Fault.STEERING_WHEEL)}
    findings = [*spiky, *_unknown_units(record, units, steered), *_speed(record), *_wheel_speeds(record), *kinematic]
    findings += _duplicates(record)
    for name in record.signals:
        findings += [*dropouts(record, name), *stuck(record, name, MIN_SPEED)]
        findings += [] if name in explained else _range(record, name)
    findings += [*_time(record), *_unused(record)]
    distinct: dict[tuple[str, Fault], Finding] = {}
    for finding in findings:
        distinct.setdefault((finding.signal, finding.fault), finding)
    return tuple(sorted(distinct.values(), key=lambda finding: finding.severity))


def _unknown_units(record: Record, units: Sequence[str], steered: Sequence[str]) -> Iterator[Finding]:
    """Signals of units, and steer angles of axles, that the vehicle does not have."""
    for name in record.signals if units else ():
        signal = SignalName.of(name)
        if signal.unit and signal.unit not in units:
            problem = f"the vehicle file has no tractor or trailer named {signal.unit!r}"
            similar = suggestion(signal.unit, list(units))
        elif is_of(name, STEER) and steered and name not in steered:
            problem, similar = "the vehicle has no such steered axle", suggestion(name, list(steered))
        else:
            continue
        yield error(name, Fault.UNKNOWN_UNIT, f"{problem}; rename the signal in signals.toml, {similar}")


def _speed(record: Record) -> Iterator[Finding]:
    if "speed" not in record.signals:
        return
    time, speed = present_samples(record, "speed")
    if not speed.size:
        return
    slow = float(np.mean(speed < MIN_SPEED))
    if float(np.median(speed)) < -1.0:
        problem = f"median {np.median(speed):.1f} m/s, positive expected (forward); {remedy_text({'sign': -1})}"
        yield error("speed", Fault.SWAPPED_SIGN, problem, remedy={"sign": -1})
    elif float(np.quantile(speed, 0.99)) < MIN_SPEED:
        problem = f"at most {speed.max():.1f} m/s, above {MIN_SPEED:g} m/s expected"
        cure = "correct column or unit in signals.toml, or log a faster run"
        yield error("speed", Fault.ZERO_SPEED, f"{problem}; {cure}")
    elif slow > 0.02:
        first, last = time[speed >= MIN_SPEED][[0, -1]]
        cure = f"to use only the fast part, set start = {first:.2f} and stop = {last:.2f} in [time] of signals.toml"
        yield warning("speed", Fault.ZERO_SPEED, f"{slow:.0%} of the samples are below {MIN_SPEED:g} m/s; {cure}")


def _duplicates(record: Record) -> Iterator[Finding]:
    """Signals of one quantity of two units with the same samples, noise included."""
    names = [name for name in record.signals if is_of(name, *MEASURED)]
    for one, other in combinations(names, 2):
        if channel_of(one) is channel_of(other) and _is_copy(record, one, other):
            problem = f"the same samples as {one}; map another column to one of them in signals.toml"
            yield error(other, Fault.DUPLICATE, problem, others=(one,))


def _is_copy(record: Record, one: str, other: str) -> bool:
    """Whether two signals are equal to rounding, or by a gain and an offset to less than the noise of one.

    Coupled units roll almost in proportion, so signals without noise are copies only if they are equal.
    """
    both = np.isfinite(record.signals[one]) & np.isfinite(record.signals[other])
    a, b = record.signals[one][both], record.signals[other][both]
    if a.size <= 100 or min(np.std(a), np.std(b)) < 1e-9:
        return False
    if np.allclose(a, b, rtol=0.0, atol=1e-6 * float(np.std(a))):
        return True
    gain, offset = np.polyfit(a, b, 1)
    noise = estimate_noise_variance(record.time[both], a)
    return noise is not None and gain > 0 and float(np.std(b - gain * a - offset)) < _OWN_NOISE * gain * noise**0.5


def _wheel_speeds(record: Record) -> Iterator[Finding]:
    """Wheel speeds that differ from the vehicle's speed."""
    wheels = names_of(WHEEL_SPEED, record.signals)
    if not wheels or "speed" not in record.signals:
        return
    speed_time, speed = present_samples(record, "speed")
    for name in wheels:
        time, values = present_samples(record, name)
        if speed_time.size < 2 or not time.size:
            continue
        vehicle_speed = np.interp(time, speed_time, speed)
        fast = (vehicle_speed > 0.5) & (values > 0.5)
        if fast.sum() < 10:
            continue
        ratio = float(np.median(values[fast] / vehicle_speed[fast]))
        if 0.85 < ratio < 1.18:
            continue
        signal, remedy = "speed", {}
        cure = f"correct the units of both, or the column of {name}, in signals.toml"
        if 3.2 < ratio < 4.0:
            signal, remedy = name, {"unit": "km/h"}
            cure = f"the wheel speed looks like km/h; {remedy_text(remedy)}"
        elif 0.25 < ratio < 0.31:
            remedy = {"unit": "km/h"}
            cure = f"speed looks like km/h; {remedy_text(remedy)}"
        yield error(signal, Fault.UNIT, f"{name} is {ratio:.2f} times the speed, 1 expected; {cure}", remedy=remedy)


def _range(record: Record, name: str) -> Iterator[Finding]:
    """More than 1 % of the samples beyond what a truck can do; fewer are spikes."""
    _, values = present_samples(record, name)
    limit = limit_of(name)
    if limit is None or not values.size:
        return
    largest, unit = float(np.quantile(np.abs(values), 0.99)), si_unit(name) or ""
    if largest <= limit.magnitude:
        return
    steer = is_of(name, STEER)
    remedy: dict[str, str | float] = {}
    if steer and largest <= _MAX_STEERING_WHEEL:
        fault = Fault.STEERING_WHEEL
        cure = (
            'looks like the steering-wheel angle; set gain = 1 / steering ratio in signals.toml, or unit = "deg" if it '
            "is in degrees"
        )
    elif unit.startswith("rad") and largest * _DEGREE <= limit.magnitude:
        fault, remedy = Fault.DEGREES, {"unit": unit.replace("rad", "deg")}
        cure = f"looks like degrees; {remedy_text(remedy)}"
        if steer:
            cure += ", and gain = 1 / steering ratio if it is the steering-wheel angle"
    elif name == "speed" and largest / 3.6 <= limit.magnitude:
        fault, remedy = Fault.UNIT, {"unit": "km/h"}
        cure = f"looks like km/h; {remedy_text(remedy)}"
    else:
        fault, cure = Fault.OUT_OF_RANGE, "correct column or unit in signals.toml"
    problem = f"up to {largest:.3g} {unit}, at most {limit.magnitude:g} {unit} expected"
    yield error(name, fault, f"{problem}; {cure}", remedy=remedy)


def _unused(record: Record) -> Iterator[Finding]:
    """A finding on all signals that nothing uses, and one on those of driving that do not suffice for the mass."""
    channels = {name: channel for name in record.signals if (channel := channel_of(name))}
    if unused := [name for name, channel in channels.items() if channel.proposed != "signal"]:
        first, *others = unused
        also = f", like {', '.join(others)}" if others else ""
        problem = f"nothing uses it{also}; move it to [reference] in signals.toml, or delete it"
        yield warning(first, Fault.UNUSED, problem, others=tuple(others))
    driving = [name for name, channel in channels.items() if channel in DRIVING and channel is not BRAKING]
    if driving and (missing := missing_for_mass(record.signals)):
        first, *others = driving
        problem = f"only the mass from driving uses {enumerated(['it', *others])}, and {enumerated(missing)} is missing"
        yield warning(first, Fault.UNUSED, f"{problem} for it; map that in signals.toml too", others=tuple(others))


def _time(record: Record) -> Iterator[Finding]:
    """Gaps in the time base, and an implausible sampling rate."""
    steps = np.diff(record.time)
    if steps.max() > max(0.5, 5 * float(np.median(steps))):
        start = record.time[steps.argmax()]
        problem = f"gap of {steps.max():.2f} s after {start:.2f} s"
        if is_hour(steps.max()):
            problem += ", one hour, as at the start of daylight saving time: if the run went on, export the time in UTC"
        yield warning("time", Fault.DROPOUT, f"{problem}; the segments on either side are used separately")
    if record.rate > _MAX_RATE:
        duration = record.span[1] - record.span[0]
        problem = f"{record.rate:.3g} samples/s over {duration:.3g} s, at most {_MAX_RATE:g} expected"
        yield error("time", Fault.UNIT, f"{problem}; correct unit in [time] of signals.toml")
