"""Whether a record can be what it is said to be, told before an estimator turns its faults into tyre stiffnesses."""

from collections.abc import Iterator, Sequence

import numpy as np

from fifthwheel.logs.faults import Fault, Finding, Severity
from fifthwheel.logs.names import suggest
from fifthwheel.logs.physics import disagreements
from fifthwheel.logs.record import Record
from fifthwheel.logs.samples import LIMITS, dropouts, seen, spikes, stuck

MIN_SPEED = 5.0
"""m/s; below it the lateral equations, which divide by speed, say little."""
_DEGREE = np.pi / 180
_HANDS = 16.0
"""rad; a steering wheel turns no further than two and a half times to either side."""
_RUSH = 2e4
"""Hz; no log of a truck is as dense."""


def check(
    record: Record, *, wheelbase: float | None = None, units: Sequence[str] = (), steered: Sequence[str] = ()
) -> tuple[Finding, ...]:
    """Every fault found in the signals of a record, errors first.

    Each channel is looked at alone (dropouts, spikes, stuck values, ranges) and against the others by the kinematics
    of a turn (swapped signs, degrees, the steering wheel's angle, a wrong column, offsets). What varies too little to
    be judged passes. `wheelbase` (m) of the leading unit sharpens the relation of steer to yaw rate; 4.5 m is taken
    without it. With the names of the vehicle's `units`, and of the steer signals that it can have, signals of others
    are named. The reference is not checked.
    """
    together = list(disagreements(record, wheelbase=4.5 if wheelbase is None else wheelbase, min_speed=MIN_SPEED))
    explained = {finding.signal for finding in together if finding.fault in (Fault.DEGREES, Fault.STEERING_WHEEL)}
    found = [*_strangers(record, units, steered), *_speed(record), *_wheels(record), *together]
    for name in record.signals:
        found += [*dropouts(record, name), *spikes(record, name), *stuck(record, name, MIN_SPEED)]
        found += [] if name in explained else _range(record, name)
    steps = np.diff(record.time)
    if steps.max() > max(0.5, 5 * float(np.median(steps))):
        at = record.time[steps.argmax()]
        message = f"time: {steps.max():.2f} s without a row after {at:.2f} s; what is before and after it is used apart"
        found.append(Finding(signal="time", fault=Fault.DROPOUT, severity="warning", message=message))
    if record.rate > _RUSH:
        message = (
            f"time: {record.rate:.3g} samples a second, {record.span[1] - record.span[0]:.3g} s in all; check its unit"
        )
        found.append(Finding(signal="time", fault=Fault.UNIT, severity="error", message=message))
    once: dict[tuple[str, Fault], Finding] = {}
    for finding in found:
        once.setdefault((finding.signal, finding.fault), finding)
    return tuple(sorted(once.values(), key=lambda finding: finding.severity))


def _strangers(record: Record, units: Sequence[str], steered: Sequence[str]) -> Iterator[Finding]:
    """Signals of units, and steer angles of axles, that the vehicle does not have."""
    for name in record.signals if units else ():
        unit = name.split(".")[1] if "." in name else units[0]
        if unit not in units:
            message = f"{name}: the vehicle has no unit {unit!r}; {suggest(unit, list(units))}"
        elif name.startswith("steer.") and steered and name not in steered:
            message = f"{name}: no axle of the vehicle steers so; {suggest(name, list(steered))}"
        else:
            continue
        yield Finding(signal=name, fault=Fault.UNKNOWN_UNIT, severity="error", message=message)


def _speed(record: Record) -> Iterator[Finding]:
    if "speed" not in record.signals:
        return
    time, speed = seen(record, "speed")
    if not speed.size:
        return

    def finding(fault: Fault, severity: Severity, message: str) -> Finding:
        return Finding(signal="speed", fault=fault, severity=severity, message=f"speed: {message}")

    slow = float(np.mean(speed < MIN_SPEED))
    if float(np.median(speed)) < -1.0:
        yield finding(Fault.SWAPPED_SIGN, "error", f"{np.median(speed):.1f} m/s; forward is positive, set sign = -1")
    elif float(np.quantile(speed, 0.99)) < MIN_SPEED:
        yield finding(
            Fault.ZERO_SPEED,
            "error",
            f"at most {speed.max():.1f} m/s, above {MIN_SPEED:g} m/s expected; take a drive, or check column and unit",
        )
    elif slow > 0.02:
        first, last = time[speed >= MIN_SPEED][[0, -1]]
        yield finding(
            Fault.ZERO_SPEED,
            "warning",
            f"{slow:.0%} under {MIN_SPEED:g} m/s; cut the record, it is faster within {first:.2f} to {last:.2f} s",
        )


def _wheels(record: Record) -> Iterator[Finding]:
    """Wheels that turn at another speed than the vehicle's."""
    wheels = [name for name in record.signals if name.startswith("wheel_speed.")]
    if not wheels or "speed" not in record.signals:
        return
    at, speed = seen(record, "speed")
    for name in wheels:
        time, values = seen(record, name)
        if at.size < 2 or not time.size:
            continue
        own = np.interp(time, at, speed)
        fast = (own > 0.5) & (values > 0.5)
        if fast.sum() < 10:
            continue
        ratio = float(np.median(values[fast] / own[fast]))
        if 0.85 < ratio < 1.18:
            continue
        blamed, cure = "speed", f"check the units of both and the column of {name}"
        if 3.2 < ratio < 4.0:
            blamed, cure = name, 'the wheel looks like km/h, set its unit = "km/h"'
        elif 0.25 < ratio < 0.31:
            cure = 'it looks like km/h, set unit = "km/h"'
        message = f"{blamed}: {name} is {ratio:.2f} times the speed, 1 expected; {cure}"
        yield Finding(signal=blamed, fault=Fault.UNIT, severity="error", message=message)


def _range(record: Record, name: str) -> Iterator[Finding]:
    """All but a hundredth of the samples beyond what a truck can do; a few of them are spikes."""
    _, values = seen(record, name)
    limit = LIMITS.get(name.partition(".")[0])
    if limit is None or not values.size:
        return
    most, unit = float(np.quantile(np.abs(values), 0.99)), limit.unit
    if most <= limit.most:
        return
    came = f"{name}: up to {most:.3g} {unit}, at most {limit.most:g} {unit} expected"
    if name.startswith("steer.") and most <= _HANDS:
        fault, cure = (
            Fault.STEERING_WHEEL,
            ('looks like the steering wheel\'s angle; set gain = 1 / steering ratio, or unit = "deg" if it is degrees'),
        )
    elif unit.startswith("rad") and most * _DEGREE <= limit.most:
        fault, cure = Fault.DEGREES, f'looks like degrees; set unit = "{unit.replace("rad", "deg")}"'
        if name.startswith("steer."):
            cure += ", and gain = 1 / steering ratio if it is the steering wheel's angle"
    elif name == "speed" and most / 3.6 <= limit.most:
        fault, cure = Fault.UNIT, 'looks like km/h; set unit = "km/h"'
    else:
        fault, cure = Fault.OUT_OF_RANGE, "check column and unit"
    yield Finding(signal=name, fault=fault, severity="error", message=f"{came}; {cure}")
