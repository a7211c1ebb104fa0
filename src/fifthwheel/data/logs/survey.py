"""Survey of a log: statistics of its columns, its time span, and what is wrong with it."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fifthwheel.base.errors import printable
from fifthwheel.base.types import Array
from fifthwheel.data.checks.missing_marks import MissingMarks
from fifthwheel.data.logs.row_time import RowTime, find_row_time
from fifthwheel.data.logs.source import Column, LogSource, ReadProgress, no_progress
from fifthwheel.data.record.timestamps import Renewals, typical_step


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
    """Last timestamp, s, without the pauses between joined logs."""
    notes: tuple[str, ...]


def survey_log(log: LogSource, progress: ReadProgress = no_progress) -> LogSurvey:
    """The survey of an open log, which is read completely."""
    moments = {name: _Moments() for name in log.columns}
    renewals = {name: Renewals() for name in log.columns}
    marks = {name: MissingMarks() for name in log.columns}
    steps: dict[str, list[float]] = {}
    start, stop = np.inf, -np.inf
    rows = RowTime(log, find_row_time(log))
    for chunk in log.chunks(list(log.columns)):
        instants = rows.of(chunk)
        time = np.empty(0) if instants is None else instants[np.isfinite(instants)]
        if time.size:
            start, stop = min(start, float(time[0])), max(stop, float(time[-1]))
        if time.size > 1:
            steps.setdefault(chunk.clock, []).append(typical_step(time))
        for name, samples in chunk.values.items():
            values = samples if name == rows.column else marks[name].without(samples)
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
    notes = [*log.notes, *rows.notes, *(note for name, found in marks.items() for note in found.notes(name))]
    return LogSurvey(
        name=log.name, contents=contents, start=start, stop=stop - log.pauses, notes=tuple(map(printable, notes))
    )


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
