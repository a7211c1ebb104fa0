"""MCAP recordings, of ROS and others. Topics are clocks; numbers in their messages are columns."""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fifthwheel.errors import SignalError
from fifthwheel.logs.log import Column, Log, Piece, Progress, quiet
from fifthwheel.logs.readers.asked import by_clock
from fifthwheel.logs.readers.mcap_fields import LONGEST, Decode, Decoders, is_stamp, leaves, stamp
from fifthwheel.logs.readers.mcap_stream import Stream
from fifthwheel.logs.stamps import LONGEST_SLIP, Stamps, add_notes

_FIRST = 100
"""Messages of a topic that say which fields it has, and whether its stamps can be used."""
_PIECE_ROWS = 20_000
_SAME_CLOCK = 60.0
"""s between a message's stamp and its recording; more, and they are told by two clocks."""
_STEPS = 1000


def open_log(path: Path, databases: Sequence[str | Path] = (), progress: Progress = quiet) -> Log:
    """Open an MCAP file; SignalError when nothing of it is intact or can be decoded."""
    path = Path(path)
    try:
        stream = Stream(path=path, size=path.stat().st_size)
        log = McapLog(path.name, stream, progress)
    except OSError as error:
        raise SignalError(f"{path}: cannot be read ({error.strerror}); check the path") from error
    if not log.columns:
        trouble = "; ".join(log.notes) or "it has no messages with numbers"
        raise SignalError(
            f"{path.name}: nothing can be read of this MCAP file: {trouble}; try 'mcap recover {path.name}'"
        )
    return log


@dataclass
class _Topic:
    """What the first messages of a topic told."""

    about: str = ""
    seen: int = 0
    fields: dict[str, None] = field(default_factory=dict)
    stamped: bool = True
    """Its messages have stamps of their own, of the same clock as the recording, that rise."""
    last: float = -math.inf
    long: set[str] = field(default_factory=set)


class McapLog(Log):
    """The topics of an MCAP file."""

    def __init__(self, name: str, stream: Stream, progress: Progress) -> None:
        super().__init__(name)
        self._stream = stream
        self._decoders = Decoders()
        self._decode: dict[int, tuple[Any, Decode | str]] = {}
        self._topics: dict[str, _Topic] = {}
        self._columns: dict[str, Column] = {}
        self._places: dict[str, tuple[str, str]] = {}
        self._undecoded: dict[str, str] = {}
        self._failed: dict[str, int] = {}
        self._list(progress)

    @property
    def columns(self) -> Mapping[str, Column]:
        return self._columns

    def pieces(self, columns: Collection[str]) -> Iterator[Piece]:
        wanted: dict[str, dict[str, str]] = {}
        for names in by_clock(self, columns).values():
            for name in names:
                topic, path = self._places[name]
                wanted.setdefault(topic, {})[path] = name
        stamps, done = Stamps(), 0.0
        rows: dict[str, list[list[float]]] = {topic: [] for topic in wanted}
        self._failed.clear()
        count, last = 0, math.nan
        for channel, message, done in self._stream.messages():
            count, last = count + 1, message.log_time * 1e-9
            if channel.topic not in wanted:
                continue
            values = self._values(channel, message, self._topics[channel.topic].long)
            if values is None:
                continue
            time = stamp(values) if self._topics[channel.topic].stamped else last
            own = rows[channel.topic]
            own.append([time, *(values.get(path, math.nan) for path in wanted[channel.topic])])
            if len(own) >= _PIECE_ROWS:
                yield from self._piece(channel.topic, wanted[channel.topic], own, stamps, done)
                own.clear()
        for topic, own in rows.items():
            if own:
                yield from self._piece(topic, wanted[topic], own, stamps, done)
        add_notes(self.notes, *stamps.notes)
        if self._stream.broken:
            at = f", at {last:.1f} s" if count else ""
            add_notes(self.notes, f"broken after {count} messages{at}: {self._stream.broken}")
        for topic, failed in self._failed.items():
            add_notes(self.notes, f"{failed} messages of {topic!r} left out, they cannot be decoded")

    def _list(self, progress: Progress) -> None:
        first = self._stream.first_messages(_FIRST)
        if first is None:
            self._scan(progress)
        else:
            for channel, message in first:
                self._look(channel, message)
        for topic, told in self._topics.items():
            clock = topic.lstrip("/") or topic
            for path in told.fields:
                if told.stamped and is_stamp(path):
                    continue
                name = f"{clock}.{path}" if path else clock
                while name in self._columns:
                    name += "'"
                self._columns[name] = Column(name=name, clock=clock, about=told.about)
                self._places[name] = (topic, path)
            if told.long:
                lists = ", ".join(sorted(told.long)[:10])
                self.notes.append(f"lists of more than {LONGEST} numbers in {topic!r} left out: {lists}")
        for topic, trouble in self._undecoded.items():
            self.notes.append(f"topic {topic!r} left out: {trouble}")

    def _scan(self, progress: Progress) -> None:
        """Without an index: the whole file."""
        told = 0.0
        count = 0
        for channel, message, done in self._stream.messages():
            count += 1
            self._look(channel, message)
            if done - told > 1 / _STEPS:
                told = done
                progress(done)
        if self._stream.broken and not self._topics:
            self.notes.append(f"broken after {count} messages: {self._stream.broken}")

    def _look(self, channel: Any, message: Any) -> None:
        topic = self._topics.setdefault(channel.topic, _Topic())
        if topic.seen >= _FIRST:
            return
        values = self._values(channel, message, topic.long)
        if values is None:
            return
        schema = self._stream.schemas.get(channel.schema_id)
        topic.about = schema.name if schema else ""
        topic.seen += 1
        topic.fields |= dict.fromkeys(values)
        time = stamp(values)
        near = abs(time - message.log_time * 1e-9) < _SAME_CLOCK
        topic.stamped = topic.stamped and near and time > topic.last
        topic.last = time

    def _values(self, channel: Any, message: Any, long: set[str]) -> dict[str, float] | None:
        known = self._decode.get(channel.id)
        if known is None or known[0] is not channel:
            schema = self._stream.schemas.get(channel.schema_id)
            self._decode[channel.id] = known = (channel, self._decoders.make(channel.message_encoding, schema))
        decode = known[1]
        if isinstance(decode, str):
            self._undecoded[channel.topic] = decode
            return None
        try:
            return leaves(decode(message.data), long)
        except (Exception, MemoryError):  # damaged bytes can cause any
            self._failed[channel.topic] = self._failed.get(channel.topic, 0) + 1
            return None

    def _piece(
        self, topic: str, paths: Mapping[str, str], rows: list[list[float]], stamps: Stamps, done: float
    ) -> Iterator[Piece]:
        table = np.array(rows, dtype=np.float64)
        backward = np.diff(table[:, 0]).min(initial=0.0)
        if -LONGEST_SLIP < backward < 0:
            table = table[table[:, 0].argsort(kind="stable")]
        clock = topic.lstrip("/") or topic
        table = table[stamps.keep(clock, table[:, 0])]
        if len(table):
            values = {name: table[:, k].copy() for k, name in enumerate(paths.values(), 1)}
            yield Piece(values=values, time=table[:, 0].copy(), clock=clock, done=done)
