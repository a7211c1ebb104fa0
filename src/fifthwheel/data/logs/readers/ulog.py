"""PX4 ULog by pyulog. Topics are clocks; those that are logged several times have their number in the name."""

from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path

import numpy as np
from pyulog import ULog

from fifthwheel.base.errors import SignalError
from fifthwheel.base.types import Array
from fifthwheel.data.logs.source import Chunk, Column, LogSource, ReadProgress, no_progress, unused_name

_ROWS = 1 << 18
_TIME = "timestamp"


def open_log(path: Path, databases: Sequence[str | Path] = (), progress: ReadProgress = no_progress) -> LogSource:
    """A ULog file, which is read as a whole; SignalError where it has no samples."""
    return UlogLog(path)


class UlogLog(LogSource):
    """The topics of a ULog file."""

    def __init__(self, path: Path) -> None:
        log = ULog(str(path))
        total = Counter(topic.name for topic in log.data_list)
        self._topics: dict[str, dict[str, Array]] = {}
        self._fields: dict[str, str] = {}
        columns: dict[str, Column] = {}
        for topic in log.data_list:
            label = topic.name if total[topic.name] == 1 else f"{topic.name}_{topic.multi_id}"
            clock = unused_name(label, self._topics)
            self._topics[clock] = topic.data
            for entry in topic.field_data if _TIME in topic.data else ():
                if entry.type_str != "char" and entry.field_name != _TIME and "_padding" not in entry.field_name:
                    name = unused_name(f"{clock}.{entry.field_name}", columns)
                    columns[name] = Column(name=name, clock=clock)
                    self._fields[name] = entry.field_name
        if not columns:
            raise SignalError(f"{path.name}: a ULog file without samples; it is empty or cut short: copy it again")
        super().__init__(path.name, columns)
        if log.file_corruption:
            self.notes.append("damaged: messages are missing or wrong; copy it again from the logger")
        if log.dropouts:
            lost = sum(dropout.duration for dropout in log.dropouts) * 1e-3
            self.notes.append(f"the logger lost samples {len(log.dropouts)} times, {lost:.1f} s in all")

    def chunks(self, columns: Collection[str]) -> Iterator[Chunk]:
        yield from self.increasing(self._blocks(self.by_clock(columns)))

    def _blocks(self, wanted: dict[str, list[str]]) -> Iterator[Chunk]:
        for number, (clock, names) in enumerate(wanted.items(), 1):
            data = self._topics[clock]
            for first in range(0, data[_TIME].size, _ROWS):
                rows = slice(first, first + _ROWS)
                values = {name: data[self._fields[name]][rows].astype(np.float64) for name in names}
                yield Chunk(values=values, time=data[_TIME][rows] * 1e-6, clock=clock, done=number / len(wanted))
