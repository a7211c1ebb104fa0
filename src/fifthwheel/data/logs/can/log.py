"""A log of CAN frames: every signal of every message that a database has is a column."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fifthwheel.base.errors import SignalError
from fifthwheel.data.logs.can.database import CanSignal, Databases, Gates, Message, load
from fifthwheel.data.logs.source import Chunk, Column, LogSource, ReadProgress, no_progress
from fifthwheel.data.record.timestamps import TimestampFilter

_LISTED_IDS = 8
_KEPT_FRAMES = 4_000_000
"""Frames of known messages that stay in memory, about 120 MB, so that the file need not be read again."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Frames:
    """Consecutive data frames, without error frames and remote frames."""

    time: NDArray[np.float64]
    """(n,) s, finite, as in the log: since its start or since 1970."""
    id: NDArray[np.uint32]
    """(n,) 11 or 29 bits, without flags."""
    extended: NDArray[np.bool_]
    """(n,) whether the id has 29 bits."""
    bus: NDArray[np.int32]
    """(n,) number of the bus as in the log."""
    data: NDArray[np.uint8]
    """(n, width) payload, zeros beyond its length; width >= 8."""
    length: NDArray[np.int32]
    """(n,) bytes of payload."""

    def __len__(self) -> int:
        return int(self.time.size)

    def take(self, rows: NDArray[np.intp]) -> "Frames":
        """Some of the frames."""
        return Frames(**{part.name: getattr(self, part.name)[rows] for part in fields(self)})


Batches = Callable[[list[str]], Iterator[tuple[Frames, float]]]
"""Each call reads the log from its start: batches of frames, and the fraction of the log read with each, 0 to 1. The
argument gets a sentence for all that is left out, once all is read."""


@dataclass(eq=False)
class _Stream:
    """One message from one source on one bus."""

    message: Message
    source: int | None
    """J1939 source address; None with 11 bits."""
    bus: int
    present: set[Gates] = field(default_factory=set)
    """Of a multiplexed message, the gates that were open in some frame."""


_Streams = Mapping[int, _Stream | None]
"""By the key of a frame; None for what no database has."""


def open_can_log(
    name: str, batches: Batches, databases: Sequence[str | Path] = (), progress: ReadProgress = no_progress
) -> "CanLog":
    """Read all frames once and list the signals in them; `databases` are searched in order before J1939.

    A SignalError if a database cannot be used, or the log has no frame, or none that a database has.
    """
    known = load(databases)
    total, dropped = 0, TimestampFilter()
    notes: list[str] = []
    streams: dict[int, _Stream | None] = {}
    by_message: dict[tuple[int, int | None, int], _Stream] = {}
    kept: list[tuple[Frames, float]] | None = []
    for frames, done in batches(notes):
        total += len(frames)
        keys = _keys(frames)
        for key in np.unique(keys).tolist():
            if key not in streams:
                streams[key] = _stream(key, known, by_message)
        if kept is not None:
            wanted = [key for key, stream in streams.items() if stream is not None]
            kept.append((frames.take(np.flatnonzero(np.isin(keys, wanted))), done))
            kept = kept if sum(len(some) for some, _ in kept) <= _KEPT_FRAMES else None
        for stream, rows in _split(keys, streams):
            rows = rows[dropped.keep(stream, frames.time[rows])]
            for signal in stream.message.signals:
                closed = signal.gates and signal.gates not in stream.present
                if closed and signal.present(frames.data[rows], frames.length[rows]).any():
                    stream.present.add(signal.gates)
        progress(done)
    notes += _unknown_ids(name, streams, total, notes)
    if dropped.dropped:
        notes.append(
            f"{dropped.dropped} frames left out: their timestamp is not later than that of the previous frame of the "
            "same message"
        )
    again = batches if kept is None else lambda _: iter(kept)
    log = CanLog(name, again, streams, _columns(list(by_message.values())))
    log.notes += notes
    return log


class CanLog(LogSource):
    """Frames that some reader gives, decoded by some databases and by J1939.

    Columns are "VDC2.yaw_rate@0B", message, signal and source address, for ids of 29 bits, and "Message.Signal" for 11
    bits; ":1" at the end is the bus, where a message comes on several. Only messages in the log are columns.
    """

    def __init__(
        self, name: str, batches: Batches, streams: _Streams, columns: Mapping[str, tuple[Column, _Stream, CanSignal]]
    ) -> None:
        super().__init__(name, {name: column for name, (column, _, _) in columns.items()})
        self._batches, self._streams, self._decoded = batches, streams, columns

    def chunks(self, columns: Collection[str]) -> Iterator[Chunk]:
        """Samples of some columns, in the unit of the database; NaN for error and not available.

        One chunk for each batch of frames and clock; frames that are not later than the one before are left out.
        """
        wanted: dict[_Stream, dict[str, list[tuple[str, CanSignal]]]] = {}
        for clock, names in self.by_clock(columns).items():
            for name in names:
                _, stream, signal = self._decoded[name]
                wanted.setdefault(stream, {}).setdefault(clock, []).append((name, signal))
        stamps = TimestampFilter()
        keys = np.array([key for key, stream in self._streams.items() if stream in wanted], np.int64)
        for frames, done in self._batches([]) if wanted else ():
            among = np.flatnonzero(np.isin(_keys(frames), keys))
            for stream, rows in _split(_keys(frames)[among], self._streams):
                rows = among[rows]
                rows = rows[stamps.keep(stream, frames.time[rows])]
                data, length, time = frames.data[rows], frames.length[rows], frames.time[rows]
                for clock, signals in wanted[stream].items():
                    present = signals[0][1].present(data, length)
                    if present.any():
                        values = {name: signal.values(data[present], length[present]) for name, signal in signals}
                        yield Chunk(values=values, time=time[present], clock=clock, done=done)


def _keys(frames: Frames) -> NDArray[np.int64]:
    """(n,) id, bit 31 for 29 bits, and the bus above."""
    return frames.id.astype(np.int64) | frames.extended.astype(np.int64) << 31 | frames.bus.astype(np.int64) << 32


def _stream(key: int, known: Databases, by_message: dict[tuple[int, int | None, int], _Stream]) -> _Stream | None:
    number, extended, bus = key & 0x1FFFFFFF, bool(key >> 31 & 1), key >> 32
    message = known.message(number, extended)
    if message is None:
        return None
    source = number & 0xFF if extended else None
    return by_message.setdefault((id(message), source, bus), _Stream(message, source, bus))


def _split(keys: NDArray[np.int64], streams: _Streams) -> Iterator[tuple[_Stream, NDArray[np.intp]]]:
    """The rows of each known stream among some frames, in their order."""
    distinct, which = np.unique(keys, return_inverse=True)
    each = [streams[key] for key in distinct.tolist()]
    numbers = {stream: k for k, stream in enumerate(dict.fromkeys(each))}
    which = np.array([numbers[stream] for stream in each], np.int64)[which]
    for stream, k in numbers.items():
        if stream is not None:
            yield stream, np.flatnonzero(which == k)


def _unknown_ids(name: str, streams: _Streams, total: int, notes: Sequence[str]) -> list[str]:
    """A note on the ids that no database has; SignalError where that is all of them."""
    if not total:
        reasons = f" ({'; '.join(notes)})" if notes else ""
        raise SignalError(f"{name}: not one CAN frame that can be read{reasons}; copy or record it again")
    ids = {key & 0xFFFFFFFF for key in streams}
    unknown = sorted({key & 0xFFFFFFFF for key, stream in streams.items() if stream is None})
    if len(unknown) == len(ids):
        names = [f"{key & 0x1FFFFFFF:0{8 if key >> 31 else 3}X}" for key in unknown]
        more = f" and {len(names) - _LISTED_IDS} more" if len(names) > _LISTED_IDS else ""
        raise SignalError(
            f"{name}: {total} CAN frames, but no database has any of their ids, {', '.join(names[:_LISTED_IDS])}"
            f"{more}; give the DBC of this vehicle"
        )
    return [f"{len(unknown)} of {len(ids)} ids are in no database; give a DBC to read them"] if unknown else []


def _columns(streams: Sequence[_Stream]) -> dict[str, tuple[Column, _Stream, CanSignal]]:
    """The signals of the messages in the log by the names of their columns."""
    buses: dict[tuple[int, int | None], set[int]] = {}
    for stream in streams:
        buses.setdefault((id(stream.message), stream.source), set()).add(stream.bus)
    titles: dict[str, Message] = {}
    columns = {}
    for stream in streams:
        message = stream.message
        title, count = message.name, 1
        while titles.setdefault(title, message) is not message:  # the same name in another database
            count += 1
            title = f"{message.name}#{count}"
        source = "" if stream.source is None else f"@{stream.source:02X}"
        if len(buses[id(message), stream.source]) > 1:
            source = f"{source or '@'}:{stream.bus}"
        for signal in message.signals:
            if signal.gates and signal.gates not in stream.present:
                continue
            gate = "".join(f" {name}={','.join(map(str, sorted(ids)))}" for name, _, ids in signal.gates)
            name = f"{title}.{signal.name}{source}"
            column = Column(name=name, unit=signal.unit, clock=f"{title}{source}{gate}")
            columns[name] = column, stream, signal
    return columns
