"""A map for a log that has none, by names and units, put right by what a turning truck must show."""

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fifthwheel.errors import SignalError
from fifthwheel.logs.assemble import assemble, time_column
from fifthwheel.logs.faults import Finding
from fifthwheel.logs.hints import Hint, hint
from fifthwheel.logs.log import Log
from fifthwheel.logs.physics import correlation, grid, on_grid
from fifthwheel.logs.record import Record
from fifthwheel.logs.repair import COARSE_RATE, coarse, put_right
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
    hints, loads = _hints(found, units, taken={channel.column for part in named for channel in part.values()})
    trailers = _sort_gyros(log, found, hints, units)
    parts: dict[bool, dict[str, Channel]] = {False: {**named[0]}, True: {**named[1]}}
    reasons = {signal: "called so in the log" for part in named for signal in part}
    others: dict[str, Sequence[str]] = {"axle_load.<axle group>": loads}
    for signal, candidates in hints.items():
        best = None
        if signal not in reasons and candidates:
            best = max(candidates, key=lambda one: _merit(one, found.contents[one.column]))
            own = found.contents[best.column].column.unit
            unit = own or best.unit
            parts[best.quantity in _COMPARED][signal] = Channel(column=best.column, unit=None if own else best.unit)
            reasons[signal] = f"by its name{'' if unit is None else f', in {unit}'}"
        others[signal] = [one.column for one in candidates if one is not best]
    signals = parts[False]
    if trailers:
        reasons[f"yaw_rate.{units[-1]}"] += f"; {trailers}"
    wheel = f"wheel_speed.{units[0]}.front"
    if "speed" not in signals and wheel in signals:
        signals["speed"], reasons["speed"] = signals.pop(wheel), "of the front wheels, no other was found"
    rows = time_column(log)
    time = TimeColumn(column=rows) if rows not in (None, "time", "t") else None
    proposed = SignalMap(time=time, signals=signals, reference=parts[True], databases=tuple(databases))
    proposed, changed, findings = put_right(log, proposed, wheelbase)
    wheels = {one.column for candidates in hints.values() for one in candidates if one.steering_wheel}
    for signal, channel in proposed.signals.items():
        if channel.column in wheels and channel.gain == 1.0:
            reasons[signal] += "; by its name the steering wheel's: it wants gain = 1 / steering ratio, 15 to 25"
        reasons[signal] += f"; {changed[signal]}" if signal in changed else ""
    return Proposal(
        signals=proposed,
        reasons=reasons,
        others={signal: columns for signal, columns in others.items() if columns},
        missing=tuple(_missing(proposed, units)),
        findings=findings,
    )


def _hints(
    found: Survey, units: Sequence[str], taken: Container[str | None]
) -> tuple[dict[str, list[Hint]], list[str]]:
    """By signal the columns that may be it, and those that may be axle loads of whatever axle."""
    hints: dict[str, list[Hint]] = {}
    loads = []
    for name, content in found.contents.items():
        told = hint(name, content.column.unit) if content.alive and name not in taken else None
        if told is not None and told.quantity == "axle_load" and not told.trailing:
            loads.append(name)
        elif told is not None and told.quantity in _USED | _COMPARED:
            hints.setdefault(_signal(told, units), []).append(told)
    return hints, loads


def _signal(told: Hint, units: Sequence[str]) -> str:
    """The signal that a hint would be."""
    if told.quantity == "speed":
        return "speed"
    unit = units[-1] if told.trailing or (told.quantity.startswith("articulation") and len(units) > 1) else units[0]
    place = f"{unit}.front" if told.quantity == "steer" and unit == units[0] else unit
    if told.quantity in ("wheel_speed", "axle_load"):
        place = f"{unit}.{told.side}" if told.side else unit
    return f"{told.quantity}.{place}"


def _sort_gyros(log: Log, found: Survey, hints: dict[str, list[Hint]], units: Sequence[str]) -> str | None:
    """Give the trailer the gyro that follows the others, where no name says whose they are, and what else comes from
    the same box; in words, if so."""
    mine, its = f"yaw_rate.{units[0]}", f"yaw_rate.{units[-1]}"
    unnamed = [one for one in hints.get(mine, []) if one.trailing is None]
    if its in hints or len(unnamed) < 2 or len(units) < 2:
        return None
    channels = {f"yaw_rate.gyro{k}": Channel(column=one.column) for k, one in enumerate(unnamed)}
    try:
        record = assemble(log, coarse(SignalMap(signals=channels)), name=log.name)
    except SignalError:
        return None
    late = [_lag(record, f"yaw_rate.gyro{k}") for k in range(len(unnamed))]
    last = int(np.argmax(late))
    if late[last] - min(late) < _FOLLOWS:
        return None
    clocks = [found.contents[one.column].column.clock for one in unnamed]
    box = clocks[last] if clocks.count(clocks[last]) == 1 else None
    for signal in [signal for signal in hints if signal.endswith(f".{units[0]}")]:
        its = f"{signal.partition('.')[0]}.{units[-1]}"
        moving = [
            one for one in hints[signal] if one is unnamed[last] or found.contents[one.column].column.clock == box
        ]
        if moving:
            hints.setdefault(its, []).extend(moving)
            hints[signal] = [one for one in hints[signal] if one not in moving]
    return f"follows the other gyro by {late[last] - min(late):.2f} s, so it is taken for the trailer's"


def _lag(record: Record, name: str) -> float:
    """s, by how much a channel follows the first of the record; 0 where they have little to do with each other."""
    time = grid(record, 1 / COARSE_RATE)
    one, other = (on_grid(record, n, time) for n in (next(iter(record.signals)), name))
    shifts = range(-round(1.5 * COARSE_RATE), round(1.5 * COARSE_RATE) + 1)
    found = [correlation(one[0], other[0], one[1] & other[1], shift) for shift in shifts]
    best = int(np.argmax(found))
    return shifts[best] / COARSE_RATE if found[best] > 0.8 else 0.0


def _merit(told: Hint, content: Content) -> tuple[bool, bool, float, float]:
    there = 1 - content.missing / max(content.samples, 1)
    rate = content.rate if np.isfinite(content.rate) else 0.0
    return told.trailing is not None, there > 0.5, min(rate, 100.0), content.sigma


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
