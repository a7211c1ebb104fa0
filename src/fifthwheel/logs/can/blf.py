"""Vector BLF: a header, then containers of zlib-packed objects; of these the CAN frames are taken.

Layout as in python-can's reader, which follows Toby Lorenz' Vector BLF. The objects are found one by one, the fields of
all frames of a kind are gathered at once.
"""

import os
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from fifthwheel.errors import SignalError
from fifthwheel.logs.can.frames import Frames, counted, no_frames

_HEADER = struct.Struct("<4sLBBBBBBBBQQLL8H8H")
_OBJECT = struct.Struct("<4sHHLL")
_CONTAINER = 10
_ERRORS = (2, 73, 104)
_LARGEST = 1 << 26
"""Bytes of a container or of another object; a larger size is damaged."""
_BATCH = 1 << 21
"""Bytes of objects, about 40 000 frames."""
_MANY = 1 << 16
_MARGIN = 256
"""Bytes behind the objects, so that fields can be gathered before it is known whether they are all there."""


@dataclass(frozen=True, kw_only=True)
class _Layout:
    """Where the fields of an object are behind its header, bytes."""

    fixed: int
    """Size without the data."""
    length: int
    channel: str
    flags: tuple[int, str, int]
    """Place, type, and the bit of a remote frame."""
    width: int


_CLASSIC = _Layout(fixed=8, length=3, channel="<u2", flags=(2, "u1", 0x80), width=8)
_LAYOUTS = {
    1: _CLASSIC,
    86: _CLASSIC,
    100: _Layout(fixed=20, length=14, channel="<u2", flags=(2, "u1", 0x80), width=64),
    101: _Layout(fixed=40, length=2, channel="u1", flags=(12, "<u4", 0x10), width=64),
}


class _BrokenError(Exception):
    """The bytes make no sense from here on."""


def read_blf(path: Path) -> Iterator[tuple[Frames, float]]:
    """Batches of the frames in a BLF file, and the share read; the last holds the notes.

    Ends where the file is cut or damaged. Raises SignalError for a header that is cut short.
    """
    total = max(os.path.getsize(path), 1)
    tally = _Tally()
    with path.open("rb") as file:
        head = file.read(_HEADER.size)
        if len(head) < _HEADER.size:
            raise SignalError(f"{path.name}: {len(head)} bytes, not even the header of a BLF file; copy it again")
        fields = _HEADER.unpack(head)
        start = _date(fields[14:22])
        file.seek(max(fields[1], _HEADER.size))
        for objects in _batches(file, tally):
            frames = _frames(objects, start, tally)
            if len(frames):
                yield frames, min(file.tell() / total, 1.0)
    yield no_frames(tally.notes()), 1.0


@dataclass
class _Tally:
    """What was met so far."""

    frames: int = 0
    last: float = 0.0
    """s from the beginning of the file, of the last frame."""
    errors: int = 0
    remotes: int = 0
    damaged: int = 0
    broken: str = ""

    def notes(self) -> tuple[str, ...]:
        notes = counted((self.damaged, "damaged object"), (self.errors, "error frame"), (self.remotes, "remote frame"))
        if not self.broken:
            return notes
        at = f", at {self.last:.1f} s" if self.frames else ""
        return (*notes, f"broken after {self.frames} frames{at}: {self.broken}")


@dataclass(frozen=True, eq=False)
class _Objects:
    """Some objects: their bytes and a margin, and the place, size and kind of each."""

    bytes: NDArray[np.uint8]
    table: NDArray[np.int64]
    """(n, 3)."""

    def field(self, places: NDArray[np.int64], kind: str, width: int = 1) -> NDArray[Any]:
        """(n,) or (n, width) numbers at some places."""
        size = np.dtype(kind).itemsize * width
        values: NDArray[Any] = self.bytes[places[:, None] + np.arange(size)].view(kind)
        return values if width > 1 else values[:, 0]


def _batches(file: BinaryIO, tally: _Tally) -> Iterator[_Objects]:
    """The objects of all containers, some at a time, up to the end or to where the file is broken."""
    containers = _containers(file)
    parts: list[bytes] = []
    more = True
    while more:
        try:
            part = next(containers, None)
        except (_BrokenError, zlib.error) as error:
            tally.broken = str(error)
            part = None
        more = part is not None
        parts += [part] if part is not None else []
        if more and sum(map(len, parts)) < _BATCH:
            continue
        data = b"".join([*parts, bytes(_MARGIN)])
        array, at, end = np.frombuffer(data, np.uint8), 0, len(data) - _MARGIN
        while True:
            table, at, fault = _objects(data, at, end)
            if table:
                yield _Objects(array, np.array(table, np.int64))
            if fault or len(table) < _MANY:
                break
        if fault:
            tally.broken = fault
            return
        parts = [data[at:end]]
    if end - at > 3 and not tally.broken:
        tally.broken = "the file ends in the middle of an object"


def _containers(file: BinaryIO) -> Iterator[bytes]:
    """What the containers hold, unpacked; of one that the end of the file cuts, what is there."""
    while head := file.read(_OBJECT.size):
        if len(head) < _OBJECT.size:
            raise _BrokenError("the file ends in the middle of a container")
        mark, _, _, size, kind = _OBJECT.unpack(head)
        if mark != b"LOBJ" or not _OBJECT.size <= size <= _LARGEST:
            raise _BrokenError("no container where one should begin")
        body = file.read(size - _OBJECT.size)
        file.read(size % 4)
        if kind == _CONTAINER:
            method = int.from_bytes(body[:2], "little")
            if method not in (0, 2):
                raise _BrokenError(f"compression {method} is unknown")
            yield zlib.decompressobj().decompress(body[16:], _LARGEST) if method else body[16:]
        if len(body) < size - _OBJECT.size:
            raise _BrokenError("the file ends in the middle of a container")


def _objects(data: bytes, at: int, end: int) -> tuple[list[tuple[int, int, int]], int, str]:
    """Place, size and kind of the next whole objects in the bytes, where they end, and what is wrong there."""
    table: list[tuple[int, int, int]] = []
    unpack = _OBJECT.unpack_from
    while at + _OBJECT.size <= end and len(table) < _MANY:
        mark, _, _, size, kind = unpack(data, at)
        if mark != b"LOBJ":
            at = data.find(b"LOBJ", at, at + 8)  # behind bytes of padding
            if at < 0:
                return table, end, "no object where one should begin"
            continue
        if not _OBJECT.size <= size <= _LARGEST:
            return table, at, f"an object of {size} bytes"
        if at + size > end:
            break
        table.append((at, size, kind))
        at += size
    return table, at, ""


def _frames(objects: _Objects, start: float, tally: _Tally) -> Frames:
    """The data frames among some objects, in their order."""
    table = objects.table
    tally.errors += int(np.isin(table[:, 2], _ERRORS).sum())
    columns = [
        _gather(objects, np.flatnonzero(table[:, 2] == kind), layout, tally)
        for kind, layout in _LAYOUTS.items()
        if (table[:, 2] == kind).any()
    ]
    columns = [column for column in columns if column[0].size]
    if not columns:
        return no_frames()
    width = max(column[-1].shape[1] for column in columns)
    rows, stamp, ids, bus, length = (np.concatenate([column[k] for column in columns]) for k in range(5))
    data = np.concatenate([np.pad(column[-1], ((0, 0), (0, width - column[-1].shape[1]))) for column in columns])
    order = np.argsort(rows)
    time = start + stamp[order]
    tally.frames += time.size
    tally.last = float(stamp[order[-1]])
    return Frames(
        time=time,
        id=ids[order].astype(np.uint32) & np.uint32(0x1FFFFFFF),
        extended=ids[order] >> 31 > 0,
        bus=bus[order],
        data=data[order],
        length=length[order],
    )


def _gather(objects: _Objects, rows: NDArray[np.int64], layout: _Layout, tally: _Tally) -> tuple[NDArray[Any], ...]:
    """Row, stamp in s, id with its flag, bus, length and data of the good frames among the objects of one kind."""
    place, size = objects.table[rows, 0], objects.table[rows, 1]
    version = objects.field(place + 6, "<u2")
    header = np.where(version == 2, 40, 32)
    at = place + header
    ids = objects.field(at + 4, "<u4")
    length = np.minimum(objects.field(at + layout.length, "u1").astype(np.int32), 64 if layout.width > 8 else 8)
    room = size - header - layout.fixed
    good = (version > 0) & (version < 3) & (room >= 0) & ((ids >> 31 > 0) | ((ids & 0x1FFFFFFF) < 0x800))
    place_of_flags, kind, bit = layout.flags
    remote = objects.field(at + place_of_flags, kind) & bit > 0
    tally.damaged += int((~good).sum())
    tally.remotes += int((remote & good).sum())
    keep = good & ~remote
    stamp = objects.field(place + 24, "<u8").astype(np.float64)
    seconds = stamp * np.where(objects.field(place + 16, "<u4") == 1, 1e-5, 1e-9)
    data = objects.field(at + layout.fixed, "u1", layout.width)
    data = np.where(np.arange(layout.width) < np.minimum(length, room)[:, None], data, np.uint8(0))
    bus = objects.field(at, layout.channel).astype(np.int32)
    return rows[keep], seconds[keep], ids[keep], bus[keep], length[keep], data[keep]


def _date(parts: tuple[int, ...]) -> float:
    """Seconds since 1970 of a Windows SYSTEMTIME, taken as UTC; 0 for none."""
    year, month, _, day, hour, minute, second, milli = parts
    try:
        return datetime(year, month, day, hour, minute, second, milli * 1000, tzinfo=UTC).timestamp()
    except ValueError:
        return 0.0
