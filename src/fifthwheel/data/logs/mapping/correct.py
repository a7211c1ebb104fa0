"""Correction of a map by the kinematics of a turn: signs, units and the steering ratio."""

import numpy as np

from fifthwheel.base.errors import SignalError
from fifthwheel.base.units import factor
from fifthwheel.data.channels import si_unit
from fifthwheel.data.channels.inputs import UNDERSTEER
from fifthwheel.data.checks.findings import Fault, Finding
from fifthwheel.data.checks.kinematics import relations
from fifthwheel.data.checks.plausibility import MIN_SPEED, check
from fifthwheel.data.logs.assemble import assemble
from fifthwheel.data.logs.signal_map import SignalMap, SignalSource
from fifthwheel.data.logs.source import LogSource
from fifthwheel.data.record.record import Record

COARSE_RATE = 20.0
"""Hz; sufficient for signs, units and ratios."""
_MAX_ROUNDS = 4
"""A fault may hide another one: degrees a wrong sign."""
_TYPICAL_STEERING_RATIO = 19.0
"""Of heavy trucks; 15 to 25 are common."""
_MAX_STEERING_GAIN = 60.0
"""A larger gain from the road wheels is explained by degrees and a steering ratio together."""


def correct_map(
    log: LogSource, proposed: SignalMap, wheelbase: float
) -> tuple[SignalMap, dict[str, str], tuple[Finding, ...]]:
    """The map with the signs, units and the steering ratio that the samples show, read at a low rate.

    Also the corrections in words by signal, and the remaining findings. `wheelbase` is that of the leading unit, m.
    """
    if not proposed.signals:
        return proposed, {}, ()
    try:
        record = assemble(log, at_coarse_rate(proposed), name=log.name)
    except SignalError as error:
        first_line = str(error).partition("\n")[0]
        return proposed, {}, (Finding(signal="time", fault=Fault.DROPOUT, severity="error", message=first_line),)
    signals = dict(proposed.signals)
    corrections: dict[str, str] = {}
    for _ in range(_MAX_ROUNDS):
        findings = check(record, wheelbase=wheelbase)
        corrected = set()
        for finding in findings:
            name, channel = finding.signal, signals.get(finding.signal)
            if channel is None or name in corrected:
                continue
            if (correction := _corrected(finding, channel, record, wheelbase)) is None:
                continue
            log_unit = log.columns[log.find(channel.column or "")].unit
            ratio = _scale(name, correction[0], log_unit) / _scale(name, channel, log_unit)
            record = record.with_signals({name: ratio * record.signals[name]})
            signals[name] = correction[0]
            corrected.add(name)
            corrections[name] = "; ".join(filter(None, [corrections.get(name), correction[1]]))
        if not corrected:
            break
    return proposed.model_copy(update={"signals": signals}), corrections, findings


def at_coarse_rate(proposed: SignalMap) -> SignalMap:
    """The map with a low sampling rate."""
    return proposed.model_copy(update={"time": proposed.time.model_copy(update={"rate": COARSE_RATE})})


def _scale(signal: str, channel: SignalSource, log_unit: str | None) -> float:
    """SI value of the signal for a column value of one."""
    si = si_unit(signal) or "1"
    return channel.sign * channel.gain * factor(channel.unit or log_unit or si, si)


def _corrected(
    finding: Finding, channel: SignalSource, record: Record, wheelbase: float
) -> tuple[SignalSource, str] | None:
    """The channel without the fault and the correction in words; None where it takes the user to decide."""
    match finding.fault:
        case Fault.SWAPPED_SIGN:
            return channel.model_copy(update={"sign": -channel.sign}), "sign inverted, it contradicted other signals"
        case Fault.DEGREES | Fault.UNIT if finding.remedy.get("unit") not in (None, "m/s"):
            unit = finding.remedy["unit"]
            return channel.model_copy(update={"unit": unit}), f"unit {unit} by its magnitude"
        case Fault.STEERING_WHEEL:
            return _steering_wheel(finding.signal, channel, record, wheelbase)
        case _:
            return None


def _steering_wheel(
    name: str, channel: SignalSource, record: Record, wheelbase: float
) -> tuple[SignalSource, str] | None:
    """The channel with the gain that wheelbase and yaw rate show, in degrees if the gain is above 60."""
    every = relations(record, wheelbase=wheelbase, min_speed=MIN_SPEED)
    relation = next((relation for relation in every if relation.signal == name), None)
    if relation is None:
        return None
    degrees = relation.gain > _MAX_STEERING_GAIN
    ratio = relation.gain * (np.pi / 180 if degrees else 1.0)
    u = float(np.nanmedian(record.signals["speed"]))
    # the understeer gradient is unknown: a uniform distribution of ratios is possible
    low, high = (ratio * (wheelbase + UNDERSTEER * u**2) / (wheelbase + k * u**2) for k in (2 * UNDERSTEER, 0.0))
    used = round(float(np.clip(_TYPICAL_STEERING_RATIO, low, high)), 1)
    unit = "deg" if degrees else channel.unit
    source = channel.model_copy(update={"unit": unit, "sensor": "steering wheel"})
    return source.with_uncertain_gain(1 / used, (high - low) / (np.sqrt(12) * used)), (
        f"this is the steering-wheel angle: yaw rate and a wheelbase of {wheelbase:g} m give a steering ratio of "
        f"{low:.0f} to {high:.0f}, the map uses {used:g}; if you know the steering ratio, set gain to 1 / ratio"
    )
