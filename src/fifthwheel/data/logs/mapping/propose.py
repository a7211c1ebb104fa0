"""Proposal of a signal map from names, units and samples, and its signals.toml."""

import json
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fifthwheel.base.errors import SignalError, printable, printable_lines
from fifthwheel.base.units import factor
from fifthwheel.data.channels import (
    AXLE_LOAD,
    ENGINE_SPEED,
    MOTION,
    SIDESLIP,
    SPEED,
    STEER,
    WHEEL_SPEED,
    YAW_RATE,
    SignalName,
    is_of,
    missing_for_mass,
    names_of,
)
from fifthwheel.data.checks.findings import Finding
from fifthwheel.data.checks.kinematics import at_common_time, common_time, correlation
from fifthwheel.data.logs.assemble import assemble
from fifthwheel.data.logs.mapping.correct import COARSE_RATE, at_coarse_rate, correct_map
from fifthwheel.data.logs.mapping.name_rules import (
    NO_UNIT,
    ColumnHint,
    classify_columns,
    is_rate_by_unit,
    is_speed_by_unit,
)
from fifthwheel.data.logs.mapping.survey import ColumnContent, LogSurvey
from fifthwheel.data.logs.signal_map import SignalMap, SignalSource, TimeColumn, relative_keys
from fifthwheel.data.logs.source import LogSource
from fifthwheel.data.record.record import Record

_MIN_TOWED_LAG = 0.1
"""s; the yaw rate of a towed unit lags that of the leading unit by more."""
_MAX_LAG = 1.5
"""s"""
_SIDESLIP = 0.1
"""rad; the sideslip angle of a truck has a smaller standard deviation."""
_ENGINE_SPEED = 400.0
"""rad/s; the engine of a truck is slower, and one that idles is faster in rpm."""


@dataclass(frozen=True, kw_only=True)
class MapProposal:
    """A proposed map with its reasons."""

    signals: SignalMap
    reasons: Mapping[str, str]
    """By signal: why the column was chosen, and what was corrected by its samples."""
    others: Mapping[str, Sequence[str]]
    """By signal: other candidate columns."""
    missing: tuple[str, ...]
    """Signals that an identification or an observer needs in addition, one sentence each."""
    findings: tuple[Finding, ...]
    """Findings on the signals of the map."""


def propose_map(
    log: LogSource,
    survey: LogSurvey,
    *,
    units: Sequence[str] = ("tractor", "semitrailer"),
    wheelbase: float = 4.5,
    databases: Sequence[Path] = (),
) -> MapProposal:
    """The map that a log's names, units and samples indicate, for the user to edit.

    The log is read again at a low rate to compare signals. `units` are the vehicle's, front to rear; the wheelbase of
    the first one, m, determines the steering ratio.
    """
    named = SignalMap.of_columns(survey.contents)
    mapped = {channel.column for part in named for channel in part.values()}
    candidates, axle_loads, relative = _candidates(survey, units, mapped)
    towed_reason = _assign_towed_gyro(log, survey, candidates, units)
    signals, reference = ({**part} for part in named)
    reasons = {signal: "the column has this name" for part in named for signal in part}
    others: dict[str, Sequence[str]] = {"axle_load.<axle group>": axle_loads}
    for signal, hints in candidates.items():
        best = None
        if signal not in reasons and hints:
            best = max(hints, key=lambda hint: _rank(hint, survey.contents[hint.column]))
            log_unit, unit = survey.contents[best.column].column.unit, _unit(best, survey.contents[best.column])
            part = reference if best.channel.proposed == "reference" else signals
            sensor = best.sensor if part is signals else ""
            part[signal] = SignalSource(column=best.column, unit=None if unit == log_unit else unit, sensor=sensor)
            by_magnitude = f"; unit {unit} by its magnitude" if unit not in (log_unit, best.unit) else ""
            reasons[signal] = f"by its name{'' if unit is None else f', in {unit}'}{by_magnitude}"
        others[signal] = [hint.column for hint in hints if hint is not best]
    if towed_reason:
        reasons[f"yaw_rate.{units[-1]}"] += f"; {towed_reason}"
    if "speed" not in signals:
        _assign_speed(survey, signals, reasons, others, units[0])
    rows = log.row_time
    time = TimeColumn(column=None if rows in ("time", "t") else rows)
    proposed = SignalMap(time=time, signals=signals, reference=reference, databases=tuple(databases))
    proposed, corrections, findings = correct_map(log, proposed, wheelbase)
    steering_wheels = {hint.column for hints in candidates.values() for hint in hints if hint.steering_wheel}
    for signal, channel in proposed.signals.items():
        if channel.column in steering_wheels and channel.gain == 1.0:
            reasons[signal] += "; steering-wheel angle by its name: set gain = 1 / steering ratio, 1/15 to 1/25"
        reasons[signal] += f"; {corrections[signal]}" if signal in corrections else ""
    return MapProposal(
        signals=proposed,
        reasons=reasons,
        others={signal: columns for signal, columns in others.items() if columns},
        missing=(
            *missing_signals(proposed, units, relative),
            *[text for signal, text in relative.items() if signal not in proposed.signals],
            *_rates_of_unknown_axes(proposed, survey),
        ),
        findings=findings,
    )


def as_toml(proposal: MapProposal, survey: LogSurvey) -> str:
    """The proposal as a signals.toml for the user to edit, with its reasons as comments."""
    proposed = proposal.signals
    lines = _comments([f"Proposed for {printable(survey.name)} by names, units and samples. Check every line."])
    if proposed.databases:
        lines.append(f"databases = [{', '.join(_quoted(str(path)) for path in proposed.databases)}]")
    if proposed.time.column is not None:
        lines += ["", "[time]", f"column = {_quoted(proposed.time.column)}"]
    for part, channels in (("signals", proposed.signals), ("reference", proposed.reference)):
        for signal, channel in channels.items():
            content = survey.contents.get(channel.column or "")
            unit = channel.unit or (content.column.unit if content else None)
            lines += ["", f"[{part}.{_quoted(signal)}]", *_comments(proposal.reasons[signal].split("; "))]
            lines.append(f"column = {_quoted(channel.column or '')}")
            lines += [f"unit = {_quoted(unit)}"] if unit is not None else []
            lines += [f"sensor = {_quoted(channel.sensor)}"] if channel.sensor else []
            lines += [f"sign = {channel.sign}"] if channel.sign != 1 else []
            lines += [f"gain = {channel.gain_text}"] if channel.gain != 1.0 else []
            lines += [f"delay = {channel.delay:g}"] if channel.delay else []
            lines += _comments(f"or column = {_quoted(other)}" for other in proposal.others.get(signal, ()))
    for signal, columns in proposal.others.items():
        if signal not in proposed.signals and signal not in proposed.reference:
            lines += ["", f"# [signals.{_quoted(signal)}], for on-board weighing:"]
            lines += _comments(f"column = {_quoted(column)}" for column in columns)
    findings = [line for finding in proposal.findings for line in str(finding).splitlines()]
    for paragraph in (proposal.missing, findings):
        lines += ["", *_comments(paragraph)] if paragraph else []
    return "\n".join(lines) + "\n"


def _comments(texts: Iterable[str]) -> list[str]:
    return [f"# {line}" for text in texts for line in printable_lines(text).split("\n")]


def _quoted(text: str) -> str:
    """A text as a string of TOML."""
    return printable(json.dumps(text, ensure_ascii=False))


def _candidates(
    survey: LogSurvey, units: Sequence[str], mapped: Container[str | None]
) -> tuple[dict[str, list[ColumnHint]], list[str], dict[str, str]]:
    """Candidate columns by signal, columns with axle loads of an unknown axle, and sentences on relative columns."""
    candidates: dict[str, list[ColumnHint]] = {}
    axle_loads, relative = [], dict[str, str]()
    for name, hint in classify_columns({n: content.column.unit for n, content in survey.contents.items()}).items():
        signal = hint.signal(units)
        if signal is None or not survey.contents[name].alive or name in mapped:
            continue
        if hint.channel.proposed == "reference" and not _is_plausible(hint, survey.contents[name]):
            continue
        if hint.channel is AXLE_LOAD and not hint.trailing:
            axle_loads.append(name)
        elif hint.is_relative:
            problem = f"{signal}: {name} is in percent of a reference that the log does not have"
            relative[signal] = f"{problem}; map it with {relative_keys(signal)}"
        else:
            candidates.setdefault(signal, []).append(hint)
    return candidates, axle_loads, relative


def _unit(hint: ColumnHint, content: ColumnContent) -> str | None:
    """The unit of a column by file or name; deg and rpm where its values are too large for rad and rad/s."""
    unit = content.column.unit or hint.unit
    has_none = unit is None or unit.strip() in NO_UNIT
    if hint.channel is ENGINE_SPEED and (unit == "1/min" or (has_none and content.high > _ENGINE_SPEED)):
        return "rpm"
    is_angle = hint.channel is SIDESLIP and (has_none or unit == "rad")
    return "deg" if is_angle and content.sigma > _SIDESLIP else unit


def _is_plausible(hint: ColumnHint, content: ColumnContent) -> bool:
    """Whether a reference has a magnitude that its quantity can have."""
    unit, limit = _unit(hint, content), hint.channel.limit
    if unit is None or unit.strip() in NO_UNIT or limit is None or hint.channel is SIDESLIP:
        return True
    return (abs(content.mean) + 2 * content.sigma) * factor(unit, hint.channel.unit) < limit.magnitude


def _assign_speed(
    survey: LogSurvey,
    signals: dict[str, SignalSource],
    reasons: dict[str, str],
    others: dict[str, Sequence[str]],
    leading: str,
) -> None:
    """Where no name is that of the speed: the speed of the front wheels, a column in km/h, or the speed of a wheel."""
    front, wheels = f"wheel_speed.{leading}.front", names_of(WHEEL_SPEED, signals)
    if front in signals:
        signals["speed"], reasons["speed"] = signals.pop(front), "speed of the front wheels, the only speed"
        return
    mapped = {channel.column for channel in signals.values()}
    columns = [
        name
        for name, content in survey.contents.items()
        if name not in mapped and is_speed_by_unit(name, content.column.unit, content.low, content.high)
    ]
    if columns:
        best, *others["speed"] = sorted(columns, key=lambda name: -survey.contents[name].sigma)
        content = survey.contents[best]
        signals["speed"] = SignalSource(column=best)
        reasons["speed"] = f"by its unit, {content.column.unit}, and its largest value, {content.high:.0f}"
    elif wheels and SignalName.of(wheels[0]).unit == leading:
        signals["speed"] = signals.pop(wheels[0])
        reasons["speed"] = f"{wheels[0]} is the only speed"


def _assign_towed_gyro(
    log: LogSource, survey: LogSurvey, candidates: dict[str, list[ColumnHint]], units: Sequence[str]
) -> str | None:
    """Move a gyro that lags the others, and all channels of its device, to the last unit; the reason in words."""
    leading, towed = f"yaw_rate.{units[0]}", f"yaw_rate.{units[-1]}"
    gyros = [hint for hint in candidates.get(leading, []) if hint.trailing is None]
    if towed in candidates or len(gyros) < 2 or len(units) < 2:
        return None
    channels = {f"yaw_rate.gyro{k}": SignalSource(column=hint.column) for k, hint in enumerate(gyros)}
    try:
        record = assemble(log, at_coarse_rate(SignalMap(signals=channels)), name=log.name)
    except SignalError:
        return None
    lags = [_lag(record, signal) for signal in channels]
    last = int(np.argmax(lags))
    if lags[last] - min(lags) < _MIN_TOWED_LAG:
        return None
    clocks = [survey.contents[hint.column].column.clock for hint in gyros]
    device = clocks[last] if clocks.count(clocks[last]) == 1 else None
    for signal in [signal for signal in candidates if SignalName.of(signal).place == units[0]]:
        for hint in [*candidates[signal]]:
            if hint is gyros[last] or survey.contents[hint.column].column.clock == device:
                candidates.setdefault(f"{SignalName.of(signal).quantity}.{units[-1]}", []).append(hint)
                candidates[signal].remove(hint)
    return f"it lags the other gyro by {lags[last] - min(lags):.2f} s, as a towed unit does"


def _lag(record: Record, name: str) -> float:
    """Lag of a channel behind the record's first one, s; 0 where their correlation is low."""
    time = common_time(record, 1 / COARSE_RATE)
    (first, first_known), (other, other_known) = (
        at_common_time(record, signal, time) for signal in (next(iter(record.signals)), name)
    )
    steps = round(_MAX_LAG * COARSE_RATE)
    shifts = range(-steps, steps + 1)
    correlations = [correlation(first, other, first_known & other_known, shift) for shift in shifts]
    best = int(np.argmax(correlations))
    return shifts[best] / COARSE_RATE if correlations[best] > 0.8 else 0.0


def _rank(hint: ColumnHint, content: ColumnContent) -> tuple[bool, bool, bool, float, float]:
    """Sort key of candidates: complete ones first, then road wheels, named units, high rates and large variation."""
    present = 1 - content.missing / max(content.samples, 1)
    rate = content.rate if np.isfinite(content.rate) else 0.0
    return present > 0.5, not hint.steering_wheel, hint.trailing is not None, min(rate, 100.0), content.sigma


def _rates_of_unknown_axes(proposed: SignalMap, survey: LogSurvey) -> list[str]:
    """A sentence on columns with the unit of a rate, if the map has no yaw rate."""
    contents = survey.contents.items()
    rates = [name for name, content in contents if is_rate_by_unit(name, content.column.unit) and content.alive]
    if not rates or any(is_of(name, YAW_RATE) for name in proposed.signals):
        return []
    return [f"columns with the unit of a rate, of an unknown axis: {', '.join(rates[:6])}"]


def missing_signals(proposed: SignalMap, units: Sequence[str], others: Iterable[str] = ()) -> list[str]:
    """Sentences on the signals that an estimator needs and the map does not have; `others` are in the log too."""
    front, yaw_rate = f"steer.{units[0]}.front", f"yaw_rate.{units[0]}"
    if not missing_for_mass([*proposed.signals, *others]) and not any(
        is_of(name, STEER, *MOTION) for name in proposed.signals
    ):
        return [f"{front} and {yaw_rate}: not found; this log gives the gross mass only (fifthwheel mass)"]
    needed = {"speed": [SPEED], front: [STEER], yaw_rate: MOTION}
    missing = [
        f"{name}: not found; every estimator needs it"
        for name, any_of in needed.items()
        if not any(is_of(signal, *any_of) for signal in proposed.signals)
    ]
    for unit in units[1:]:
        yaw_rate, articulation, roll_rate = (f"{q}.{unit}" for q in ("yaw_rate", "articulation", "roll_rate"))
        if yaw_rate not in proposed.signals and articulation not in proposed.signals:
            missing.append(f"{yaw_rate} or {articulation}: not found; with one of them the stiffness is more accurate")
        if roll_rate not in proposed.signals:
            missing.append(f"{roll_rate}: not found; without it the payload height cannot be identified")
    return missing
