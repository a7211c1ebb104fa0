"""Messages of an MCAP file in the order in which they lie there, up to its end or its break."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

from mcap.reader import make_reader
from mcap.records import Channel, Chunk, DataEnd, Message, Schema
from mcap.stream_reader import StreamReader, breakup_chunk

_MAGIC = b"\x89MCAP0\r\n"
_BIGGEST_CHUNK = 1 << 30


@dataclass
class Stream:
    """One reading of a file; the schemas and channels met so far stay for the next."""

    path: Path
    size: int
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    broken: str = ""
    """What ended the last reading early; "" when nothing did."""

    def messages(self) -> Iterator[tuple[Channel, Message, float]]:
        """Channel, message, and the share of the file read."""
        self.broken = ""
        try:
            file = self.path.open("rb")
        except OSError as error:
            self.broken = f"it cannot be opened ({error.strerror})"
            return
        with file:
            if file.read(len(_MAGIC)) != _MAGIC:
                self.broken = "it does not begin as MCAP"
                return
            while True:
                at = file.tell()
                if at >= self.size:
                    self.broken = "the file ends before its end mark"
                    return
                try:
                    records = self._next(file, at)
                except (Exception, MemoryError) as error:  # damaged bytes can cause any
                    self.broken = f"byte {at}: {error or type(error).__name__}"
                    return
                if records is None:
                    return
                for record in records:
                    if isinstance(record, Message) and record.channel_id in self.channels:
                        yield self.channels[record.channel_id], record, file.tell() / self.size
                    else:
                        self._learn(record)

    def first_messages(self, count: int) -> list[tuple[Channel, Message]] | None:
        """Up to about `count` messages of every channel by the index at the end; None where there is none."""
        found: list[tuple[Channel, Message]] = []
        try:
            with self.path.open("rb") as file:
                summary = make_reader(file).get_summary()
                if summary is None or not summary.channels or not summary.chunk_indexes:
                    return None
                self.schemas |= summary.schemas
                self.channels |= summary.channels
                left = dict.fromkeys(summary.channels, count)
                for index in sorted(summary.chunk_indexes, key=lambda index: index.chunk_start_offset):
                    offsets = index.message_index_offsets
                    if offsets and not any(left.get(channel, 0) > 0 for channel in offsets):
                        continue
                    file.seek(index.chunk_start_offset)
                    for record in self._next(file, index.chunk_start_offset) or []:
                        if isinstance(record, Message) and left.get(record.channel_id, 0) > 0:
                            left[record.channel_id] -= 1
                            found.append((self.channels[record.channel_id], record))
        except (Exception, MemoryError):  # damaged bytes can cause any; the file is then read from its beginning
            return None
        return found

    def _next(self, file: BinaryIO, at: int) -> list[Any] | None:
        """The records that begin at this byte; None at the end of the data."""
        head = file.read(9)
        length = struct.unpack("<Q", head[1:])[0] if len(head) == 9 else 0
        if len(head) < 9 or at + 9 + length > self.size:
            raise ValueError(f"a record of {length} bytes, {max(self.size - at - 9, 0)} are left")
        file.seek(at)
        records = StreamReader(file, skip_magic=True, emit_chunks=True).records
        if head[0] not in _KNOWN:
            file.seek(at + 9 + length)
            return []
        record = next(records)
        file.seek(at + 9 + length)
        if isinstance(record, DataEnd):
            return None
        return _unpacked(record) if isinstance(record, Chunk) else [record]

    def _learn(self, record: Any) -> None:
        if isinstance(record, Schema):
            self.schemas[record.id] = record
        elif isinstance(record, Channel):
            self.channels[record.id] = record


_KNOWN = frozenset({3, 4, 5, 6, 15})
"""Schema, channel, message, chunk, end of data."""


def _unpacked(chunk: Chunk) -> list[Any]:
    size = chunk.uncompressed_size
    if chunk.compression == "zstd":
        import zstandard

        size = max(size, zstandard.frame_content_size(chunk.data))
    if size > _BIGGEST_CHUNK:
        raise ValueError(f"a chunk that would unzip to {size} bytes")
    return breakup_chunk(chunk, validate_crc=True)
