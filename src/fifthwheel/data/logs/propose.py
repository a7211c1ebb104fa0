"""Proposal of a signal map: survey of a log, columns by names and units, corrections by the kinematics of a turn."""

from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fifthwheel.base.errors import SignalError, printable
from fifthwheel.base.types import Array
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
    si_unit,
)
from fifthwheel.data.channels.table import UNDERSTEER
from fifthwheel.data.checks.findings import Fault, Finding
from fifthwheel.data.checks.kinematics import at_common_time, common_time, correlation, relations
from fifthwheel.data.checks.plausibility import MIN_SPEED, check
from fifthwheel.data.logs.assemble import assemble
from fifthwheel.data.logs.name_rules import (
    NO_UNIT,
    ColumnHint,
    classify_columns,
    is_rate_by_unit,
    is_speed_by_unit,
)
from fifthwheel.data.logs.signal_map import SignalMap, SignalSource, TimeColumn, relative_keys
from fifthwheel.data.logs.source import Column, LogSource, ReadProgress, no_progress
from fifthwheel.data.record.record import Record
from fifthwheel.data.record.timestamps import Renewals, typical_step

COARSE_RATE = 20.0
"""Hz; sufficient for signs, units and ratios."""
_MAX_ROUNDS = 4
"""A fault may hide another one: degrees a wrong sign."""
_TYPICAL_STEERING_RATIO = 19.0
"""Of heavy trucks; 15 to 25 are common."""
_MAX_STEERING_GAIN = 60.0
"""A larger gain from the road wheels is explained by degrees and a steering ratio together."""
_MIN_TOWED_LAG = 0.1
"""s; the yaw rate of a towed unit lags that of the leading unit by more."""
_MAX_LAG = 1.5
"""s"""
_SIDESLIP = 0.1
"""rad; the sideslip angle of a truck has a smaller standard deviation."""
_ENGINE_SPEED = 400.0
"""rad/s; the engine of a truck is slower, and one that idles is faster in rpm."""


@dataclass(frozen=True, kw_only=True)
class ColumnContent:
    """Statistics of a column over the whole log."""

    column: Column
    samples: int
    """Number of cells, empty ones included."""
    missing: int
    """Number of cells without a number."""
    rate: float
    """Sampling rate, Hz, from the typical step of its time base, or of the new values where it is held; NaN without
    time."""
    low: float
    high: float
    mean: float
    sigma: float
    """low, high, mean and sigma are of the present samples, in the column's unit; NaN if there are none."""
    fault: str | None = None
    """Why the column holds no numbers; None if it does."""

    @property
    def alive(self) -> bool:
        """Whether it holds numbers that are not all zero; an absent sensor gives zeros."""
        return self.fault is None and self.missing < self.samples and (self.high > self.low or bool(self.high))


@dataclass(frozen=True, kw_only=True)
class LogSurvey:
    """The columns of a log and its time span."""

    name: str
    contents: Mapping[str, ColumnContent]
    """By name of the column."""
    start: float
    """First timestamp, s."""
    stop: float
    """Last timestamp, s."""
    notes: tuple[str, ...]


def survey_log(log: LogSource, progress: ReadProgress = no_progress) -> LogSurvey:
    """The survey of an open log, which is read completely."""
    moments = {name: _Moments() for name in log.columns}
    renewals = {name: Renewals() for name in log.columns}
    steps: dict[str, list[float]] = {}
    start, stop = np.inf, -np.inf
    rows = log.row_time
    for chunk in log.chunks(list(log.columns)):
        instants = log.times(chunk, rows)
        time = np.empty(0) if instants is None else instants[np.isfinite(instants)]
        if time.size:
            start, stop = min(start, float(time[0])), max(stop, float(time[-1]))
        if time.size > 1:
            steps.setdefault(chunk.clock, []).append(typical_step(time))
        for name, values in chunk.values.items():
            moments[name].add(values)
            if instants is not None:
                renewals[name].push(instants, values)
        progress(chunk.done)
    contents = {}
    for name, column in log.columns.items():
        step = float(np.median(steps[column.clock])) if column.clock in steps else np.nan
        held = renewals[name].finish()
        rate = held.rate if held else 1 / step if step > 0 else np.nan
        contents[name] = moments[name].content(column, rate, log.unusable.get(name))
    return LogSurvey(name=log.name, contents=contents, start=start, stop=stop, notes=tuple(map(printable, log.notes)))


class _Moments:
    """Moments of a column, chunk by chunk."""

    def __init__(self) -> None:
        self.samples = self.present = 0
        self.low = self.high = np.nan
        self.mean = self.squares = 0.0

    def add(self, values: Array) -> None:
        self.samples += values.size
        present = values[np.isfinite(values)]
        if not present.size:
            return
        self.low, self.high = float(np.fmin(self.low, present.min())), float(np.fmax(self.high, present.max()))
        with np.errstate(over="ignore", invalid="ignore"):  # damaged values may overflow
            mean, count = float(present.mean()), present.size
            self.squares += float(((present - mean) ** 2).sum())
            between = float(np.square(np.float64(mean - self.mean)))
            self.squares += between * count * self.present / (count + self.present)
            self.mean += (mean - self.mean) * count / (count + self.present)
            self.present += count

    def content(self, column: Column, rate: float, fault: str | None) -> ColumnContent:
        present = self.present > 0
        return ColumnContent(
            column=column,
            samples=self.samples,
            missing=self.samples - self.present,
            rate=rate,
            low=self.low,
            high=self.high,
            mean=self.mean if present else np.nan,
            sigma=float(np.sqrt(self.squares / self.present)) if present else np.nan,
            fault=fault,
        )


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
