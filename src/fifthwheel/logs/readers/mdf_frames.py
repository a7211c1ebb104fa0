"""CAN frames that an MDF file holds as such: groups of bus events, by the names of the standard for bus logging."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fifthwheel.logs.can.frames import Batches, Frames
from fifthwheel.logs.readers.mdf_data import BrokenError, Data
from fifthwheel.logs.readers.mdf_model import Bytes, Channel, Group, Rows
from fifthwheel.logs.readers.mdf_rows import read_rows
from fifthwheel.logs.readers.mdf_values import times

_WIDEST = 64
_LONGEST_SPAN = 1 << 26
_SIZES = np.array([0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64], np.int32)
"""Bytes of payload by DLC."""


def batches(groups: Sequence[Group], notes: list[str]) -> Batches:
    """The frames of some groups, one group after the other; where one is broken a note says so."""

    def read() -> Iterator[tuple[Frames, float]]:
        total = sum({id(group.data): group.data.size for group in groups}.values()) or 1
        before = 0
        left = list(groups)
        while left:
            alike = [g for g in left if g is left[0] or (g.mix and g.data is left[0].data)]
            left = [group for group in left if group not in alike]
            count, last = 0, 0.0
            try:
                for rows in read_rows(alike):
                    frames = _frames(rows)
                    if len(frames):
                        count, last = count + len(frames), float(frames.time[-1])
                        yield frames, min(1.0, (before + rows.read) / total)
                trouble = alike[0].data.broken
            except BrokenError as error:
                trouble = str(error)
            if trouble:
                note = f"broken after {count} CAN frames of group {alike[0].label!r}, at {last:.1f} s: {trouble}"
                notes.extend([note] if note not in notes else [])
            before += alike[0].data.size

    return read


def _frames(rows: Rows) -> Frames:
    parts = rows.group.frames
    time = times(rows)
    count = time.size
    number = _raw(parts, "ID", rows, count, 0)
    extended = ((number >> 31 & 1) > 0) | ((number & 0x1FFFFFFF) > 0x7FF) | (_raw(parts, "IDE", rows, count, 0) != 0)
    data, length = _payload(parts["DataBytes"], rows, count)
    code = np.clip(_raw(parts, "DLC", rows, count, 15), 0, 15)
    said = np.clip(_raw(parts, "DataLength", rows, count, -1), -1, _WIDEST)
    length = np.minimum(length, np.where(said < 0, _SIZES[code], said)).astype(np.int32)
    data = np.where(np.arange(data.shape[1]) < length[:, None], data, 0).astype(np.uint8)
    good = np.isfinite(time)
    return Frames(
        time=time[good],
        id=(number & 0x1FFFFFFF).astype(np.uint32)[good],
        extended=extended[good],
        bus=(_raw(parts, "BusChannel", rows, count, 0) & 0x7FFFFFFF).astype(np.int32)[good],
        data=data[good],
        length=length[good].astype(np.int32),
    )


def _raw(parts: dict[str, Channel], name: str, rows: Rows, count: int, default: int) -> NDArray[np.int64]:
    if name not in parts or not parts[name].kind:
        return np.full(count, default, np.int64)
    values = replace(parts[name], kind="u").raw(rows.records)[:count]
    return values.astype(np.int64)


def _payload(channel: Channel, rows: Rows, count: int) -> tuple[Bytes, NDArray[np.int64]]:
    """(n, 64) bytes, or as many as the channel has, and how many of each row there are."""
    if isinstance(channel.lengths, int):
        values = rows.lengths.get(channel.lengths, [])[:count]
        data = b"".join(value[:_WIDEST].ljust(_WIDEST, b"\0") for value in values)
        matrix = np.zeros((count, _WIDEST), np.uint8)
        matrix[: len(values)] = np.frombuffer(data, np.uint8).reshape(-1, _WIDEST)
        sizes = np.zeros(count, np.int64)
        sizes[: len(values)] = [len(value) for value in values]
        return matrix, sizes
    if isinstance(channel.lengths, Data):
        return _signal_data(channel.lengths, replace(channel, kind="u").raw(rows.records)[:count].astype(np.int64))
    first, width = channel.bit // 8, min(channel.bits // 8, _WIDEST)
    if channel.bit % 8 or first + width > rows.records.shape[1]:
        raise BrokenError("the payload lies outside of the record")
    matrix = np.zeros((count, max(width, 8)), np.uint8)
    matrix[:, :width] = rows.records[:count, first : first + width]
    return matrix, np.full(count, width)


def _signal_data(data: Data, places: NDArray[np.int64]) -> tuple[Bytes, NDArray[np.int64]]:
    """Values that lie apart, each at its place behind its length of four bytes."""
    if not places.size:
        return np.zeros((0, _WIDEST), np.uint8), places
    begin, end = int(places.min()), int(places.max()) + 4 + _WIDEST
    if begin < 0 or end - begin > _LONGEST_SPAN:
        raise BrokenError(f"payloads from byte {begin} to {end} of their block")
    span = data.read(begin, end)
    near = places - begin
    there = near + 4 <= len(span)
    whole = np.frombuffer(span.ljust(end - begin, b"\0"), np.uint8)
    sizes = np.ascontiguousarray(whole[near[:, None] + np.arange(4)]).view("<u4").ravel().astype(np.int64)
    sizes = np.where(there, np.minimum(sizes, np.maximum(len(span) - near - 4, 0)), 0)
    return whole[near[:, None] + 4 + np.arange(_WIDEST)], np.minimum(sizes, _WIDEST)
