"""From the columns of a log, by its map, to a record on one time base."""

import re
from datetime import UTC, datetime

import numpy as np

from fifthwheel.errors import SignalError
from fifthwheel.logs.align import Samples, align, between
from fifthwheel.logs.log import Array, Log, Piece, Progress, quiet
from fifthwheel.logs.names import si_unit
from fifthwheel.logs.record import Record
from fifthwheel.logs.samples import absurd
from fifthwheel.logs.signals import Channel, SignalMap
from fifthwheel.logs.stamps import wild
from fifthwheel.logs.stream import Stream
from fifthwheel.logs.units import factor, quantity

TIMES = ("time", "t", "timestamp", "timestamps", "zeit")
"""Columns of a table that are its time unless the map says otherwise, in any case of letters."""
_TIME = re.compile(r"time|zeit|stamp|datum|date")
_SECONDS = ("s", "ms", "us", "µs", "ns", "sec")
_EPOCH = 1e8
"""s; a time that begins later counts from 1970."""


def assemble(log: Log, signal_map: SignalMap, *, name: str, progress: Progress = quiet) -> Record:
    """The record (align.py) that a map makes of a log; a SignalError names what of it cannot be."""
    channels = {(part, s): c for part in ("signals", "reference") for s, c in getattr(signal_map, part).items()}
    clocks: dict[tuple[str, str, str], _Clock] = {}
    places = {key: _places(log, signal_map, key[1], channel, clocks) for key, channel in channels.items()}
    for clock in clocks.values():
        clock.start(signal_map.rate)
    for piece in log.pieces({column for clock in clocks.values() for column in clock.needs}):
        for clock in clocks.values():
            if clock.of == piece.clock:
                clock.push(piece)
        progress(piece.done)
    unusable = [why for column, why in log.unusable.items() if any(column in clock.needs for clock in clocks.values())]
    if unusable:
        raise SignalError("\n".join(unusable))
    notes = [*log.notes, *(note for clock in clocks.values() for note in clock.finish(signal_map.rate))]

    base = next((clock for clock in clocks.values() if clock.base), None)
    parts: dict[str, dict[str, Samples]] = {"signals": {}, "reference": {}}
    for (part, signal), channel in channels.items():
        parts[part][signal] = _samples(signal, channel, log, places[part, signal], base, notes)
    rows = Samples(time=base.time, values=base.time, own=False) if base else None
    time, signals, reference = align(rows, rate=signal_map.rate, **parts)
    if time[0] > _EPOCH:
        start = float(np.floor(time[0]))
        notes.append(f"time counts from {datetime.fromtimestamp(start, UTC):%Y-%m-%d %H:%M:%S} UTC")
        time = time - start
    record = Record(time=time, signals=signals, reference=reference, name=name, notes=tuple(dict.fromkeys(notes)))
    start, stop = signal_map.span
    return record if (start, stop) == (-np.inf, np.inf) else record.cut(start, stop)


class _Clock:
    """The columns that share their stamps, those of the file or those of a column."""

    def __init__(self, log: Log, of: str, column: str, unit: float, *, base: bool) -> None:
        self.of, self.column, self.base = of, column, base
        self._unit = unit
        self._label = f"{log.name}: {column or of}"
        self.columns: dict[str, None] = {}
        self.time = np.empty(0)
        self.values: dict[str, Array] = {}

    @property
    def needs(self) -> set[str]:
        """Columns of the log."""
        return {*self.columns, self.column} - {""}

    def start(self, rate: float) -> None:
        self._stream = Stream(list(self.columns), rate=rate, clock=self._label)
        self._last = np.nan

    def push(self, piece: Piece) -> None:
        values = piece.values
        time = piece.values[self.column] * self._unit if self.column else piece.time
        if time is None:
            raise SignalError(f"{self._label}: no stamps")
        if self.base:
            time = np.where(wild(time), np.nan, time)
        if self.column and not self.base:  # a stamp that is repeated is the same sample, held
            fresh = np.isfinite(time) & np.isfinite(sum(values[name] for name in self.columns))
            stamps = time[fresh]
            fresh[fresh] = np.diff(stamps, prepend=self._last) != 0
            self._last = float(stamps[-1]) if stamps.size else self._last
            time, values = time[fresh], {name: values[name][fresh] for name in self.columns}
        self._stream.push(time, values)

    def finish(self, rate: float) -> list[str]:
        """Put the samples together; notes on what became of them."""
        self.time, self.values = self._stream.finish()
        if self.base and not self.time.size:
            raise SignalError(f"{self._label}: no finite value; every row needs its time, name another column")
        notes = []
        if self._stream.timeless:
            notes.append(f"time: {self._stream.timeless} rows left out that have none")
        if self._stream.thinned_from is not None:
            notes.append(
                f"{self.column or self.of}: {self._stream.thinned_from:.4g} samples a second, taken to {rate:g}"
            )
        return notes


def _places(
    log: Log, signal_map: SignalMap, signal: str, channel: Channel, clocks: dict[tuple[str, str, str], _Clock]
) -> list[tuple[_Clock, str]]:
    """The clock and the name of every column that a channel is made of; new clocks join the others."""
    found = []
    for text in channel.columns:
        column = log.find(text)
        of, own = log.columns[column].clock, channel.time is not None
        stamps, unit = "", None
        if channel.time is not None:
            stamps = log.find(channel.time)
        elif not of:
            stamps, unit = _time_column(log, signal_map, signal)
        key = (of, stamps, signal if own else "")
        if key not in clocks:
            seconds = factor(unit or log.columns[stamps].unit or "s", "s") if stamps else 1.0
            clocks[key] = _Clock(log, of, stamps, seconds, base=bool(stamps) and not own)
        clocks[key].columns[column] = None
        found.append((clocks[key], column))
    return found


def time_column(log: Log) -> str | None:
    """The column that a table's time stands in unless the map says otherwise, if there is one."""
    rows = [column for column in log.columns.values() if not column.clock]
    small = {column.name.lower(): column.name for column in reversed(rows)}
    called = [column.name for column in rows if column.unit in _SECONDS and _TIME.search(column.name.lower())]
    return next((small[name] for name in TIMES if name in small), next(iter(called), None))


def _time_column(log: Log, signal_map: SignalMap, signal: str) -> tuple[str, str | None]:
    """The column that is the time of a table's rows, and its unit where the map says it."""
    asked = signal_map.time
    unit = asked.unit if asked else None
    if asked is not None and asked.column is not None:
        return log.find(asked.column), unit
    found = time_column(log)
    if found is None:
        raise SignalError(
            f"{log.name}: no time for {signal}, neither 'time' nor 't' among {', '.join(log.columns)}; "
            f'say which column it is:\n[time]\ncolumn = "..."'
        )
    return found, unit


def _samples(
    signal: str, channel: Channel, log: Log, places: list[tuple[_Clock, str]], base: _Clock | None, notes: list[str]
) -> Samples:
    """A channel's values in SI at the instants they held."""
    si = si_unit(signal) or "1"
    first = places[0][0]
    delay = quantity(channel.delay, "s")
    with np.errstate(over="ignore", invalid="ignore"):  # what is damaged may be as large as numbers get
        values = channel.sign * channel.gain * _total(channel, log, places, si) - quantity(channel.offset, si)
    strange = absurd(signal, values)
    if strange.any():
        largest = f"{np.abs(values[strange]).max():.1g} {si}"
        notes.append(f"{signal}: {strange.sum()} samples left out that no sensor shows, up to {largest}")
        values = np.where(strange, np.nan, values)
    return Samples(time=first.time - delay, values=values, own=first is not base or delay != 0)


def _total(channel: Channel, log: Log, places: list[tuple[_Clock, str]], si: str) -> Array:
    """The columns of a channel added up on the first one's clock, in SI."""
    first = places[0][0]
    total = np.zeros(first.time.size)
    for clock, column in places:
        values = clock.values[column]
        if clock is not first:
            seen = np.isfinite(values)
            values = between(first.time, clock.time[seen], values[seen]) if seen.any() else np.full(total.size, np.nan)
        total = total + channel.calibrated(values, log.columns[column].unit, si)
    return total
