"""A log without the samples of some time windows."""

from collections.abc import Collection, Iterator, Mapping, Sequence

import numpy as np

from fifthwheel.errors import SignalError
from fifthwheel.logs.assemble import time_column
from fifthwheel.logs.source import Chunk, Column, LogSource
from fifthwheel.units import factor

Window = tuple[float, float]
"""First and last instant, s."""


class WithoutWindows(LogSource):
    """An open log whose samples in some windows of its timestamps are left out.

    Args:
        log: open; it is closed with this one.
        windows: by the timestamps of the log, s.
        time: column with the time of a table's rows; default: by its name.
    """

    def __init__(self, log: LogSource, windows: Sequence[Window], time: str | None = None) -> None:
        super().__init__(log.name)
        self._log, self._windows = log, tuple(windows)
        self._rows = log.find(time) if time is not None else time_column(log.columns)
        self.notes, self.unusable = log.notes, log.unusable

    @property
    def columns(self) -> Mapping[str, Column]:
        return self._log.columns

    def pieces(self, columns: Collection[str]) -> Iterator[Chunk]:
        """The samples outside the windows; a SignalError if there are none."""
        rows, left = self._rows, False
        seconds = factor(self.columns[rows].unit or "s", "s") if rows else 1.0
        for chunk in self._log.pieces({*columns, rows} - {None} if rows else columns):
            time = chunk.time if chunk.time is not None else chunk.values[rows] * seconds if rows else None
            if time is None:
                yield chunk
                left = True
                continue
            kept = np.ones(time.size, dtype=bool)
            for start, stop in self._windows:
                kept &= ~((time >= start) & (time <= stop))
            left |= bool(kept.any())
            yield Chunk(
                values={name: values[kept] for name, values in chunk.values.items()},
                time=None if chunk.time is None else chunk.time[kept],
                clock=chunk.clock,
                done=chunk.done,
            )
        if not left:
            raise SignalError(f"{self.name}: all samples are in the windows that are excluded; exclude less")

    def close(self) -> None:
        self._log.close()
