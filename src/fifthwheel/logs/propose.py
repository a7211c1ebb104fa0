"""A map for a log that has none, by names and units, put right by what a turning truck must show."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fifthwheel.errors import SignalError
from fifthwheel.logs.assemble import assemble, time_column
from fifthwheel.logs.faults import Fault, Finding
from fifthwheel.logs.hints import Hint, hint
from fifthwheel.logs.log import Log
from fifthwheel.logs.names import si_unit
from fifthwheel.logs.physics import UNDERSTEER, correlation, grid, on_grid, relations
from fifthwheel.logs.plausibility import MIN_SPEED, check
from fifthwheel.logs.record import Record
from fifthwheel.logs.signals import Channel, SignalMap, TimeColumn
from fifthwheel.logs.survey import Content, Survey

_USED = {
    "speed",
    "steer",
    "yaw_rate",
    "roll_rate",
    "articulation",
    "lateral_acceleration",
    "wheel_speed",
    "roll",
    "axle_load",
}
_COMPARED = {"sideslip", "lateral_velocity"}
_RATE = 20.0
"""Hz; enough to tell signs, units and ratios."""
_USUAL_RATIO = 19.0
"""Of the steering of heavy trucks; 15 to 25 are built."""
_FOLLOWS = 0.1
"""s; a trailer's gyro follows the tractor's by more."""


@dataclass(frozen=True, kw_only=True)
class Proposal:
    """A map, and why."""

    signals: SignalMap
    reasons: Mapping[str, str]
    """By signal: what it was told by, and what was changed after a look at the samples."""
    others: Mapping[str, Sequence[str]]
    """By signal: columns that might be it too."""
    missing: tuple[str, ...]
    """What an identification or an observer would need besides, a sentence each."""
    findings: tuple[Finding, ...]
    """What still contradicts."""


def propose(
    log: Log,
    found: Survey,
    *,
    units: Sequence[str] = ("tractor", "semitrailer"),
    wheelbase: float = 4.5,
    databases: Sequence[Path] = (),
) -> Proposal:
    """The map that a log's names, units and samples suggest; the user has the last word.

    Args:
        log: opened; read again at a low rate where there is something to compare.
        found: its survey.
        units: names of the vehicle's units, front to rear.
        wheelbase: of the leading unit, m; tells a steering ratio.
        databases: as they shall stand in the map.
    """
    named = SignalMap.of_columns(found.contents)
    hints: dict[str, list[Hint]] = {}
    loads: list[str] = []
    taken = {channel.column for part in named for channel in part.values()}
    for name, content in found.contents.items():
        told = hint(name, content.column.unit) if content.alive and name not in taken else None
        if told is not None and told.quantity == "axle_load" and not told.trailing:
            loads.append(name)
        elif told is not None and told.quantity in _USED | _COMPARED:
            hints.setdefault(_signal(told, units), []).append(told)
    told_apart = _sort_gyros(log, hints, units)
    signals: dict[str, Channel] = {**named[0]}
    reference: dict[str, Channel] = {**named[1]}
    reasons = dict.fromkeys([*signals, *reference], "called so in the log")
    others: dict[str, list[str]] = {}
    for signal, candidates in hints.items():
        if not candidates:
            continue
        if signal in signals or signal in reference:
            others[signal] = [one.column for one in candidates]
            continue
        best = max(candidates, key=lambda one: _merit(one, found.contents[one.column]))
        unit = found.contents[best.column].column.unit
        channel = Channel(column=best.column)
        reasons[signal] = f"by its name{'' if unit is None else f', in {unit}'}"
        if best.steering_wheel:
            reasons[signal] += "; by its name the steering wheel's: it wants gain = 1 / steering ratio, 15 to 25"
        (reference if best.quantity in _COMPARED else signals)[signal] = channel
        others[signal] = [one.column for one in candidates if one is not best]
    if loads:
        others["axle_load.<axle group>"] = loads
    if told_apart:
        reasons[f"yaw_rate.{units[-1]}"] += f"; {told_apart}"
    wheel = f"wheel_speed.{units[0]}.front"
    if "speed" not in signals and wheel in signals:
        signals["speed"], reasons["speed"] = signals.pop(wheel), "of the front wheels, no other was found"
    time = None
    rows = time_column(log)
    if rows is not None and rows not in ("time", "t"):
        time = TimeColumn(column=rows)
    proposed = SignalMap(time=time, signals=signals, reference=reference, databases=tuple(databases))
    proposed, changed, findings = _put_right(log, proposed, wheelbase)
    for signal, text in changed.items():
        reasons[signal] = f"{reasons[signal]}; {text}"
    return Proposal(
        signals=proposed,
        reasons=reasons,
        others={signal: columns for signal, columns in others.items() if columns},
        missing=tuple(_missing(proposed, units)),
        findings=findings,
    )


def _signal(told: Hint, units: Sequence[str]) -> str:
    """The signal that a hint would be."""
    if told.quantity == "speed":
        return "speed"
    unit = units[-1] if told.trailing or (told.quantity.startswith("articulation") and len(units) > 1) else units[0]
    place = f"{unit}.front" if told.quantity == "steer" and unit == units[0] else unit
    if told.quantity in ("wheel_speed", "axle_load"):
        place = f"{unit}.{told.side}" if told.side else unit
    return f"{told.quantity}.{place}"


def _sort_gyros(log: Log, hints: dict[str, list[Hint]], units: Sequence[str]) -> str | None:
    """Give the trailer the gyro that follows the others, where no name says whose they are, and what else comes from
    the same box; in words, if so."""
    mine, its = f"yaw_rate.{units[0]}", f"yaw_rate.{units[-1]}"
    unnamed = [one for one in hints.get(mine, []) if one.trailing is None]
    if its in hints or len(unnamed) < 2 or len(units) < 2:
        return None
    channels = {f"yaw_rate.gyro{k}": Channel(column=one.column) for k, one in enumerate(unnamed)}
    try:
        record = assemble(log, _coarse(SignalMap(signals=channels)), name=log.name)
    except SignalError:
        return None
    late = [_lag(record, f"yaw_rate.gyro{k}") for k in range(len(unnamed))]
    last = int(np.argmax(late))
    if late[last] - min(late) < _FOLLOWS:
        return None
    box = _box(unnamed[last].column)
    for signal in [signal for signal in hints if signal.endswith(f".{units[0]}")]:
        its = f"{signal.partition('.')[0]}.{units[-1]}"
        moving = [one for one in hints[signal] if one is unnamed[last] or (box and _box(one.column) == box)]
        if moving:
            hints.setdefault(its, []).extend(moving)
            hints[signal] = [one for one in hints[signal] if one not in moving]
    return f"follows the other gyro by {late[last] - min(late):.2f} s, so it is taken for the trailer's"


def _box(column: str) -> tuple[str, str] | None:
    """The message or topic, and the source, that a column comes from, if its name says so."""
    name, _, source = column.partition("@")
    message = name.rpartition(".")[0]
    return (message, source) if message else None


def _lag(record: Record, name: str) -> float:
    """s, by how much a channel follows the first of the record; 0 where they have little to do with each other."""
    time = grid(record, 1 / _RATE)
    one, other = (on_grid(record, n, time) for n in (next(iter(record.signals)), name))
    shifts = range(-round(1.5 * _RATE), round(1.5 * _RATE) + 1)
    found = [correlation(one[0], other[0], one[1] & other[1], shift) for shift in shifts]
    best = int(np.argmax(found))
    return shifts[best] / _RATE if found[best] > 0.8 else 0.0


def _merit(told: Hint, content: Content) -> tuple[bool, bool, float, float]:
    there = 1 - content.missing / max(content.samples, 1)
    rate = content.rate if np.isfinite(content.rate) else 0.0
    return told.trailing is not None, there > 0.5, min(rate, 100.0), content.sigma


def _put_right(
    log: Log, proposed: SignalMap, wheelbase: float
) -> tuple[SignalMap, dict[str, str], tuple[Finding, ...]]:
    """The map with the signs, units and ratios that the samples demand, what was changed, and what still is wrong."""
    changed: dict[str, str] = {}
    findings: tuple[Finding, ...] = ()
    for _ in range(4 if proposed.signals or proposed.reference else 0):
        try:
            record = assemble(log, _coarse(proposed), name=log.name)
        except SignalError as error:
            text = str(error).partition("\n")[0]
            return proposed, changed, (Finding(signal="time", fault=Fault.DROPOUT, severity="error", message=text),)
        findings = check(record, wheelbase=wheelbase)
        cured = {}
        for finding in findings:
            channel = proposed.signals.get(finding.signal)
            cure = None if channel is None or finding.signal in cured else _cure(finding, channel, record, wheelbase)
            if cure is not None:
                cured[finding.signal] = cure[0]
                was = changed.get(finding.signal)
                changed[finding.signal] = f"{was}; {cure[1]}" if was else cure[1]
        if not cured:
            break
        proposed = proposed.model_copy(update={"signals": {**proposed.signals, **cured}})
    return proposed, changed, findings


def _coarse(proposed: SignalMap) -> SignalMap:
    time = (proposed.time or TimeColumn()).model_copy(update={"rate": _RATE})
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


def _missing(proposed: SignalMap, units: Sequence[str]) -> list[str]:
    there = set(proposed.signals)
    missing = []
    if "speed" not in there:
        missing.append("speed: found nowhere; it is needed")
    if not any(name.startswith("steer.") for name in there):
        missing.append(f"steer.{units[0]}.front: found nowhere; it is needed")
    if f"yaw_rate.{units[0]}" not in there:
        missing.append(f"yaw_rate.{units[0]}: found nowhere; it is needed")
    for unit in units[1:]:
        if f"yaw_rate.{unit}" not in there and f"articulation.{unit}" not in there:
            missing.append(f"yaw_rate.{unit} or articulation.{unit}: found nowhere; an identification needs one")
        if f"roll_rate.{unit}" not in there:
            missing.append(f"roll_rate.{unit}: found nowhere; without it the payload's height cannot be identified")
    return missing


def as_toml(proposal: Proposal, found: Survey) -> str:
    """The proposal as a signals.toml, with its reasons as comments, ready to be edited."""
    proposed = proposal.signals
    lines = [f"# Proposed for {found.name} by names, units and samples. Look at every line before you believe it."]
    if proposed.databases:
        lines.append(f"databases = [{', '.join(_quoted(str(path)) for path in proposed.databases)}]")
    if proposed.time is not None:
        lines += ["", "[time]", f"column = {_quoted(proposed.time.column or '')}"]
    for part, channels in (("signals", proposed.signals), ("reference", proposed.reference)):
        for signal, channel in channels.items():
            content = found.contents[channel.column or ""] if channel.column in found.contents else None
            lines += ["", f"[{part}.{_quoted(signal)}]", *_comment(proposal.reasons[signal])]
            lines.append(f"column = {_quoted(channel.column or '')}")
            unit = channel.unit or (content.column.unit if content else None)
            if unit is not None:
                lines.append(f"unit = {_quoted(unit)}")
            lines += [f"sign = {channel.sign}"] * (channel.sign != 1)
            lines += [f"gain = {channel.gain:g}"] * (channel.gain != 1.0)
            lines += [f"# or column = {_quoted(other)}" for other in proposal.others.get(signal, ())]
    for signal, columns in proposal.others.items():
        if signal not in proposed.signals and signal not in proposed.reference:
            lines += ["", f"# [signals.{_quoted(signal)}], to weigh the truck:"]
            lines += [f"# column = {_quoted(column)}" for column in columns]
    lines += ["", *(f"# {text}" for text in proposal.missing)] if proposal.missing else []
    lines += (
        ["", *(f"# {line}" for one in proposal.findings for line in str(one).splitlines())] if proposal.findings else []
    )
    return "\n".join(lines) + "\n"


def _comment(reason: str) -> list[str]:
    return [f"# {part}" for part in reason.split("; ")]


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)
