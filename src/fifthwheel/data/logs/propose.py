"""Proposal of a signal map: columns by names and units, corrections by the kinematics of a turn."""

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from fifthwheel.base.errors import SignalError
from fifthwheel.base.formatting import enumerated
from fifthwheel.base.units import factor
from fifthwheel.data.channels import (
    AXLE_LOAD,
    ENGINE_SPEED,
    MOTION,
    ROLL,
    ROLL_RATE,
    SIDESLIP,
    SPEED,
    STEER,
    WHEEL_SPEED,
    YAW_RATE,
    SignalName,
    channel_of,
    is_of,
    missing_for_mass,
    names_of,
    si_unit,
)
from fifthwheel.data.channels.table import UNDERSTEER
from fifthwheel.data.checks.findings import Fault, Finding, remedy_text, warning
from fifthwheel.data.checks.kinematics import Relation, at_common_time, common_time, correlation, relations, signs_of
from fifthwheel.data.checks.plausibility import MIN_SPEED, check
from fifthwheel.data.checks.signs import Signs
from fifthwheel.data.logs.assemble import assemble
from fifthwheel.data.logs.likely_units import (
    CLOSE,
    RATIO_SIGMA,
    TYPICAL_STEERING_RATIO,
    ColumnReading,
    likely_units,
    readings,
)
from fifthwheel.data.logs.name_rules import (
    NO_UNIT,
    ColumnHint,
    classify_columns,
    is_course,
    is_rate_by_unit,
    is_speed_by_unit,
)
from fifthwheel.data.logs.row_time import find_row_time
from fifthwheel.data.logs.signal_map import SignalMap, SignalSource, TimeColumn, relative_keys
from fifthwheel.data.logs.source import LogSource
from fifthwheel.data.logs.survey import ColumnContent, LogSurvey
from fifthwheel.data.record.record import Record

COARSE_RATE = 20.0
"""Hz; sufficient for signs, units and ratios."""
_LEAST_SAMPLES = 10
"""Of a signal whose unit the samples show."""
_MIN_TOWED_LAG = 0.1
"""s; the yaw rate of a towed unit lags that of the leading unit by more."""
_STEERING_RATIOS = (7.0, 60.0)
"""Size of a steering-wheel angle over that expected of the road wheels; trucks have a ratio of 15 to 25."""
_WHEELBASE = 0.03
"""Standard deviation of the logarithm of the wheelbase that a turn at low speed has, by the scrub of tandem axles."""
_WEAK = 0.15
"""Correlation of an inverted signal from which its sign is asked."""
_MAX_LAG = 1.5
"""s"""
_SIDESLIP = 0.1
"""rad; the sideslip angle of a truck has a smaller standard deviation."""
_ENGINE_SPEED = 400.0
"""rad/s; the engine of a truck is slower, and one that idles is faster in rpm."""


def correct_map(
    log: LogSource, proposed: SignalMap, wheelbase: float, hints: Mapping[str, ColumnHint] = MappingProxyType({})
) -> tuple[SignalMap, dict[str, str], tuple[Finding, ...], tuple[Finding, ...]]:
    """The map with the units, the steering ratio and the signs that the samples show, read at a low rate.

    Also the corrections in words by signal; questions: what else explains the samples nearly as well; and the remaining
    findings. `wheelbase` is that of the leading unit, m; `hints` are those of the columns mapped by their names.
    """
    if not proposed.signals:
        return proposed, {}, (), ()
    try:
        record = assemble(log, at_coarse_rate(proposed), name=log.name)
    except SignalError as error:
        first_line = str(error).partition("\n")[0]
        return proposed, {}, (), (Finding(signal="time", fault=Fault.DROPOUT, severity="error", message=first_line),)
    signals, corrections, questions = _with_likely_units(log, proposed, record, wheelbase, hints)
    units = {name: log.columns[log.find(channel.column or "")].unit for name, channel in signals.items()}

    def in_map(signals: Mapping[str, SignalSource]) -> Record:
        scales = [
            {name: _scale(name, channel, units[name]) for name, channel in mapped.items()}
            for mapped in (signals, proposed.signals)
        ]
        return record.with_signals({n: scales[0][n] / scales[1][n] * record.signals[n] for n in signals})

    corrected = in_map(signals)
    for finding in check(corrected, wheelbase=wheelbase):
        name, unit = finding.signal, finding.remedy.get("unit")
        if name not in signals:
            continue
        if finding.fault is Fault.SWAPPED_SIGN:
            signals[name] = signals[name].model_copy(update={"sign": -signals[name].sign})
            corrections.setdefault(name, []).append("sign inverted, it contradicted other signals")
        elif finding.fault is Fault.UNIT and unit not in (None, "m/s", signals[name].unit or units[name]):
            signals[name] = signals[name].model_copy(update={"unit": unit})
            corrections.setdefault(name, []).append(f"unit {unit} by its magnitude")
    for name, channel in signals.items():
        jumps = [note.partition(": ")[2] for note in record.notes if note.startswith(f"{channel.column}: jumps")]
        corrections[name] = [*jumps, *corrections.get(name, [])]
    every = [*relations(corrected, wheelbase=wheelbase, min_speed=MIN_SPEED)]
    signs = signs_of(every)
    questions += (*_mirrored(signs), *_weak_signs(every, signs))
    result = proposed.model_copy(update={"signals": signals})
    words = {name: "; ".join(texts) for name, texts in corrections.items() if texts}
    return result, words, questions, without_set_units(check(in_map(signals), wheelbase=wheelbase), result, log)


def _mirrored(signs: Signs) -> Iterator[Finding]:
    """The question whether the other signals are inverted, where that is nearly as likely."""
    if signs.inverted and signs.margin < CLOSE:
        first, *others = signs.inverted
        problem = (
            f"{enumerated(['its sign', *others])} inverted: few signs are, by usual frames of devices "
            f"(z up or z down); if {enumerated(signs.others)} are inverted instead, all signals agree too, mirrored; "
            "look at a left turn: steer, yaw rate and lateral acceleration must be positive, and the roll, because a "
            f"body rolls outwards; otherwise sign = -1 in signals.toml for {enumerated(signs.others)} only; the "
            "estimates are the same, the signs of the states are not"
        )
        yield warning(first, Fault.SWAPPED_SIGN, problem, others=tuple(others))


def _weak_signs(every: Iterable[Relation], signs: Signs) -> Iterator[Finding]:
    """The question whether signals are inverted that are too weak to decide it."""
    for relation in every:
        sign = -1 if relation.own in signs.inverted else 1
        undecided = relation.signal not in (*signs.inverted, *signs.others) and relation.turn.has_other_causes
        if relation.excited and undecided and sign * relation.correlation < -_WEAK:
            problem = (
                f"its sign is not clear: inverted, it has a correlation of {abs(relation.correlation):.2f} with turns;"
                " a body rolls outwards, so that its roll increases where a left turn begins; look at one, or propose"
                " a map for more logs of this logger together"
            )
            yield warning(relation.signal, Fault.SWAPPED_SIGN, problem)


def without_set_units(findings: Iterable[Finding], signal_map: SignalMap, log: LogSource) -> tuple[Finding, ...]:
    """The findings without advice to set a unit that the map has already."""
    kept = []
    for finding in findings:
        channel, unit = signal_map.signals.get(finding.signal), finding.remedy.get("unit")
        if channel is not None and unit is not None:
            mapped = channel.unit or log.columns[log.find(channel.columns[0])].unit
            si = channel.si(finding.signal)
            if mapped is not None and factor(mapped, si) == factor(str(unit), si):
                problem = finding.message.removesuffix(f"; {remedy_text(finding.remedy)}")
                message = f"{problem}; it is read in {mapped} already: map another column, or correct the gain"
                finding = replace(finding, message=message, remedy={})
        kept.append(finding)
    return tuple(kept)


def _with_likely_units(
    log: LogSource, proposed: SignalMap, record: Record, wheelbase: float, hints: Mapping[str, ColumnHint]
) -> tuple[dict[str, SignalSource], dict[str, list[str]], tuple[Finding, ...]]:
    """The channels with the units that explain all signals, the corrections in words, and questions."""
    signals, options, stated = dict(proposed.signals), dict[str, tuple[ColumnReading, ...]](), dict[str, bool]()
    corrections: dict[str, list[str]] = {}
    for name, channel in signals.items():
        definition, column = channel_of(name), log.columns[log.find(channel.column or "")]
        is_compared = definition is not None and (definition.turn or definition is SPEED or definition is STEER)
        if not is_compared or channel.derivative or np.isfinite(record.signals[name]).sum() < _LEAST_SAMPLES:
            continue
        hint, unit = hints.get(channel.column or ""), channel.unit or column.unit
        has_unit = unit is not None and unit.strip() not in NO_UNIT
        stated[name] = has_unit or hint is None  # a column with the name of a signal is in SI
        wheel = True if hint and hint.steering_wheel else False if hint and hint.of_wheel else None
        options[name] = readings(name, unit if has_unit else None if hint else si_unit(name), wheel)
    found = likely_units(record, options, stated, wheelbase)
    for name, reading in found.readings.items():
        first = options[name][0]
        if reading.unit != first.unit or (not stated[name] and reading.unit != si_unit(name)):
            signals[name] = signals[name].model_copy(update={"unit": reading.unit})
            words = f"unit {reading.unit} by its magnitude"
            if name in found.gains:
                ratio, _ = found.gains[name]
                times = [
                    f"{ratio * scale:.2g} times in {unit}"
                    for unit, scale in ((reading.unit, 1.0), (first.unit, first.scale / reading.scale))
                ]
                words += f": {' and '.join(times)} what the other signals predict"
            corrections[name] = [words]
        if reading.wheel and _STEERING_RATIOS[0] < found.gains.get(name, (0.0, 0.0))[0] < _STEERING_RATIOS[1]:
            scale = found.readings["speed"].scale / options["speed"][0].scale
            used = _steering_ratio(*found.gains[name], scale * float(np.nanmedian(record.signals["speed"])), wheelbase)
            source = signals[name].model_copy(update={"sensor": "steering wheel"})
            signals[name] = source.with_uncertain(gain=f"{1 / used.value:.4g} +- {100 * used.sigma:.0f} %")
            corrections.setdefault(name, []).append(used.words)
    return signals, corrections, found.findings


def at_coarse_rate(proposed: SignalMap) -> SignalMap:
    """The map with a low sampling rate."""
    return proposed.model_copy(update={"time": proposed.time.model_copy(update={"rate": COARSE_RATE})})


def _scale(signal: str, channel: SignalSource, log_unit: str | None) -> float:
    """SI value of the signal for a column value of one."""
    si = channel.si(signal)
    return channel.sign * channel.gain * factor(channel.unit or log_unit or si, si)


class _Ratio(NamedTuple):
    """A steering ratio."""

    value: float
    sigma: float
    """As a fraction."""
    words: str


def _steering_ratio(ratio: float, of_lag: float, speed: float, wheelbase: float) -> _Ratio:
    """The ratio of a steering-wheel angle that is `ratio` times the road-wheel angle expected at a speed, m/s.

    `of_lag` is the standard deviation of its logarithm by the lag. Joined with the usual ratio of trucks.
    """
    # the understeer gradient of a truck may be 0, or twice the usual one
    of_understeer = UNDERSTEER * speed**2 / (wheelbase + UNDERSTEER * speed**2)
    sigma = float(np.linalg.norm([of_lag, of_understeer, _WHEELBASE]))
    weight = RATIO_SIGMA**2 / (RATIO_SIGMA**2 + sigma**2)
    used = round(float(TYPICAL_STEERING_RATIO ** (1 - weight) * ratio**weight), 1)
    words = (
        f"this is the steering-wheel angle: yaw rate and a wheelbase of {wheelbase:g} m give a steering ratio of "
        f"{ratio:.3g} +- {100 * sigma:.0f} %; joined with {TYPICAL_STEERING_RATIO:g} +- {100 * RATIO_SIGMA:.0f} % of "
        f"trucks, the map uses {used:g}; if you know the steering ratio, set gain to 1 / ratio"
    )
    return _Ratio(used, RATIO_SIGMA * np.sqrt(1 - weight), words)


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
    questions: tuple[Finding, ...]
    """What was assumed, and what else explains the log nearly as well."""
    findings: tuple[Finding, ...]
    """The questions, and findings on the signals of the map."""


def propose_map(
    log: LogSource,
    survey: LogSurvey,
    *,
    units: Sequence[str] = ("tractor", "semitrailer"),
    steered: str = "front",
    wheelbase: float = 4.5,
    databases: Sequence[Path] = (),
) -> MapProposal:
    """The map that a log's names, units and samples indicate, for the user to edit.

    The log is read again at a low rate to compare signals. `units` are the vehicle's, front to rear; `steered` is
    the first steered axle group of the first one, whose wheelbase, m, determines the steering ratio.
    """
    named = SignalMap.of_columns(survey.contents)
    mapped = {channel.column for part in named for channel in part.values()}
    candidates, axle_loads, relative = _candidates(survey, units, steered, mapped)
    towed = _assign_towed_gyros(log, survey, candidates, units)
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
    for signal, reason in towed.items():
        reasons[signal] += f"; {reason}"
    if "speed" not in signals:
        _assign_speed(survey, signals, reasons, others, units[0])
    if not names_of(YAW_RATE, signals):
        _assign_course(survey, signals, reasons, units[0])
    rows = find_row_time(log)
    time = TimeColumn(column=None if rows in ("time", "t") else rows)
    proposed = SignalMap(time=time, signals=signals, reference=reference, databases=tuple(databases))
    by_column = {hint.column: hint for found in candidates.values() for hint in found}
    proposed, corrections, questions, findings = correct_map(log, proposed, wheelbase, by_column)
    questions += tuple(_of_wheel(proposed, by_column))
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
            *missing_signals(proposed, units, steered, relative),
            *[text for signal, text in relative.items() if signal not in proposed.signals],
            *_rates_of_unknown_axes(proposed, survey),
        ),
        questions=questions,
        findings=(*questions, *findings),
    )


def _candidates(
    survey: LogSurvey, units: Sequence[str], steered: str, mapped: Container[str | None]
) -> tuple[dict[str, list[ColumnHint]], list[str], dict[str, str]]:
    """Candidate columns by signal, columns with axle loads of an unknown axle, and sentences on relative columns."""
    candidates: dict[str, list[ColumnHint]] = {}
    axle_loads, relative = [], dict[str, str]()
    for name, hint in classify_columns({n: content.column.unit for n, content in survey.contents.items()}).items():
        signal = hint.signal(units, steered)
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


def _assign_course(survey: LogSurvey, signals: dict[str, SignalSource], reasons: dict[str, str], leading: str) -> None:
    """Where no column is a yaw rate: the derivative of a course or heading."""
    for name, content in survey.contents.items():
        if content.alive and is_course(name, content.column.unit, content.low, content.high):
            signal, unit = f"yaw_rate.{leading}", None if content.column.unit else "deg"
            signals[signal] = SignalSource(column=name, unit=unit, derivative=True, sign=-1)
            reasons[signal] = (
                "no yaw rate; the derivative of a course, which is clockwise: it contains the noise and the delay of "
                "the receiver, and the change of the sideslip angle"
            )
            return


def _assign_towed_gyros(
    log: LogSource, survey: LogSurvey, candidates: dict[str, list[ColumnHint]], units: Sequence[str]
) -> dict[str, str]:
    """Move gyros that lag the others, and all channels of their devices, to towed units; the reasons by signal.

    As many gyros as units are those of the units in the order of their lags; else the last one is of the last unit.
    """
    gyros = [hint for hint in candidates.get(f"yaw_rate.{units[0]}", []) if hint.trailing is None]
    gyros = [hint for hint in gyros if not hint.is_computed] or gyros  # a filtered gyro lags too
    if len(units) < 2 or len(gyros) < 2 or f"yaw_rate.{units[-1]}" in candidates:
        return {}
    channels = {f"yaw_rate.gyro{k}": SignalSource(column=hint.column) for k, hint in enumerate(gyros)}
    try:
        record = assemble(log, at_coarse_rate(SignalMap(signals=channels)), name=log.name)
    except SignalError:
        return {}
    lags = np.array([_lag(record, signal) for signal in channels])
    order = np.argsort(lags, kind="stable")
    named = any(f"yaw_rate.{unit}" in candidates for unit in units[1:])
    if named or len(gyros) != len(units) or np.diff(lags[order]).min() < _MIN_TOWED_LAG:
        order, units = order[[0, -1]], (units[0], units[-1])
    if lags[order[-1]] - lags[order[0]] < _MIN_TOWED_LAG:
        return {}
    for last, unit in zip(order[1:].tolist(), units[1:], strict=True):
        _move_device(survey, candidates, units[0], unit, gyros[last], [g for g in gyros if g is not gyros[last]])
    behind = zip(order[1:], units[1:], strict=True)
    return {
        f"yaw_rate.{unit}": f"it lags the first gyro by {lags[k] - lags[order[0]]:.2f} s, as a towed unit does"
        for k, unit in behind
    }


def _move_device(
    survey: LogSurvey,
    candidates: dict[str, list[ColumnHint]],
    leading: str,
    unit: str,
    gyro: ColumnHint,
    others: Sequence[ColumnHint],
) -> None:
    """Move a gyro, and the columns with its own clock or the words that only its name has, to another unit."""
    clock = survey.contents[gyro.column].column.clock
    alone = clock not in [survey.contents[other.column].column.clock for other in others]
    own = set(gyro.words.split("_")).difference(*[other.words.split("_") for other in others])
    for signal in [signal for signal in candidates if SignalName.of(signal).place == leading]:
        for hint in [*candidates[signal]]:
            named = bool(own) and own <= set(hint.words.split("_"))
            if hint is gyro or named or (alone and survey.contents[hint.column].column.clock == clock):
                candidates.setdefault(f"{SignalName.of(signal).quantity}.{unit}", []).append(hint)
                candidates[signal].remove(hint)


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


def _rank(hint: ColumnHint, content: ColumnContent) -> tuple[bool, bool, bool, bool, bool, float, float]:
    """Sort key: complete columns first, then of the body, road wheels, named units, those that are not computed, high
    rates and large variation."""
    present = 1 - content.missing / max(content.samples, 1)
    rate = content.rate if np.isfinite(content.rate) else 0.0
    of_body = hint.channel is STEER or not hint.of_wheel
    named, raw = hint.trailing is not None, not hint.is_computed
    return present > 0.5, of_body, not hint.steering_wheel, named, raw, min(rate, 100.0), content.sigma


def _of_wheel(proposed: SignalMap, hints: Mapping[str, ColumnHint]) -> Iterator[Finding]:
    """A caution on each motion of the body that only a column of a wheel may have."""
    for signal, channel in proposed.signals.items():
        hint = hints.get(channel.column or "")
        if hint and hint.of_wheel and is_of(signal, *MOTION, ROLL_RATE, ROLL):
            problem = (
                f"{hint.column} is of a wheel or an axle by its name, which moves unlike the body: a steered wheel "
                "turns with its steer angle too; map a column of the body in signals.toml, or delete it"
            )
            yield warning(signal, Fault.WRONG_COLUMN, problem)


def _rates_of_unknown_axes(proposed: SignalMap, survey: LogSurvey) -> list[str]:
    """A sentence on columns with the unit of a rate, if the map has no yaw rate."""
    contents = survey.contents.items()
    rates = [name for name, content in contents if is_rate_by_unit(name, content.column.unit) and content.alive]
    if not rates or any(is_of(name, YAW_RATE) for name in proposed.signals):
        return []
    return [f"columns with the unit of a rate, of an unknown axis: {', '.join(rates[:6])}"]


def missing_signals(proposed: SignalMap, units: Sequence[str], steered: str, others: Iterable[str] = ()) -> list[str]:
    """Sentences on the signals that an estimator needs and the map does not have; `others` are in the log too."""
    front, yaw_rate = f"steer.{units[0]}.{steered}", f"yaw_rate.{units[0]}"
    if not missing_for_mass([*proposed.signals, *others]) and not any(
        is_of(name, STEER, *MOTION) for name in proposed.signals
    ):
        return [f"{front} and {yaw_rate}: not in the map; this log gives the gross mass only (fifthwheel mass)"]
    needed = {"speed": [SPEED], front: [STEER], yaw_rate: MOTION}
    missing = [
        f"{name}: not in the map; every estimator needs it"
        for name, any_of in needed.items()
        if not any(is_of(signal, *any_of) for signal in proposed.signals)
    ]
    for unit in units[1:]:
        yaw_rate, articulation, roll_rate = (f"{q}.{unit}" for q in ("yaw_rate", "articulation", "roll_rate"))
        if yaw_rate not in proposed.signals and articulation not in proposed.signals:
            missing.append(
                f"{yaw_rate} or {articulation}: not in the map; with one of them the stiffness is more accurate"
            )
        if roll_rate not in proposed.signals:
            missing.append(f"{roll_rate}: not in the map; without it the payload height cannot be identified")
    return missing
