"""A log of CAN frames: every signal of every message that a database knows is a column."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fifthwheel.errors import SignalError
from fifthwheel.logs.can.bits import Bits
from fifthwheel.logs.can.database import Message, Signal, load
from fifthwheel.logs.can.frames import Batches, Frames
from fifthwheel.logs.log import Column, Log, Piece, Progress, quiet
from fifthwheel.logs.names import suggest
from fifthwheel.logs.stamps import Stamps

_Gates = tuple[tuple[str, Bits, frozenset[int]], ...]
_SHOWN = 8


@dataclass(eq=False)
class _Stream:
    """One message from one source on one bus."""

    message: Message
    source: int | None
    """J1939 source address; None with 11 bits."""
    bus: int
    frames: int = 0
    present: set[_Gates] = field(default_factory=set)
    """Of a multiplexed message, the gates that were open in some frame."""
    suffix: str = ""
    """Behind the names of its columns: which source, and which bus where there are several."""


class CanLog(Log):
    """Frames that some reader gives, decoded by some databases and by J1939.

    Columns are "VDC2.yaw_rate@0B", message, signal and source address, for ids of 29 bits, and "Message.Signal" for 11
    bits; ":1" behind it is the bus, where a message comes on several. Only messages that were seen are columns.
    """

    def __init__(
        self, name: str, batches: Batches, databases: Sequence[str | Path] = (), progress: Progress = quiet
    ) -> None:
        """Read all frames once, to see what there is.

        Args:
            name: of the file, for messages.
            batches: gives the frames from the beginning whenever it is called.
            databases: DBC, ARXML, KCD or SYM files, asked in order before J1939.
            progress: is told the share read.

        Raises:
            SignalError: a database cannot be used, or the log has no frame, or none that a database knows.
        """
        super().__init__(name)
        self._batches = batches
        self._databases = load(databases)
        self._streams: dict[int, _Stream | None] = {}
        """By id, whether it has 29 bits, and bus, all in one number; None for what no database knows."""
        self._scan(progress)
        self._columns: dict[str, Column] = {}
        self._decoded: dict[str, tuple[_Stream, Signal]] = {}
        self._list()

    @property
    def columns(self) -> Mapping[str, Column]:
        return self._columns

    def pieces(self, columns: Collection[str]) -> Iterator[Piece]:
        """Samples of some columns, in the unit of the database; NaN for error and not available.

        A piece for each batch of frames and clock; frames that do not follow in time are left out. Raises SignalError
        for a column that is not there.
        """
        wanted: dict[_Stream, dict[str, list[tuple[str, Signal]]]] = {}
        for name in columns:
            if name not in self._columns:
                raise SignalError(f"{self.name}: no column {name!r}; {suggest(name, list(self._columns))}")
            stream, signal = self._decoded[name]
            wanted.setdefault(stream, {}).setdefault(self._columns[name].clock, []).append((name, signal))
        return self._pieces(wanted)

    def _pieces(self, wanted: dict[_Stream, dict[str, list[tuple[str, Signal]]]]) -> Iterator[Piece]:
        stamps = Stamps()
        keys = np.array([key for key, stream in self._streams.items() if stream in wanted], np.int64)
        for frames, done in self._batches() if wanted else ():
            among = np.flatnonzero(np.isin(_keys(frames), keys))
            for stream, rows in self._split(_keys(frames)[among]):
                rows = among[rows]
                rows = rows[stamps.keep(stream, frames.time[rows])]
                data, length, time = frames.data[rows], frames.length[rows], frames.time[rows]
                for clock, signals in wanted[stream].items():
                    there = signals[0][1].present(data, length)
                    if not there.any():
                        continue
                    some = slice(None) if there.all() else there
                    values = {name: signal.values(data[some], length[some]) for name, signal in signals}
                    yield Piece(values=values, time=time[some], clock=clock, done=done)

    def _scan(self, progress: Progress) -> None:
        total = 0
        seen: dict[tuple[int, int | None, int], _Stream] = {}
        stamps = Stamps()
        for frames, done in self._batches():
            self.notes += frames.notes
            total += len(frames)
            keys = _keys(frames)
            for key in np.unique(keys).tolist():
                if key not in self._streams:
                    self._streams[key] = self._stream(key, seen)
            for stream, rows in self._split(keys):
                kept = rows[stamps.keep(stream, frames.time[rows])]
                stream.frames += kept.size
                for signal in stream.message.signals:
                    closed = signal.gates and signal.gates not in stream.present
                    if closed and signal.present(frames.data[kept], frames.length[kept]).any():
                        stream.present.add(signal.gates)
            progress(done)
        self._tell(total, stamps.dropped)

    def _stream(self, key: int, seen: dict[tuple[int, int | None, int], _Stream]) -> _Stream | None:
        number, extended, bus = key & 0x1FFFFFFF, bool(key >> 31 & 1), key >> 32
        message = self._databases.message(number, extended)
        if message is None:
            return None
        source = number & 0xFF if extended else None
        return seen.setdefault((id(message), source, bus), _Stream(message, source, bus))

    def _split(self, keys: NDArray[np.int64]) -> Iterator[tuple[_Stream, NDArray[np.intp]]]:
        """The rows of each known stream among some frames, in their order."""
        if not keys.size:
            return
        distinct, which = np.unique(keys, return_inverse=True)
        streams = [self._streams[key] for key in distinct.tolist()]
        numbers = {stream: k for k, stream in enumerate(dict.fromkeys(streams))}
        which = np.array([numbers[stream] for stream in streams])[which]
        order = np.argsort(which, kind="stable")
        parts = np.split(order, np.cumsum(np.bincount(which, minlength=len(numbers)))[:-1])
        for stream, rows in zip(numbers, parts, strict=True):
            if stream is not None:
                yield stream, rows

    def _tell(self, total: int, dropped: int) -> None:
        """Raise where there is nothing to read; else note what is not known."""
        if not total:
            said = f" ({'; '.join(self.notes)})" if self.notes else ""
            raise SignalError(f"{self.name}: not one CAN frame that can be read{said}; copy or record it again")
        ids = {key & 0xFFFFFFFF for key in self._streams}
        unknown = sorted({key & 0xFFFFFFFF for key, stream in self._streams.items() if stream is None})
        if len(unknown) == len(ids):
            names = [f"{key & 0x1FFFFFFF:0{8 if key >> 31 else 3}X}" for key in unknown]
            more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
            raise SignalError(
                f"{self.name}: {total} CAN frames, but no database knows any of their ids, {', '.join(names[:_SHOWN])}"
                f"{more}; give the DBC of this vehicle"
            )
        if unknown:
            self.notes.append(f"{len(unknown)} of {len(ids)} ids are in no database; give a DBC to read them")
        if dropped:
            self.notes.append(f"{dropped} frames left out: not later than the one before of the same message")

    def _list(self) -> None:
        """Name the columns."""
        streams = list(dict.fromkeys(stream for stream in self._streams.values() if stream is not None))
        buses: dict[tuple[int, int | None], set[int]] = {}
        for stream in streams:
            buses.setdefault((id(stream.message), stream.source), set()).add(stream.bus)
        named: dict[str, Message] = {}
        for stream in streams:
            message = stream.message
            title, again = message.name, 1
            while named.setdefault(title, message) is not message:  # the same name in another database
                again += 1
                title = f"{message.name}#{again}"
            source = "" if stream.source is None else f"@{stream.source:02X}"
            if len(buses[id(message), stream.source]) > 1:
                source = f"{source or '@'}:{stream.bus}"
            for signal in message.signals:
                if signal.gates and signal.gates not in stream.present:
                    continue
                gate = "".join(f" {name}={','.join(map(str, sorted(ids)))}" for name, _, ids in signal.gates)
                name = f"{title}.{signal.name}{source}"
                about = "; ".join(
                    part for part in (signal.about, f"{stream.frames} frames of {message.name}", message.source) if part
                )
                self._columns[name] = Column(name=name, unit=signal.unit, clock=f"{title}{source}{gate}", about=about)
                self._decoded[name] = (stream, signal)


def _keys(frames: Frames) -> NDArray[np.int64]:
    """(n,) id, bit 31 for 29 bits, and the bus above."""
    return frames.id.astype(np.int64) | frames.extended.astype(np.int64) << 31 | frames.bus.astype(np.int64) << 32
