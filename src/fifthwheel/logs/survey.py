"""What a log holds: of every column its unit, rate, range and what is missing."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fifthwheel.logs.assemble import time_column
from fifthwheel.logs.log import Array, Column, Log, Progress, quiet
from fifthwheel.logs.record import usual_step
from fifthwheel.logs.units import factor


@dataclass(frozen=True, kw_only=True)
class Content:
    """One column of a log, looked at from end to end."""

    column: Column
    samples: int
    """How many there are, the missing ones included."""
    missing: int
    rate: float
    """Samples a second by the median step of its clock, Hz; NaN where there is no time."""
    low: float
    high: float
    mean: float
    sigma: float
    """Of the samples that are there, in the column's unit; NaN without any."""
    fault: str | None = None
    """Why it is of no use, if it is not."""

    @property
    def alive(self) -> bool:
        """Whether it holds numbers that are not all zero, as a sensor that is not there would give."""
        return self.fault is None and self.missing < self.samples and (self.high > self.low or bool(self.high))


@dataclass(frozen=True, kw_only=True)
class Survey:
    """A log and what it holds."""

    name: str
    contents: Mapping[str, Content]
    """By the name of the column."""
    start: float
    """s; the first stamp of all."""
    stop: float
    notes: tuple[str, ...]


def survey(log: Log, progress: Progress = quiet) -> Survey:
    """Read a log from end to end; a SignalError where it is no log at all."""
    sums = {name: _Sum() for name in log.columns}
    steps: dict[str, list[float]] = {}
    span = [np.inf, -np.inf]
    rows = time_column(log)
    scale = factor(log.columns[rows].unit or "s", "s") if rows else 1.0
    for piece in log.pieces(list(log.columns)):
        time = piece.time if piece.time is not None else piece.values[rows] * scale if rows else None
        if time is not None and np.isfinite(time).any():
            seen = time[np.isfinite(time)]
            span = [min(span[0], float(seen[0])), max(span[1], float(seen[-1]))]
            if seen.size > 1:
                steps.setdefault(piece.clock, []).append(usual_step(seen))
        for name, values in piece.values.items():
            sums[name].add(values)
        progress(piece.done)
    contents = {}
    for name, column in log.columns.items():
        step = float(np.median(steps[column.clock])) if column.clock in steps else np.nan
        contents[name] = sums[name].content(column, 1 / step if step > 0 else np.nan, log.unusable.get(name))
    return Survey(name=log.name, contents=contents, start=span[0], stop=span[1], notes=tuple(log.notes))


class _Sum:
    """Moments of a column, piece by piece."""

    def __init__(self) -> None:
        self.samples = self.seen = 0
        self.low, self.high = np.inf, -np.inf
        self.mean = self.squares = 0.0

    def add(self, values: Array) -> None:
        self.samples += values.size
        seen = values[np.isfinite(values)]
        if not seen.size:
            return
        self.low, self.high = min(self.low, float(seen.min())), max(self.high, float(seen.max()))
        with np.errstate(over="ignore", invalid="ignore"):  # what is damaged may be as large as numbers get
            self._moments(seen)

    def _moments(self, seen: Array) -> None:
        mean, count = float(seen.mean()), seen.size
        self.squares += float(((seen - mean) ** 2).sum())
        self.squares += float(np.square(np.float64(mean - self.mean))) * count * self.seen / (count + self.seen)
        self.mean += (mean - self.mean) * count / (count + self.seen)
        self.seen += count

    def content(self, column: Column, rate: float, fault: str | None) -> Content:
        there = self.seen > 0
        return Content(
            column=column,
            samples=self.samples,
            missing=self.samples - self.seen,
            rate=rate,
            low=self.low if there else np.nan,
            high=self.high if there else np.nan,
            mean=self.mean if there else np.nan,
            sigma=float(np.sqrt(self.squares / self.seen)) if there else np.nan,
            fault=fault,
        )
