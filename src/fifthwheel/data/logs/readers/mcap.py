"""MCAP recordings by mcap, of ROS and others. Topics are clocks; numbers in their messages are columns."""

import importlib
import json
import math
import re
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from mcap.reader import NonSeekingReader

from fifthwheel.base.errors import SignalError
from fifthwheel.data.logs.source import Chunk, Column, LogSource, ReadProgress, no_progress, reason, unused_name
from fifthwheel.data.record.timestamps import MAX_BACKWARD_STEP

_FIRST = 100
"""Messages of a topic that decide which fields it has, and whether its own timestamps can be used."""
_CHUNK_ROWS = 20_000
_SAME_CLOCK = 60.0
"""s between a message's own timestamp and its recording; more, and they come from two time bases."""
_LONGEST = 16
"""Elements of a list that become columns."""
_DEEPEST = 12
_STAMP = re.compile(r"(?:header\.stamp|stamp|timestamp)\.(?:(secs?|seconds)|(nanosec|nsecs?|nanos|nanoseconds))")
_DECODERS = {
    "cdr": ("mcap_ros2.decoder", "mcap-ros2-support"),
    "protobuf": ("mcap_protobuf.decoder", "mcap-protobuf-support"),
}
_ROS_1 = "messages of ROS 1 are not decoded, because their library runs code from the file; convert it to ROS 2"

Decode = Callable[[bytes], Any]


@dataclass
class Topic:
    """What the first messages of a topic show."""

    decode: Decode | None
    trouble: str
    """Why its messages cannot be decoded."""
    seen: int = 0
    fields: dict[str, None] = field(default_factory=dict)
    stamped: bool = True
    """Whether its messages have timestamps of their own, of the time base of the recording, that increase."""
    last: float = -math.inf
    lists: set[str] = field(default_factory=set)
    """Fields that are too long."""

    def add(self, values: Mapping[str, float], log_time: float) -> None:
        """Take the fields of a message into account."""
        self.seen += 1
        self.fields |= dict.fromkeys(values)
        time = _stamp(values)
        self.stamped = self.stamped and abs(time - log_time) < _SAME_CLOCK and time > self.last
        self.last = time


def open_log(path: Path, databases: Sequence[str | Path] = (), progress: ReadProgress = no_progress) -> LogSource:
    """Open an MCAP file; SignalError where nothing in it is intact or can be decoded."""
    topics: dict[str, Topic] = {}
    broken: list[str] = []
    for schema, channel, message, done in _messages(path, broken):
        if channel.topic not in topics:
            topics[channel.topic] = Topic(*_decoder(channel.message_encoding, schema))
        topic = topics[channel.topic]
        if topic.decode is not None and topic.seen < _FIRST:
            values = _decoded(topic, message)
            if values is not None:
                topic.add(values, message.log_time * 1e-9)
        progress(done)
    log = McapLog(path, topics)
    for name, topic in topics.items():
        if topic.lists:
            lists = ", ".join(sorted(topic.lists)[:10])
            log.notes.append(f"lists of more than {_LONGEST} numbers in {name!r} left out: {lists}")
        if topic.trouble:
            log.notes.append(f"topic {name!r} left out: {topic.trouble}")
    if not log.columns:
        trouble = "; ".join([*log.notes, *broken]) or "it has no messages with numbers"
        raise SignalError(
            f"{path.name}: nothing can be read of this MCAP file: {trouble}; try 'mcap recover {path.name}'"
        )
    return log


class McapLog(LogSource):
    """The topics of an MCAP file."""

    def __init__(self, path: Path, topics: Mapping[str, Topic]) -> None:
        columns: dict[str, Column] = {}
        self._places: dict[str, tuple[str, str]] = {}
        for name, topic in topics.items():
            clock = name.lstrip("/") or name
            for key in topic.fields:
                if topic.stamped and _STAMP.fullmatch(key):
                    continue
                column = unused_name(f"{clock}.{key}" if key else clock, columns)
                time_base = clock if topic.stamped else ""
                columns[column] = Column(name=column, clock=clock, time_base=time_base)
                self._places[column] = (name, key)
        super().__init__(path.name, columns)
        self._path, self._topics = path, topics

    def chunks(self, columns: Collection[str]) -> Iterator[Chunk]:
        trouble: list[str] = []
        yield from self.increasing(self._rows(columns, trouble))
        self.note(*trouble)

    def _rows(self, columns: Collection[str], trouble: list[str]) -> Iterator[Chunk]:
        """The rows of topics, not yet checked; `trouble` gets what is broken or cannot be decoded."""
        wanted: dict[str, dict[str, str]] = {}
        for names in self.by_clock(columns).values():
            for name in names:
                title, key = self._places[name]
                wanted.setdefault(title, {})[key] = name
        done, last, count = 0.0, 0.0, 0
        rows: dict[str, list[list[float]]] = {title: [] for title in wanted}
        failed: Counter[str] = Counter()
        broken: list[str] = []
        for _, channel, message, done in _messages(self._path, broken, wanted):
            count, last = count + 1, message.log_time * 1e-9
            topic = self._topics[channel.topic]
            values = _decoded(topic, message)
            if values is None:
                failed[channel.topic] += 1
                continue
            own = rows[channel.topic]
            time = _stamp(values) if topic.stamped else last
            own.append([time, *(values.get(key, math.nan) for key in wanted[channel.topic])])
            if len(own) >= _CHUNK_ROWS:
                yield _chunk(channel.topic, wanted[channel.topic].values(), own, done)
                own.clear()
        for title, own in rows.items():
            if own:
                yield _chunk(title, wanted[title].values(), own, done)
        at = f", at {last:.1f} s" if count else ""
        trouble += [f"broken after {count} messages{at}: {why}" for why in broken]
        trouble += [f"{n} messages of {title!r} left out, they cannot be decoded" for title, n in failed.items()]


def _messages(
    path: Path, broken: list[str], topics: Collection[str] | None = None
) -> Iterator[tuple[Any, Any, Any, float]]:
    """Schema, channel, message, and the fraction of the file read; `broken` gets the reason where it ends early."""
    size, at = path.stat().st_size, 0
    with path.open("rb") as file:
        try:
            reader = NonSeekingReader(file, validate_crcs=True)
            for schema, channel, message in reader.iter_messages(topics, log_time_order=False):
                at = file.tell()
                yield schema, channel, message, at / size
        except Exception as error:
            broken.append(f"after byte {at}: {reason(error)}")


def _decoder(encoding: str, schema: Any) -> tuple[Decode | None, str]:
    """What decodes the messages of a channel, or why nothing does."""
    if encoding == "json":
        return json.loads, ""
    if encoding == "ros1":
        return None, _ROS_1
    if encoding not in _DECODERS:
        return None, f"message encoding {encoding!r} is not supported"
    module, package = _DECODERS[encoding]
    try:
        decode = importlib.import_module(module).DecoderFactory().decoder_for(encoding, schema)
    except ImportError:
        return None, f"pip install {package}"
    except Exception as error:
        return None, f"its schema is not understood ({reason(error)})"
    if decode:
        return decode, ""
    return None, f"the schema encoding {schema.encoding!r} is not supported" if schema else "the topic has no schema"


def _decoded(topic: Topic, message: Any) -> dict[str, float] | None:
    """Numbers of a message by their paths, such as "pose.position.x" or "covariance[3]"; None for a damaged one."""
    values: dict[str, float] = {}
    try:
        assert topic.decode is not None
        _collect(topic.decode(message.data), "", values, topic.lists, 0)
    except Exception:  # damaged bytes can cause any
        return None
    return values


def _stamp(fields: Mapping[str, float]) -> float:
    """Timestamp in the header of a message, s; NaN where it has none."""
    seconds, fraction = math.nan, 0.0
    for name, value in fields.items():
        match = _STAMP.fullmatch(name)
        if match and match[1]:
            seconds = value
        elif match:
            fraction = value * 1e-9
    return seconds + fraction


def _collect(value: Any, path: str, values: dict[str, float], lists: set[str], depth: int) -> None:
    """Add the numbers in a decoded value; `lists` gets the paths of lists that are too long."""
    if isinstance(value, bool | int | float | np.number | np.bool_):
        try:
            values[path] = float(value)
        except OverflowError:
            values[path] = math.nan
        return
    if value is None or isinstance(value, str | bytes | bytearray) or depth > _DEEPEST:
        return
    fields = _fields(value)
    if fields is None:
        if not hasattr(value, "__len__"):
            return
        if len(value) > _LONGEST:
            lists.add(path)
            return
        fields = {f"[{k}]": item for k, item in enumerate(value)}
    for name, item in fields.items():
        _collect(item, f"{path}.{name}" if path and name[0] != "[" else f"{path}{name}", values, lists, depth + 1)


def _fields(value: Any) -> Mapping[str, Any] | None:
    """Fields of a struct by name, of ROS 2, protobuf or JSON; None for any other value."""
    if isinstance(value, Mapping):
        return {str(name): item for name, item in value.items()}
    descriptor = getattr(value, "DESCRIPTOR", None)
    if descriptor is not None:
        names = [f.name for f in descriptor.fields if not f.has_presence or value.HasField(f.name)]
        return {name: getattr(value, name) for name in names}
    slots = getattr(value, "__slots__", None)
    return None if slots is None else {name: getattr(value, name, None) for name in slots}


def _chunk(topic: str, names: Collection[str], rows: list[list[float]], done: float) -> Chunk:
    """Rows of a topic as a chunk; messages that are a little late are put in order."""
    table = np.array(rows, dtype=np.float64)
    if -MAX_BACKWARD_STEP < np.diff(table[:, 0]).min(initial=0.0) < 0:
        table = table[table[:, 0].argsort(kind="stable")]
    values = {name: table[:, k].copy() for k, name in enumerate(names, 1)}
    return Chunk(values=values, time=table[:, 0].copy(), clock=topic.lstrip("/") or topic, done=done)
