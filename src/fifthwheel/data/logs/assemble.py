"""From the columns of a log and a signal map to a record on one time base."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fifthwheel.base.errors import SignalError, UnitError, printable
from fifthwheel.base.types import Array
from fifthwheel.base.units import factor, quantity
from fifthwheel.data.channels import SPEED, STEER, is_input, is_of, si_unit
from fifthwheel.data.channels.sensors import SensorPrior
from fifthwheel.data.checks.missing_marks import MissingMarks
from fifthwheel.data.checks.samples import impossible_samples, spike_mask, spike_note
from fifthwheel.data.logs.row_time import RowTime, find_row_time
from fifthwheel.data.logs.signal_map import SignalMap, SignalSource, relative_cure
from fifthwheel.data.logs.source import Chunk, LogSource, ReadProgress, no_progress
from fifthwheel.data.record.full_turns import Unwrapped
from fifthwheel.data.record.record import Record
from fifthwheel.data.record.resample import DECIMATION_RATIO, StreamDecimator, snap_to_grid
from fifthwheel.data.record.timestamps import (
    SLOWEST_SPEED,
    HeldSamples,
    Renewals,
    RepeatedTimestamps,
    implausible_timestamps,
    instant,
    origin,
    typical_step,
    utc_date,
)

Window = tuple[float, float]
"""First and last instant, s."""
_MAX_TIME = 1e100
"""s; a larger magnitude is no timestamp, and differences would overflow."""
_LOGGER = "logger"
"""Name of the logger's own clock, where the steer angle has another one."""
_LEAST_SPARSE, _REGULAR = 10, 0.8
"""Samples of an input of a lower rate than the rows, and the fraction of them at regular steps; else samples are
missing."""
_SLOWEST_STEER = 0.25
"""s; a driver steers within a longer period."""
SAME_INSTANT = 1e-6
"""s; timestamps closer than this are one instant."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Samples:
    """A channel at its own instants."""

    time: Array
    """(n,) s."""
    values: Array
    """(n,) in SI."""
    own_time: bool
    """Whether its instants differ from those of the rows: it has a time base or a delay of its own, or is held."""


_Key = tuple[str, str]
"""Of a channel: "signals" or "reference", and the name of the signal."""


def assemble(
    log: LogSource,
    signal_map: SignalMap,
    *,
    name: str,
    exclude: Sequence[Window] = (),
    progress: ReadProgress = no_progress,
) -> Record:
    """The record that a map makes of a log, without the samples whose timestamps are in the windows `exclude`.

    A SignalError names a column that does not exist, holds no numbers, or has no usable time.
    """
    if not signal_map.signals and not signal_map.reference:
        raise SignalError(f"{log.name}: no column is mapped to a signal; map columns in signals.toml")
    parts = {"signals": signal_map.signals, "reference": signal_map.reference}
    channels = {(part, signal): channel for part, mapped in parts.items() for signal, channel in mapped.items()}
    sources = {key: _sources(log, signal_map, key[1], channel) for key, channel in channels.items()}
    columns: dict[_Timestamps, dict[str, _Use]] = {}
    for key, channel in channels.items():
        for timestamps, column in sources[key]:
            use = columns.setdefault(timestamps, {}).setdefault(column, _Use())
            use.add(key[1], channel, log.columns[column].unit)
    time_bases = {timestamps: _TimeBase(log, timestamps, uses, signal_map) for timestamps, uses in columns.items()}
    needed = {column for timestamps, names in columns.items() for column in (timestamps.column, *names) if column}
    unmatched = set(exclude)
    for chunk in _outside(log, needed, unmatched, exclude, signal_map) if exclude else log.chunks(needed):
        for timestamps, time_base in time_bases.items():
            if timestamps.clock == chunk.clock:
                time_base.push(chunk)
        progress(chunk.done)
    unusable = [reason for column, reason in log.unusable.items() if column in needed]
    if unusable:
        raise SignalError("\n".join(unusable))
    notes = [*log.notes, *(note for time_base in time_bases.values() for note in time_base.finish())]
    notes += [f"exclude {first:g}..{last:g} s: no timestamp is in this window" for first, last in sorted(unmatched)]

    rows = next((time_base for timestamps, time_base in time_bases.items() if timestamps.of_rows), None)
    samples = {}
    for key, channel in channels.items():
        of_channel = [(time_bases[timestamps], column) for timestamps, column in sources[key]]
        samples[key], of_samples = _samples(key[1], channel, log, of_channel, rows)
        notes += of_samples
    time, aligned = _align(rows.time if rows else None, samples, signal_map.rate)
    begin = log.start
    if shift := origin(time[0]):
        notes.append(f"time begins at {instant(shift)}, shifted to 0")
        begin, time = shift, time - shift
    record = Record(
        time=time,
        signals={signal: values for (part, signal), values in aligned.items() if part == "signals"},
        reference={signal: values for (part, signal), values in aligned.items() if part == "reference"},
        name=name,
        notes=tuple(dict.fromkeys(map(printable, notes))),
        time_bases=_time_bases(log, channels),
        sensors=_sensors(log, signal_map.signals),
        date=None if begin is None else utc_date(begin),
    )
    start, stop = signal_map.span
    return record if (start, stop) == (-np.inf, np.inf) else record.cut(start, stop)


def _outside(
    log: LogSource,
    columns: Collection[str],
    unmatched: set[Window],
    windows: Sequence[Window],
    signal_map: SignalMap,
) -> Iterator[Chunk]:
    """The samples outside the windows; a window with samples is removed from those that are `unmatched`.

    Windows are by the timestamps of the log or, where these are dates, also by the time of the record, which begins at
    0.

    Raises:
        SignalError: a window ends before it begins, or no samples are left.
    """
    for first, last in windows:
        if not first < last:
            raise SignalError(f"exclude {first:g}..{last:g}: expected the first instant before the last; exchange them")
    rows, left = RowTime(log, _row_time(log, signal_map), signal_map.time.unit), False
    begin: float | None = None
    for chunk in log.chunks({*columns, rows.column or ""} - {""}):
        time = rows.of(chunk)
        if time is None:
            yield chunk
            left = True
            continue
        if begin is None and np.isfinite(time).any():
            begin = origin(float(time[np.isfinite(time)][0]))
        since = [0.0 if begin is None or stop >= begin else begin for _, stop in windows]
        inside = [(time >= start + t) & (time <= stop + t) for (start, stop), t in zip(windows, since, strict=True)]
        unmatched.difference_update(w for w, samples in zip(windows, inside, strict=True) if samples.any())
        kept = ~np.any(inside, axis=0)
        left |= bool(kept.any())
        values = {name: values[kept] for name, values in chunk.values.items()}
        yield replace(chunk, values=values, time=None if chunk.time is None else chunk.time[kept])
    if not left:
        raise SignalError(f"{log.name}: all samples are in the windows that are excluded; exclude less")


def _time_bases(log: LogSource, channels: Mapping[_Key, SignalSource]) -> dict[str, str]:
    """Signal to the name of its time base, without those of the main one.

    It is the clock of the map, else the column with the channel's own timestamps, else the clock in the file. The main
    time base is that of a steer angle, else of speed, else of the first signal.
    """
    names = {
        signal: channel.clock or channel.time or log.columns[log.find(channel.columns[0])].time_base
        for (_, signal), channel in channels.items()
    }
    main = next((n for n in names if is_of(n, STEER)), "speed" if "speed" in names else None)
    common = names[main] if main else next(iter(names.values()))
    return {signal: name or _LOGGER for signal, name in names.items() if name != common}


def _sensors(log: LogSource, channels: Mapping[str, SignalSource]) -> dict[str, SensorPrior]:
    """What the file and the map state of the sensors, by signal; the map has priority."""
    sensors = {}
    for signal, channel in channels.items():
        sensor, stored = channel.stated(signal), log.columns[log.find(channel.columns[0])].sensor
        if stored:
            try:
                sensor = SensorPrior.loads(stored).updated(sensor)
            except SignalError as error:
                raise SignalError(f"{log.name}: {signal}: {error}; write the file again") from None
        sensors[signal] = sensor
    return sensors


class _Timestamps(NamedTuple):
    """Origin of timestamps: columns with the same origin share a time base."""

    clock: str
    """Time base in the file; empty for the rows of a table."""
    column: str
    """Column with the timestamps; empty where the file has them."""
    signal: str
    """The signal whose map names the column; empty where all signals share it."""

    @property
    def of_rows(self) -> bool:
        """Whether they are the time of a table's rows."""
        return bool(self.column) and not self.signal


@dataclass(kw_only=True)
class _Use:
    """What the signals that a column is mapped to need of its samples."""

    missing: tuple[float, ...] | None = None
    """The stated marks of missing samples."""
    of_speed: bool = False
    turn: float | None = None
    """A full turn in its unit, of an angle."""

    def add(self, signal: str, channel: SignalSource, log_unit: str | None) -> None:
        """Add what one more signal needs."""
        self.missing = self.missing if channel.missing is None else channel.missing
        self.of_speed |= signal == SPEED.quantity
        self.turn = full_turn(signal, channel, log_unit) or self.turn


def full_turn(signal: str, channel: SignalSource, log_unit: str | None) -> float | None:
    """A full turn in the unit of a column, if it is an angle; in degrees for a column without a unit, because none in
    rad is as large by mistake."""
    if channel.si(signal) != "rad" or channel.points is not None:
        return None
    try:
        return 2 * np.pi / factor(channel.unit or log_unit or "deg", "rad")
    except UnitError:
        return np.inf


class _TimeBase:
    """The columns with common timestamps, read in chunks."""

    def __init__(
        self, log: LogSource, timestamps: _Timestamps, uses: Mapping[str, _Use], signal_map: SignalMap
    ) -> None:
        self.time = np.empty(0)
        """(N,) s; complete after finish()."""
        self.values: dict[str, Array] = {}
        """(N,) values of every column; complete after finish()."""
        self.held: dict[str, HeldSamples] = {}
        """The columns that are held, which have no values between their renewals; complete after finish()."""
        self._timestamps, self._columns, self._rate = timestamps, list(uses), signal_map.rate
        self._label = f"{log.name}: {timestamps.column or timestamps.clock}"
        self._rows = RowTime(log, timestamps.column or None, signal_map.time.unit if timestamps.of_rows else None)
        self._repeated = RepeatedTimestamps()
        self._marks = {name: MissingMarks(use.missing) for name, use in uses.items()}
        self._stream = StreamDecimator(self._columns, rate=self._rate, time_base=self._label)
        self._renewals = {name: Renewals(of_speed=use.of_speed) for name, use in uses.items()}
        self._angles = {name: Unwrapped(use.turn) for name, use in uses.items() if use.turn is not None}
        self._last_time = np.nan

    def push(self, chunk: Chunk) -> None:
        """Add the next samples."""
        column, time = self._timestamps.column, self._rows.of(chunk)
        values: Mapping[str, Array] = {name: marks.without(chunk.values[name]) for name, marks in self._marks.items()}
        if time is None:
            raise SignalError(f"{self._label}: no timestamps; name their column with time = ... in signals.toml")
        time = np.where(np.abs(time) < _MAX_TIME, time, np.nan)
        if self._timestamps.of_rows:
            time = np.where(implausible_timestamps(time), np.nan, time)
            time, values = self._repeated.push(time, values)
        elif column:  # a repeated timestamp marks a repeated sample
            new = np.isfinite(time) & np.isfinite([values[name] for name in self._columns]).all(axis=0)
            new_time = time[new]
            new[new] = np.diff(new_time, prepend=self._last_time) != 0
            self._last_time = float(new_time[-1]) if new_time.size else self._last_time
            time, values = time[new], {name: samples[new] for name, samples in values.items()}
        self._add(time, values)

    def _add(self, time: Array, values: Mapping[str, Array]) -> None:
        values = {**values, **{name: angle.push(time, values[name]) for name, angle in self._angles.items()}}
        self._stream.push(time, values)
        for name, renewals in self._renewals.items():
            renewals.push(time, values[name])

    def finish(self) -> list[str]:
        """Join the samples; notes on rows left out and on decimation."""
        time, values = self._repeated.last(self._label)
        if time.size:
            self._add(time, values)
        self.time, self.values = self._stream.finish()
        if self._timestamps.of_rows and not self.time.size:
            raise SignalError(
                f"{self._label}: no finite time in any row; name another column in [time] of signals.toml"
            )
        notes = [*self._rows.notes, *self._repeated.notes]
        notes += [note for name, marks in self._marks.items() for note in marks.notes(name)]
        notes += [
            f"{name}: jumps by a full turn {angle.jumps} times; it is made continuous, with most of it near 0"
            for name, angle in self._angles.items()
            if angle.jumps
        ]
        self.values |= {name: angle.centred(self.values[name]) for name, angle in self._angles.items()}
        if self._stream.rows_without_time:
            count = self._stream.rows_without_time
            notes.append(f"time: {count} row{'s' * (count > 1)} without a time left out")
        if self._stream.decimated_from is not None:
            label = self._timestamps.column or self._timestamps.clock
            notes.append(f"{label}: {self._stream.decimated_from:.4g} samples/s decimated to {self._rate:g}")
        for name, renewals in self._renewals.items():
            held = renewals.finish()
            if held is not None and name in self._angles:
                held = replace(held, values=self._angles[name].centred(held.values))
            if held is not None and held.rate <= DECIMATION_RATIO * self._rate:
                self.held[name], self.values[name] = held, self._renewed(held)
        return notes

    def _renewed(self, held: HeldSamples) -> Array:
        """A held column (N,): its renewals at the nearest rows, NaN elsewhere."""
        time, values = held.time, held.values
        if self._stream.decimated_from is not None:
            time, values = snap_to_grid(time, values, self._rate)
        result = np.full(self.time.size, np.nan)
        result[np.searchsorted((self.time[1:] + self.time[:-1]) / 2, time)] = values
        return result


def _sources(
    log: LogSource, signal_map: SignalMap, signal: str, channel: SignalSource
) -> list[tuple[_Timestamps, str]]:
    """Timestamps and name of every column of a channel."""
    sources = []
    for text in channel.columns:
        column = log.find(text)
        clock = log.columns[column].clock
        if channel.time is not None:
            timestamps = _Timestamps(clock, log.find(channel.time), signal)
            if log.columns[timestamps.column].clock != clock:
                raise SignalError(
                    f"{signal}: the time column {timestamps.column!r} and {column!r} are in different groups; choose "
                    "a time column of the same group, or delete `time` in signals.toml"
                )
        else:
            rows = None if clock else _row_time(log, signal_map)
            if rows is None and not clock:
                raise SignalError(
                    f"{log.name}: {signal} has no timestamps: the log has no column named 'time' or 't' (columns: "
                    f'{", ".join(log.columns)}); give the time column in signals.toml:\n[time]\ncolumn = "..."'
                )
            timestamps = _Timestamps(clock, rows or "", "")
        sources.append((timestamps, column))
    return sources


def _row_time(log: LogSource, signal_map: SignalMap) -> str | None:
    """The column with the time of a table's rows, if there is one."""
    return find_row_time(log) if signal_map.time.column is None else log.find(signal_map.time.column)


def _samples(
    signal: str, channel: SignalSource, log: LogSource, sources: Sequence[tuple[_TimeBase, str]], rows: _TimeBase | None
) -> tuple[Samples, list[str]]:
    """A channel in SI at its instants, and notes on samples left out and on one that is held."""
    si = si_unit(signal) or "1"
    first, column = sources[0]
    delay = quantity(channel.delay, "s")
    with np.errstate(over="ignore", invalid="ignore"):  # damaged values may overflow
        try:
            values = channel.converted(_on_first_time_base(log, sources), channel.si(signal))
            values = _derivative(first.time, values) if channel.derivative else values
        except UnitError as error:
            place = f"{signal}: column {column} of {log.name}"
            unit = channel.unit or log.columns[column].unit
            raise SignalError(f"{place}: {error}{relative_cure(signal, unit)}") from None
    impossible = impossible_samples(signal, values)
    notes = []
    if impossible.any():
        largest = f"{np.abs(values[impossible]).max():.1g} {si}"
        count = int(impossible.sum())
        where = f"the first at {first.time[impossible.argmax()] - origin(first.time[0]):.2f} s"
        notes.append(f"{signal}: {count} impossible sample{'s' * (count > 1)} left out, up to {largest}, {where}")
        values = np.where(impossible, np.nan, values)
    present = np.flatnonzero(np.isfinite(values))
    spiky = spike_mask(signal, first.time[present], values[present])
    if spiky.any():
        elapsed = first.time[present] - origin(first.time[0])
        notes.append(f"{signal}: {spike_note(signal, elapsed, values[present], spiky)}")
        values = values.copy()
        values[present[spiky]] = np.nan
    time, held = first.time - delay, first.held.get(column)
    if held is not None:
        table = f"a table of {held.rate * held.repetitions:.4g} Hz"
        notes.append(f"{signal}: held, {held.rate:.3g} Hz in {table}; only renewed values count as samples")
        time, values = time[np.isfinite(values)], values[np.isfinite(values)]
    own_time = first is not rows or delay != 0 or held is not None
    if not own_time and (rate := _sparse_rate(signal, time, values)):
        notes.append(f"{signal}: {rate:.3g} Hz in a table of {1 / typical_step(time):.4g} Hz; interpolated")
        own_time, time, values = True, time[np.isfinite(values)], values[np.isfinite(values)]
    return Samples(time=time, values=values, own_time=own_time), notes


def _derivative(time: Array, values: Array) -> Array:
    """The derivative of a channel (n,) by central differences; NaN where it has no value, and beside a gap."""
    rows, result = np.flatnonzero(np.isfinite(values)), np.full(values.size, np.nan)
    if rows.size > 2:
        result[rows[1:-1]] = (values[rows[2:]] - values[rows[:-2]]) / (time[rows[2:]] - time[rows[:-2]])
        result[rows[1:-1][time[rows[2:]] - time[rows[:-2]] > 4 * typical_step(time[rows])]] = np.nan
    return result


def _is_regular(steps: NDArray[np.intp]) -> bool:
    """Whether steps (n,) are equal but for few."""
    return bool(np.mean(np.abs(steps - np.median(steps)) <= 1) > _REGULAR)


def _sparse_rate(signal: str, time: Array, values: Array) -> float:
    """Sampling rate, Hz, of an input that has a value in few rows (n,); 0 if most have one, or it is too slow."""
    rows = np.flatnonzero(np.isfinite(values))
    steps = np.diff(rows)
    if not is_input(signal) or rows.size < _LEAST_SPARSE or np.median(steps) < 2 or not _is_regular(steps):
        return 0.0
    period = typical_step(time[rows])
    return 1 / period if period < (SLOWEST_SPEED if signal == SPEED.quantity else _SLOWEST_STEER) else 0.0


def _on_first_time_base(log: LogSource, sources: Sequence[tuple[_TimeBase, str]]) -> Iterator[tuple[Array, str | None]]:
    """Values of a channel's columns on the time base of the first one, and their units."""
    first = sources[0][0]
    for number, (time_base, column) in enumerate(sources):
        values = time_base.values[column]
        if time_base is not first or (number and column in time_base.held):
            present = np.isfinite(values)
            values = (
                interpolated(first.time, time_base.time[present], values[present])
                if present.any()
                else np.full(first.time.size, np.nan)
            )
        yield values, log.columns[column].unit


def _align(rows: Array | None, channels: dict[_Key, Samples], rate: float) -> tuple[Array, dict[_Key, Array]]:
    """Time (N,) s and channels on one time base: inputs are interpolated there, measurements keep their instants."""
    if rows is not None and not any(samples.own_time for samples in channels.values()):
        return rows, {key: samples.values for key, samples in channels.items()}
    time = _union(rows, channels)
    if time.size > 2 and (time.size - 1) / (time[-1] - time[0]) > DECIMATION_RATIO * rate:
        rows = None if rows is None else np.unique(np.rint(rows * rate)) / rate
        channels = {key: _snapped(key[1], samples, rate) for key, samples in channels.items()}
        time = _union(rows, channels)
    return time, {key: _placed(time, key[1], samples) for key, samples in channels.items()}


def _union(rows: Array | None, channels: Mapping[_Key, Samples]) -> Array:
    """Instants (N,) s of the rows and of the measurements with own instants, or of all channels if there are none."""
    times = [] if rows is None else [rows]
    times += [s.time[np.isfinite(s.values)] for (_, name), s in channels.items() if s.own_time and not is_input(name)]
    instants = np.unique(np.concatenate(times or [s.time for s in channels.values()]))
    time = instants[np.concatenate([[True], np.diff(instants) > SAME_INSTANT])] if instants.size else instants
    if time.size < 2:
        raise SignalError(
            f"time: {time.size} instants in all channels together, at least 2 expected; check the time columns"
        )
    return time


def _snapped(name: str, samples: Samples, rate: float) -> Samples:
    """A measurement at the nearest multiples of 1 / rate; an input as it is."""
    if is_input(name):
        return samples
    present = np.isfinite(samples.values)
    time, values = snap_to_grid(samples.time[present], samples.values[present], rate)
    return Samples(time=time, values=values, own_time=True)


def _placed(time: Array, name: str, samples: Samples) -> Array:
    """A channel (N,) on the common time: an input interpolated, a measurement at its instants and NaN elsewhere."""
    if is_input(name) and samples.time.size:
        return interpolated(time, samples.time, samples.values)
    result = np.full(time.size, np.nan)
    present = np.isfinite(samples.values)
    nearest = np.searchsorted(time, samples.time[present] + SAME_INSTANT, side="right") - 1
    result[nearest] = samples.values[present]
    return result


def interpolated(time: Array, sample_time: Array, values: Array) -> Array:
    """Linear between samples; NaN outside, next to missing ones, and in gaps above 0.5 s and three typical steps."""
    result = np.interp(time, sample_time, values, left=np.nan, right=np.nan)
    if sample_time.size > 1:
        steps = np.diff(sample_time)
        after = np.clip(np.searchsorted(sample_time, time, side="left"), 1, sample_time.size - 1)
        inside = (time - sample_time[after - 1] > SAME_INSTANT) & (sample_time[after] - time > SAME_INSTANT)
        result[inside & (steps[after - 1] > max(0.5, 3 * typical_step(sample_time)))] = np.nan
    return result
