"""LabVIEW TDMS by npTDMS. Channels of a group with the same timing are sampled together."""

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from nptdms import TdmsFile

from fifthwheel.base.errors import SignalError
from fifthwheel.base.types import Array
from fifthwheel.base.units import factor
from fifthwheel.data.logs.row_time import time_column
from fifthwheel.data.logs.source import Chunk, Column, LogSource, ReadProgress, damage, no_progress, unused_name

_ROWS = 1 << 18
"""Samples that are read at once, at least."""
_BLOCKS = 16
"""Most blocks of a clock: a block decodes whole chunks of the file, which can be as long as the file."""


@dataclass(frozen=True, kw_only=True)
class Timing:
    """When the samples of a channel were taken: by the start and step of a waveform, s, or by a channel of times."""

    first: float = 0.0
    step: float = 0.0
    channel: Any = None
    unit: float = 1.0  # of the channel, s

    def times(self, first: int, count: int) -> Array:
        """Time (count,) of samples, s."""
        if self.channel is None:
            return self.first + self.step * np.arange(first, first + count, dtype=np.float64)
        return self.unit * _values(self.channel, first, count)


def open_log(path: Path, databases: Sequence[str | Path] = (), progress: ReadProgress = no_progress) -> LogSource:
    """A TDMS file; SignalError where no channel of numbers has a time. Only its descriptions are read now."""
    return TdmsLog(path)


class TdmsLog(LogSource):
    """The channels of a TDMS file."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("rb")  # with its path npTDMS would read an index file beside it, which may be old
        self._tdms = TdmsFile.open(self._file)
        self._timings: dict[str, Timing] = {}
        self._channels: dict[str, Any] = {}
        columns: dict[str, Column] = {}
        notes = []
        groups = {g.name: [c for c in g.channels() if len(c) and c.dtype.kind in "biufM"] for g in self._tdms.groups()}
        total = Counter(channel.name for channels in groups.values() for channel in channels)
        for group, channels in groups.items():
            listed = _time_channel(channels)
            clocks: dict[Timing, str] = {}
            for channel in channels:
                if channel.dtype.kind == "M" or (listed and channel is listed.channel):
                    continue
                if (timing := _waveform(channel.properties) or listed) is None:
                    notes.append(f"channel {channel.name!r} of group {group!r} left out: it has no time")
                    continue
                clock = clocks.setdefault(timing, unused_name(group, self._timings))
                self._timings[clock] = timing
                name = unused_name(channel.name if total[channel.name] == 1 else f"{channel.name}@{group}", columns)
                columns[name] = Column(name=name, unit=_unit(channel), clock=clock)
                self._channels[name] = channel
        if not columns:
            why = "".join(f"; {note}" for note in notes[:3])
            raise SignalError(
                f"{path.name}: no channels of numbers with a time{why}; save waveforms, or a time channel"
            )
        super().__init__(path.name, columns)
        if self._tdms.file_status.incomplete_final_segment:
            notes.append("the last segment is cut short; the samples before its end are used")
        self.notes += notes

    def chunks(self, columns: Collection[str]) -> Iterator[Chunk]:
        yield from self.increasing(self._blocks(self.by_clock(columns)))

    def _blocks(self, wanted: Mapping[str, Sequence[str]]) -> Iterator[Chunk]:
        """Blocks of rows, one clock after the other; damage ends a clock, with a note."""
        for number, (clock, names) in enumerate(wanted.items()):
            timing, first = self._timings[clock], 0
            total = max(len(self._channels[name]) for name in names)
            rows = max(_ROWS, -(-total // _BLOCKS))
            with damage() as troubles:
                for first in range(0, total, rows):
                    count = min(rows, total - first)
                    values = {name: _values(self._channels[name], first, count) for name in names}
                    done = (number + (first + count) / total) / len(wanted)
                    yield Chunk(values=values, time=timing.times(first, count), clock=clock, done=done)
            self.note(*(f"broken after {first} of {total} samples of {clock!r}: {why}" for why in troubles))

    def close(self) -> None:
        self._tdms.close()
        self._file.close()


def _waveform(properties: Mapping[str, Any]) -> Timing | None:
    """Start, s since 1970, and step of a waveform; LabVIEW writes 1904 for a start that is not set, here 0."""
    step, offset = (properties.get(f"wf_{name}") or 0.0 for name in ("increment", "start_offset"))
    start = properties.get("wf_start_time")
    seconds = (start - np.datetime64(0, "s")) / np.timedelta64(1, "s") if isinstance(start, np.datetime64) else 0.0
    return Timing(first=max(float(seconds), 0.0) + offset, step=step) if step > 0 else None


def _time_channel(channels: Sequence[Any]) -> Timing | None:
    """The channel of a group with the times of the others: timestamps, else numbers with the name of a time."""
    named = time_column({c.name: Column(name=c.name, unit=_unit(c)) for c in channels})
    channel = next((c for c in channels if c.dtype.kind == "M"), None)
    channel = channel or next((c for c in channels if c.name == named and not _waveform(c.properties)), None)
    return channel and Timing(channel=channel, unit=factor(_unit(channel) or "s", "s"))


def _unit(channel: Any) -> str | None:
    return str(channel.properties.get("unit_string") or "").strip() or None


def _values(channel: Any, first: int, count: int) -> Array:
    """Samples (count,) from the first one on, NaN behind the last; timestamps in s since 1970."""
    data = channel.read_data(first, max(0, min(count, len(channel) - first)))
    if data.dtype.kind == "M":
        data = np.where(np.isnat(data), np.nan, data.astype("datetime64[us]").astype(np.int64) * 1e-6)
    return np.concatenate([data.astype(np.float64), np.full(count - len(data), np.nan)])
