"""Several logs of one logger as one, so that a proposed map rests on the evidence of all of them."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from fifthwheel.base.errors import SignalError
from fifthwheel.base.formatting import enumerated
from fifthwheel.data.logs.readers import open_log
from fifthwheel.data.logs.row_time import RowTime, find_row_time
from fifthwheel.data.logs.source import Chunk, LogSource, ReadProgress, no_progress

_BETWEEN = 60.0
"""s between two logs: a gap, across which nothing is compared."""


def open_logs(
    paths: Sequence[Path], databases: Sequence[Path] = (), progress: ReadProgress = no_progress, *, sample: bool = False
) -> LogSource:
    """One log as `open_log` opens it, or several with the same columns as one, each after the other in time.

    A SignalError if the columns differ.
    """
    if len(paths) == 1:
        return open_log(paths[0], databases, progress, sample=sample)
    return _JoinedLog(paths, databases, progress, sample=sample)


class _JoinedLog(LogSource):
    """Logs one after the other; each is open only while it is read."""

    def __init__(
        self, paths: Sequence[Path], databases: Sequence[Path], progress: ReadProgress, *, sample: bool
    ) -> None:
        self._paths = paths
        self._open = partial(open_log, databases=databases, progress=progress, sample=sample)
        with self._open(paths[0]) as log:
            super().__init__(enumerated([path.name for path in paths]), log.columns)
            self.time = find_row_time(log)
        for path in paths[1:]:
            with self._open(path) as log:
                if different := {*log.columns.items()} ^ {*self.columns.items()}:
                    name = min(name for name, _ in different)
                    problem = f"{path.name} and {paths[0].name}: {name!r} is not a column of both, with the same unit"
                    raise SignalError(f"{problem}; propose one map for the logs of each logger")
        self.sampled = True  # between the logs are gaps that no logger has left
        self.pauses = _BETWEEN * (len(paths) - 1)

    def chunks(self, columns: Collection[str]) -> Iterator[Chunk]:
        """The samples of each log with their time in seconds, later than those of the log before."""
        end = -_BETWEEN
        for k, path in enumerate(self._paths):
            with self._open(path) as log:
                rows, shift = RowTime(log, self.time), None
                for chunk in log.chunks({*columns, self.time or ""} - {""}):
                    time = rows.of(chunk)
                    known = np.empty(0) if time is None else time[np.isfinite(time)]
                    if time is not None and known.size:
                        shift = end + _BETWEEN - float(known[0]) if shift is None else shift
                        time, latest = time + shift, float(known[-1]) + shift
                    yield replace(chunk, time=time, done=(k + chunk.done) / len(self._paths))
                end = end if shift is None else latest
                self.unusable |= log.unusable
                self.note(*(f"{path.name}: {note}" for note in (*log.notes, *rows.notes)))
