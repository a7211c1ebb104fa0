"""A map put right by what a turning truck must show: signs, units and the steering ratio."""

import numpy as np

from fifthwheel.errors import SignalError
from fifthwheel.logs.assemble import assemble
from fifthwheel.logs.faults import Fault, Finding
from fifthwheel.logs.log import Log
from fifthwheel.logs.names import si_unit
from fifthwheel.logs.physics import UNDERSTEER, relations
from fifthwheel.logs.plausibility import MIN_SPEED, check
from fifthwheel.logs.record import Record
from fifthwheel.logs.signals import Channel, SignalMap, TimeColumn
from fifthwheel.logs.units import factor

COARSE_RATE = 20.0
"""Hz; enough to tell signs, units and ratios."""
_ROUNDS = 4
"""A fault may hide another: degrees that of a sign."""
_USUAL_RATIO = 19.0
"""Of the steering of heavy trucks; 15 to 25 are built."""


def put_right(log: Log, proposed: SignalMap, wheelbase: float) -> tuple[SignalMap, dict[str, str], tuple[Finding, ...]]:
    """The map with the signs, units and ratios that the samples demand, what was changed, and what still is wrong."""
    if not proposed.signals:
        return proposed, {}, ()
    try:
        record = assemble(log, coarse(proposed), name=log.name)
    except SignalError as error:
        text = str(error).partition("\n")[0]
        return proposed, {}, (Finding(signal="time", fault=Fault.DROPOUT, severity="error", message=text),)
    signals = dict(proposed.signals)
    changed: dict[str, str] = {}
    for _ in range(_ROUNDS):
        findings = check(record, wheelbase=wheelbase)
        cured = set()
        for finding in findings:
            name, channel = finding.signal, signals.get(finding.signal)
            cure = None if channel is None or name in cured else _cure(finding, channel, record, wheelbase)
            if channel is None or cure is None:
                continue
            shown = log.columns[log.find(channel.column or "")].unit
            ratio = _scale(name, cure[0], shown) / _scale(name, channel, shown)
            record = record.with_signals({name: ratio * record.signals[name]})
            signals[name] = cure[0]
            cured.add(name)
            changed[name] = f"{changed[name]}; {cure[1]}" if name in changed else cure[1]
        if not cured:
            break
    return proposed.model_copy(update={"signals": signals}), changed, findings


def _scale(signal: str, channel: Channel, shown: str | None) -> float:
    """What one of the column is in SI."""
    si = si_unit(signal) or "1"
    return channel.sign * channel.gain * factor(channel.unit or shown or si, si)


def coarse(proposed: SignalMap) -> SignalMap:
    """The same map at a low rate."""
    time = (proposed.time or TimeColumn()).model_copy(update={"rate": COARSE_RATE})
    return proposed.model_copy(update={"time": time})


def _cure(finding: Finding, channel: Channel, record: Record, wheelbase: float) -> tuple[Channel, str] | None:
    """The channel without the fault, and in words what was done."""
    si = si_unit(finding.signal) or ""
    if finding.fault is Fault.SWAPPED_SIGN:
        return channel.model_copy(update={"sign": -channel.sign}), "turned round, as it went against the others"
    if finding.fault is Fault.DEGREES:
        unit = si.replace("rad", "deg")
        return channel.model_copy(update={"unit": unit}), f"taken for {unit} by its size"
    if finding.fault is Fault.UNIT:
        unit = {"lateral_acceleration": "g"}.get(finding.signal.partition(".")[0], "km/h")
        if f'unit = "{unit}"' not in finding.message:
            return None
        return channel.model_copy(update={"unit": unit}), f"taken for {unit} by its size"
    if finding.fault is Fault.STEERING_WHEEL:
        return _steering_wheel(finding.signal, channel, record, wheelbase)
    return None


def _steering_wheel(name: str, channel: Channel, record: Record, wheelbase: float) -> tuple[Channel, str] | None:
    """One over the ratio that wheelbase and yaw rate let expect; above 60 the angle is in degrees too.

    How much a truck understeers is not known: at speed a range of ratios is possible, and a usual one in it is taken.
    """
    found = next((r for r in relations(record, wheelbase=wheelbase, min_speed=MIN_SPEED) if r.signal == name), None)
    if found is None:
        return None
    degrees = found.gain > 60
    ratio = found.gain * (np.pi / 180 if degrees else 1.0)
    u = float(np.nanmedian(record.signals["speed"]))
    low, high = (ratio * (wheelbase + UNDERSTEER * u**2) / (wheelbase + k * u**2) for k in (2 * UNDERSTEER, 0.0))
    usual = round(float(np.clip(_USUAL_RATIO, low, high)), 1)
    told = {"gain": float(f"{1 / usual:.4g}"), "unit": "deg" if degrees else channel.unit}
    return channel.model_copy(update=told), (
        f"the steering wheel's angle; yaw rate and a wheelbase of {wheelbase:g} m tell a ratio of {low:.0f} to "
        f"{high:.0f}, {usual:g} is taken; put the truck's own, gain = 1 / ratio"
    )
