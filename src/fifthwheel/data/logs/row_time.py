"""The time of a table's rows: which column it is, and its values in seconds.

A column that states no unit may count s, ms, us or ns, since 1970 or not; days, as spreadsheets do; or write the time
of day as HHMMSS.ss. These differ by factors of a thousand in their size or their step, so that the samples show which
it is; a note says what was assumed.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fifthwheel.base.errors import SignalError
from fifthwheel.base.types import Array
from fifthwheel.base.units import factor
from fifthwheel.data.logs.source import Chunk, Column, LogSource

TIME_COLUMNS = ("time", "t", "timestamp", "timestamps", "zeit", "temps", "tiempo", "tempo", "tid", "aika", "czas")
"""Columns that are the time of a table unless the map names another, in upper or lower case."""
_TIME_WORD = re.compile(rf"time|zeit|stamp|datum|date|\butc\b|\b({'|'.join(TIME_COLUMNS[5:])})\b")
_WITH_UNIT = re.compile(rf"({'|'.join(TIME_COLUMNS)})[ _.]*[(\[]?(s|sec|seconds|sekunden)[)\]]?")
"""A name of the time that ends with its unit, such as "t_s"; seconds only, because a map has no unit of the time."""
_TIME_UNITS = ("s", "ms", "us", "µs", "ns", "sec")
_LEAST_ROWS = 10
"""From which a column is seen to increase."""
_REGULAR = 0.01
"""Relative deviation of the steps of a clock from their median; a distance or a counter of messages varies more."""
_DATES = (9.4e8, 2.84e9)
"""s since 1970: 2000 to 2059."""
_STEPS = (1e-5, 10.0)
"""s, of dates that are numbers."""
_LATEST = 5e9
"""s; a later time is none since 1970."""
_DAY, _MIDNIGHT = 86400.0, 60.0
"""s; a step back by a day, less a gap in the log, is midnight."""


@dataclass(frozen=True, kw_only=True)
class _Notation:
    """How instants are written as numbers: seconds are scale * number + origin."""

    text: str
    scale: float
    origin: float = 0.0
    """s since 1970 of number 0, for dates."""


_OF_DATES = (
    _Notation(text="s since 1970", scale=1.0),
    _Notation(text="ms since 1970", scale=1e-3),
    _Notation(text="us since 1970", scale=1e-6),
    _Notation(text="ns since 1970", scale=1e-9),
    _Notation(text="s since 1904, as LabVIEW counts", scale=1.0, origin=-2082844800.0),
    _Notation(text="days since 1900, as spreadsheets count", scale=_DAY, origin=-25569 * _DAY),
    _Notation(text="days since year 0, as MATLAB counts", scale=_DAY, origin=-719529 * _DAY),
    _Notation(text="100 ns since 1601, as Windows counts", scale=1e-7, origin=-11644473600.0),
)
_OF_STEPS = (  # largest step between rows; integers only
    (2.0, _Notation(text="s", scale=1.0)),
    (500.0, _Notation(text="ms", scale=1e-3)),
    (5e5, _Notation(text="us", scale=1e-6)),
    (np.inf, _Notation(text="ns", scale=1e-9)),
)
_SECONDS = _OF_STEPS[0][1]


def time_column(columns: Mapping[str, Column]) -> str | None:
    """The column with the time of a table's rows by its name and unit, if there is one."""
    rows = [column for column in columns.values() if not column.clock]
    by_name = {column.name.lower(): column.name for column in reversed(rows)}
    in_seconds = [column.name for column in rows if _WITH_UNIT.fullmatch(column.name.lower())]
    timed = in_seconds or [column.name for column in rows if column.unit in _TIME_UNITS and _is_time_word(column.name)]
    return next((by_name[name] for name in TIME_COLUMNS if name in by_name), next(iter(timed), None))


def find_row_time(log: LogSource) -> str | None:
    """The column with the time of a table's rows: `log.time`, else by its name, else by its first samples, if there is
    one.

    By the samples it is the first column with the word of a time that increases, else the only one whose steps are
    those of a clock. `log` keeps it.
    """
    if log.time is None:
        log.time = time_column(log.columns) or _increasing_column(log)
    return log.time


def _increasing_column(log: LogSource) -> str | None:
    names = [name for name, column in log.columns.items() if not column.clock]
    chunk = next((chunk for chunk in log.chunks(names) if not chunk.clock), None) if names else None
    if chunk is None or chunk.time is not None:
        return None
    steps = {name: np.diff(values[np.isfinite(values)]) for name, values in chunk.values.items()}
    steps = {name: step for name, step in steps.items() if step.size >= _LEAST_ROWS and (step > 0).mean() > 0.9}
    if named := [name for name in steps if _is_time_word(name)]:
        return named[0]
    timed = [name for name, step in steps.items() if log.columns[name].unit in (None, *_TIME_UNITS) and _is_clock(step)]
    return timed[0] if len(timed) == 1 else None


def _is_time_word(name: str) -> bool:
    return _TIME_WORD.search(name.lower()) is not None


def _is_clock(steps: Array) -> bool:
    """Whether steps (n,) are regular, and not those of a counter."""
    typical = float(np.median(steps))
    return typical != 1 and float(np.mean(np.abs(steps - typical) < _REGULAR * typical)) > 0.9


class RowTime:
    """Timestamps of a table's rows in seconds, chunk by chunk in the order of the log."""

    def __init__(self, log: LogSource, column: str | None, unit: str | None = None) -> None:
        """Take the column, None where chunks have their own time, and the unit that the map states."""
        self.column = column
        self.notes: list[str] = []
        """What was assumed, one sentence each."""
        self._stated = unit or (log.columns[column].unit if column else None)
        self._is_of_map = unit is not None
        self._notation: _Notation | None = None
        self._shift: float | None = None  # of HHMMSS.ss, to the seconds before it was recognised
        self._days, self._last, self._latest = 0, np.nan, np.nan

    def of(self, chunk: Chunk) -> Array | None:
        """Timestamps (n,) of a chunk, s: its own, else those in the column; None without either."""
        return chunk.time if chunk.time is not None or self.column is None else self.seconds(chunk.values[self.column])

    @np.errstate(over="ignore", invalid="ignore")  # damaged values may overflow
    def seconds(self, values: Array) -> Array:
        """Numbers (n,) of the column in s; a SignalError if they are too large for the time of a log."""
        if self._notation is None:
            self._notation = self._found(values[np.isfinite(values)])
        time = values * self._notation.scale + self._notation.origin
        return time if self._is_of_map or self._notation != _SECONDS else self._of_one_day(self._unpacked(time))

    def _found(self, values: Array) -> _Notation:
        scale = None if self._stated is None else factor(self._stated, "s")
        stated = _SECONDS if scale in (None, 1) else _Notation(text=str(self._stated), scale=scale or 1.0)
        if values.size < 2:
            return stated
        step, first = float(np.median(np.abs(np.diff(values)))), float(values[0])
        dated = [
            each
            for each in _OF_DATES
            if _DATES[0] < first * each.scale + each.origin < _DATES[1] and _STEPS[0] < step * each.scale < _STEPS[1]
        ]
        if self._is_of_map or stated != _SECONDS:
            if first * stated.scale > _LATEST:
                cure = f'set unit = "{dated[0].text.split()[0]}"' if dated else "correct its unit, or name another one"
                raise SignalError(f"{self.column}: {first:.15g} {stated.text} is no time of a log; {cure} in [time]")
            return stated
        found = dated[0] if dated else _SECONDS
        if not dated and scale is None and np.array_equal(values, np.rint(values)):
            found = next(each for largest, each in _OF_STEPS if step < largest)
        if found in (_SECONDS, _OF_DATES[0]):
            return _SECONDS
        self.notes.append(f"{self.column}: {first:.15g} is read as {found.text}; if this is wrong, set unit in [time]")
        return found

    def _unpacked(self, time: Array) -> Array:
        """Seconds of times (n,) that may be HHMMSS.ss.

        Within a minute these are seconds up to a constant; they are recognised where a new minute begins.
        """
        if self._shift is None:
            used = np.concatenate([[self._last], time])
            used = used[np.isfinite(used)]
            before, after = used[:-1], used[1:]
            ends = (after - before > 38) & (before % 100 >= 58) & (after % 100 < 2)
            self._last = float(used[-1]) if used.size else np.nan
            if not ends.any() or used.max() >= 240000 or max((used % 100).max(), (used // 100 % 100).max()) >= 60:
                return time
            self._shift = float(used[0] - _of_day(used[0]))
            self.notes.append(f"{self.column}: no value has 60 to 99 in its last two whole digits, read as HHMMSS.ss")
        return _of_day(time) + self._shift

    def _of_one_day(self, time: Array) -> Array:
        """Times (n,) of day, which begin again at midnight, without that step."""
        filled = np.flatnonzero(np.isfinite(time))
        if filled.size:
            begins = np.diff(time[filled], prepend=self._latest) < _MIDNIGHT - _DAY
            self._latest = float(time[filled[-1]])
            if self._days or begins.any():
                days = self._days + np.cumsum(begins)
                self._days, time = int(days[-1]), time.copy()
                time[filled] += _DAY * days
        return time


def _of_day(time: Array) -> Array:
    """Seconds of HHMMSS.ss."""
    return np.asarray(time - 40 * (time // 100) - 2400 * (time // 10000))
