"""The samples of a log in a folder of plain arrays, which are read again without decoding, and plotted at any zoom.

Every column is a file of float64, mapped into memory; so is the time of each time base. Beside it are the extremes of
each block of 256 samples, so that a plot of the whole log reads 1 % of it.
"""

import json
from collections.abc import Collection, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from fifthwheel.base.plots import downsample
from fifthwheel.base.plots.items import range_without_spikes
from fifthwheel.base.types import Array
from fifthwheel.data.logs.row_time import RowTime, find_row_time
from fifthwheel.data.logs.source import Chunk, Column, LogSource, ReadProgress, no_progress

BLOCK = 256
"""Samples that share their extremes."""
_ROWS = 1 << 18
"""Samples that are read at once."""
_INDEX = "index.json"


def store_log(log: LogSource, folder: Path, progress: ReadProgress = no_progress) -> None:
    """Write all samples of an open log to an empty folder, which `StoredLog` reads.

    A SignalError if the log cannot be read, an OSError if there is no space.
    """
    numbers = {name: k for k, name in enumerate(log.columns)}
    clocks = {clock: k for k, clock in enumerate(dict.fromkeys(column.clock for column in log.columns.values()))}
    rows = dict.fromkeys(clocks, 0)
    find_row_time(log)
    timed = set()
    for chunk in log.chunks(list(log.columns)):
        for name, values in chunk.values.items():
            _append(folder / f"column{numbers[name]}", values)
        if chunk.time is not None:
            timed.add(chunk.clock)
            _append(folder / f"time{clocks[chunk.clock]}", chunk.time)
        rows[chunk.clock] += len(next(iter(chunk.values.values())))
        progress(0.9 * chunk.done)
    time_of_rows = log.time
    for clock, k in clocks.items():
        column = time_of_rows if not clock else None
        if clock in timed:
            _write_axis(folder, k, _mapped(folder / f"time{k}"))
        elif column is not None and rows[clock]:
            seconds = RowTime(log, column).seconds(_mapped(folder / f"column{numbers[column]}"))
            _write_axis(folder, k, seconds)
    for name, k in numbers.items():
        if rows[log.columns[name].clock]:
            _write_extremes(folder / f"extremes{k}", _mapped(folder / f"column{k}"))
    index = {
        "name": log.name,
        "columns": [asdict(column) for column in log.columns.values()],
        "clocks": {clock: {"rows": rows[clock], "timed": clock in timed} for clock in clocks},
        "time": log.time,
        "start": log.start,
        "notes": log.notes,
        "unusable": log.unusable,
    }
    (folder / _INDEX).write_text(json.dumps(index), encoding="utf-8")


class StoredLog(LogSource):
    """A log in a folder that `store_log` has written, and that may not be changed while it is used.

    `chunks` gives the samples in the span, s; default: all. An OSError if the folder is incomplete.
    """

    def __init__(self, folder: Path, span: tuple[float, float] | None = None) -> None:
        index = json.loads((folder / _INDEX).read_text(encoding="utf-8"))
        super().__init__(index["name"], {column["name"]: Column(**column) for column in index["columns"]})
        self._folder, self._span = folder, span
        self._clocks: dict[str, Any] = index["clocks"]
        self._axes: dict[str, Array] = {}
        self._numbers = {name: k for k, name in enumerate(self.columns)}
        self._clock_numbers = {clock: k for k, clock in enumerate(self._clocks)}
        self.notes, self.unusable = index["notes"], index["unusable"]
        self.time, self.start = index["time"], index["start"]

    def chunks(self, columns: Collection[str]) -> Iterator[Chunk]:
        """The samples of some columns, one time base after the other."""
        groups = self.by_clock(columns)
        limits = {clock: self._rows(clock) for clock in groups}
        total = max(sum(last - first for first, last in limits.values()), 1)
        read = 0
        for clock, names in groups.items():
            first, last = limits[clock]
            arrays = {name: self._values(name) for name in names}
            timed = self._clocks[clock]["timed"]
            time = _mapped(self._folder / f"time{self._clock_numbers[clock]}") if timed else None
            for start in range(first, last, _ROWS):
                part = slice(start, min(start + _ROWS, last))
                read += part.stop - part.start
                yield Chunk(
                    values={name: np.array(values[part]) for name, values in arrays.items()},
                    time=None if time is None else np.array(time[part]),
                    clock=clock,
                    done=read / total,
                )

    def span(self) -> tuple[float, float]:
        """First and last instant of all channels, s; rows are numbered where they have no time."""
        axes = [self.axis(clock) for clock, content in self._clocks.items() if content["rows"]]
        return (min((float(a[0]) for a in axes), default=0.0), max((float(a[-1]) for a in axes), default=1.0))

    def axis(self, clock: str) -> Array:
        """Increasing time (n,) of a time base for plots, s; the number of the row where the log has no time."""
        if clock not in self._axes:
            path = self._folder / f"axis{self._clock_numbers[clock]}"
            rows = self._clocks[clock]["rows"]
            self._axes[clock] = _mapped(path) if path.exists() else np.arange(rows, dtype=float)
        return self._axes[clock]

    def window(self, name: str, start: float, stop: float, points: int = 1200) -> tuple[Array, Array]:
        """Time (n,) s and values (n,) of a column to draw between two instants; a NaN in both interrupts the line.

        At most about `points` of them, without losing an extreme. One sample outside the window is included on each
        side.
        """
        axis, values = self.axis(self.columns[name].clock), self._values(name)
        first = max(int(np.searchsorted(axis, start)) - 1, 0)
        last = min(int(np.searchsorted(axis, stop, side="right")) + 1, axis.size)
        if last - first <= BLOCK * points // 4:
            time, shown = np.array(axis[first:last]), np.array(values[first:last])
            return downsample.course(time, shown, points)
        blocks = np.arange(first // BLOCK, -(-last // BLOCK))
        low, high = self._extremes(name)[:, blocks]
        time = np.repeat(axis[np.minimum(blocks * BLOCK, axis.size - 1)], 2)
        return downsample.course(time, np.column_stack([low, high]).ravel(), points, gaps=False)

    def range_without_spikes(self, name: str, start: float, stop: float) -> tuple[float, float] | None:
        """The range of an axis for a window, as of `plots.items.range_without_spikes`."""
        axis = self.axis(self.columns[name].clock)
        return range_without_spikes(self._values(name)[slice(*np.searchsorted(axis, [start, stop]))])

    def most_active(self, name: str, length: float) -> tuple[float, float]:
        """The window of a length, s, in which the extremes of a column are farthest apart on average."""
        axis = self.axis(self.columns[name].clock)
        first, last = float(axis[0]), float(axis[-1])
        if last - first <= length:
            return first, last
        low, high = self._extremes(name)
        activity = np.concatenate([[0.0], np.cumsum(np.nan_to_num(high - low))])
        starts = np.asarray(axis[::BLOCK])
        ends = np.searchsorted(starts, starts + length)
        start = min(float(starts[np.argmax(activity[ends] - activity[: starts.size])]), last - length)
        return start, start + length

    def _rows(self, clock: str) -> tuple[int, int]:
        """First row of a time base that is given, and the one after the last."""
        if self._span is None:
            return 0, int(self._clocks[clock]["rows"])
        axis = self.axis(clock)
        return int(np.searchsorted(axis, self._span[0])), int(np.searchsorted(axis, self._span[1], side="right"))

    def _values(self, name: str) -> Array:
        return _mapped(self._folder / f"column{self._numbers[name]}")

    def _extremes(self, name: str) -> Array:
        """(2, blocks) smallest and largest value of each block."""
        return _mapped(self._folder / f"extremes{self._numbers[name]}").reshape(-1, 2).T


def _append(path: Path, values: Array) -> None:
    with path.open("ab") as file:
        np.ascontiguousarray(values, np.float64).tofile(file)


def _mapped(path: Path) -> Array:
    if not path.exists() or not path.stat().st_size:
        return np.empty(0)
    return np.memmap(path, np.float64, "r")


def _write_axis(folder: Path, number: int, time: Array) -> None:
    """The time so that it never decreases: a missing or damaged timestamp has that of the sample before it."""
    last = -np.inf
    for start in range(0, time.size, _ROWS):
        part = np.array(time[start : start + _ROWS])
        part[np.isinf(part)] = np.nan
        if start == 0 and np.isnan(part[0]):
            finite = part[np.isfinite(part)]
            part[0] = finite[0] if finite.size else 0.0
        part = np.fmax.accumulate(np.concatenate([[last], part]))[1:]
        last = float(part[-1])
        _append(folder / f"axis{number}", part)


def _write_extremes(path: Path, values: Array) -> None:
    """Smallest and largest value of each block, NaN where it has none."""
    for start in range(0, values.size, _ROWS):
        part = np.array(values[start : start + _ROWS])
        part[np.isinf(part)] = np.nan
        starts = np.arange(0, part.size, BLOCK)
        _append(path, np.column_stack([np.fmin.reduceat(part, starts), np.fmax.reduceat(part, starts)]).ravel())
