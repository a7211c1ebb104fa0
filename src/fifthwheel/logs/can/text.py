"""CAN logs that are text, a frame a line: read by one regular expression in chunks of many lines."""

import os
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import accumulate
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from fifthwheel.logs.can.frames import Frames, counted, no_frames

_BLOCK = 1 << 21
_LONGEST_LINE = 1 << 16
_CACHED = 100_000
_LARGEST = 64
_BUSES = 256
_NOT_AN_ID = -1
_NOT_SAID = -1
_ERROR_FRAME = -2
_STAMP = re.compile(rb"\s*(\d+\.\d+)")


@dataclass(frozen=True, kw_only=True)
class Dialect:
    """How one format writes a line."""

    frame: re.Pattern[bytes]
    """One match a line: group time, first of all, and id, bus, kind, length, data, each also as id_2 and so on where a
    format writes it in two ways; or group rest, for any other line."""
    error: re.Pattern[bytes] | None = None
    """Whether the rest is an error frame,"""
    other: re.Pattern[bytes]
    """or a line that is in order and holds no frame."""
    extended: Callable[[bytes], bool]
    """Whether an id as written has 29 bits."""
    bus: Callable[[bytes], int | None]
    """Number in the name of a bus; None to count."""
    decimal: bool = False
    """Ids and data are written in decimal."""
    size: Callable[[bytes], int] = int
    """Bytes of payload that a length as written stands for."""
    more: bool = False
    """More may follow on the data."""
    remote: Callable[[bytes], bool]
    """Whether a kind is that of remote frames."""
    unit: float = 1.0
    """s, of a time stamp."""
    start: float = 0.0
    """s, added to every time."""
    relative: bool = False
    """Stamps count from the line before."""


def read_text(path: Path, dialect: Dialect) -> Iterator[tuple[Frames, float]]:
    """Batches of the frames in a text log, and the share read; the last holds the notes."""
    total = max(os.path.getsize(path), 1)
    reading = _Reading(dialect)
    with path.open("rb") as file:
        for chunk, whole in _chunks(file):
            frames = reading.frames(chunk, whole=whole)
            if len(frames):
                yield frames, min(file.tell() / total, 1.0)
    yield no_frames(reading.notes()), 1.0


def _chunks(file: BinaryIO) -> Iterator[tuple[bytes, bool]]:
    """Whole lines without the last line end, and whether there is one; what is no text does not fill the memory."""
    rest = b""
    while block := file.read(_BLOCK):
        block = rest + block
        cut = block.rfind(b"\n")
        if cut >= 0:
            yield block[:cut], True
        rest = block[cut + 1 :]
        if len(rest) > _LONGEST_LINE:
            rest = rest[:_LONGEST_LINE]
    if rest:
        yield rest, False


class _Names(dict[bytes, int]):
    """What a text stands for, worked out once."""

    def __init__(self, meaning: Callable[[bytes], int]) -> None:
        super().__init__()
        self._meaning = meaning

    def __missing__(self, text: bytes) -> int:
        if len(self) > _CACHED:
            self.clear()
        self[text] = value = self._meaning(text)
        return value


@dataclass
class _Reading:
    """One reading of a file: what has been met so far."""

    dialect: Dialect
    lines: int = 0
    damaged: int = 0
    first: int = 0
    errors: int = 0
    remotes: int = 0
    clock: float = 0.0
    buses: dict[bytes, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._ids = _Names(self._id)
        self._lengths = _Names(self._length)
        self._bus = _Names(self._number)
        self._kinds = _Names(self.dialect.remote)
        names = self.dialect.frame.groupindex
        self._places = {name: names[name] - 1 for name in names}
        self._rest, self._time = names["rest"] - 1, names["time"] - 1

    def notes(self) -> tuple[str, ...]:
        notes = []
        if self.damaged:
            lines = "line" if self.damaged == 1 else "lines"
            where = "line" if self.damaged == 1 else "the first at line"
            notes.append(f"{self.damaged} damaged {lines} left out, {where} {self.first}")
        return (*notes, *counted((self.errors, "error frame"), (self.remotes, "remote frame")))

    def frames(self, chunk: bytes, *, whole: bool) -> Frames:
        """The frames in some lines; `whole`: the last of them had a line end."""
        found = self.dialect.frame.findall(chunk)
        at = self.lines
        self.lines += len(found)
        stamps = self._absolute(found) if self.dialect.relative else None
        found, numbers = self._rows(found, at)
        if not found:
            return no_frames()
        columns = list(zip(*found, strict=True))
        ids, bus, kind, length, data = (self._column(columns, name) for name in ("id", "bus", "kind", "length", "data"))
        seconds = np.array(list(map(float, columns[self._time])) if stamps is None else [stamps[k] for k in numbers])
        codes = np.array([self._ids[text] for text in ids], np.int64)
        want = np.array([self._lengths[text] for text in length], np.int32)
        texts = self._hex(data, want)
        digits = np.array(list(map(len, texts)), np.int32)
        sizes = digits // 2
        want = np.where(want < 0, sizes, want)
        remote = np.array([self._kinds[text] for text in kind], np.bool_)
        error = codes == _ERROR_FRAME
        crooked = (want > sizes if self.dialect.more else want != sizes) | (sizes > _LARGEST) | (digits % 2 > 0)
        bad = (codes == _NOT_AN_ID) | (crooked & ~remote & ~error)
        if not whole and not length[-1] and sizes[-1] < 8 and numbers[-1] == self.lines - at - 1:
            bad[-1] = not remote[-1]
        if bad.any():
            self._damage(int(bad.sum()), at + int(numbers[bad.argmax()]) + 1)
        self.errors += int((error & ~bad).sum())
        self.remotes += int((remote & ~bad & ~error).sum())
        good = np.flatnonzero(~(bad | remote | error))
        if not good.size:
            return no_frames()
        if good.size < len(found):
            texts, bus = [texts[k] for k in good.tolist()], tuple(bus[k] for k in good.tolist())
            seconds, codes, want = seconds[good], codes[good], want[good]
        return Frames(
            time=seconds * self.dialect.unit + self.dialect.start,
            id=(codes & 0x1FFFFFFF).astype(np.uint32),
            extended=codes >> 31 > 0,
            bus=np.array([self._bus[text] for text in bus], np.int32),
            data=_payload(texts, want),
            length=want,
        )

    def _rows(self, found: list[tuple[bytes, ...]], at: int) -> tuple[list[tuple[bytes, ...]], NDArray[np.int64]]:
        """Of the matches of some lines those of frames, and which lines they are; the others are looked through."""
        others = [k for k, row in enumerate(found) if row[self._rest] or not row[self._time]]
        if not others:
            return found, np.arange(len(found))
        for k in others:
            self._other(found[k][self._rest], at + k + 1)
        numbers = np.delete(np.arange(len(found)), others)
        return [found[k] for k in numbers.tolist()], numbers

    def _column(self, columns: list[tuple[bytes, ...]], name: str) -> tuple[bytes, ...]:
        one, two = (self._places.get(group) for group in (name, f"{name}_2"))
        if one is None:
            return (b"",) * len(columns[0])
        if two is None:
            return columns[one]
        return tuple(a or b for a, b in zip(columns[one], columns[two], strict=True))

    def _other(self, line: bytes, number: int) -> None:
        if self.dialect.error is not None and self.dialect.error.match(line):
            self.errors += 1
        elif line.strip() and not self.dialect.other.match(line):
            self._damage(1, number)

    def _damage(self, count: int, first: int) -> None:
        self.first = min(first, self.first) if self.damaged else first
        self.damaged += count

    def _absolute(self, found: list[tuple[bytes, ...]]) -> list[float]:
        """Stamps of all lines, counted from the first of the file."""
        steps = [_STAMP.match(row[self._time] or row[self._rest]) for row in found]
        stamps = list(accumulate((float(step[1]) if step else 0.0 for step in steps), initial=self.clock))[1:]
        self.clock = stamps[-1] if stamps else self.clock
        return stamps

    def _id(self, text: bytes) -> int:
        """The id, with bit 31 set for 29 bits; negative where there is none."""
        extended = self.dialect.extended(text)
        number = int(text.rstrip(b"xX"), 10 if self.dialect.decimal else 16)
        if number > 0x1FFFFFFF and number <= 0xFFFFFFFF:
            return _ERROR_FRAME
        if number > (0x1FFFFFFF if extended else 0x7FF):
            return _NOT_AN_ID
        return number | (1 << 31 if extended else 0)

    def _length(self, text: bytes) -> int:
        return self.dialect.size(text) if text else _NOT_SAID

    def _number(self, text: bytes) -> int:
        if text not in self.buses:
            if len(self.buses) == _BUSES:
                return -1
            number = self.dialect.bus(text)
            taken = set(self.buses.values())
            if number is None or number in taken or number > 1 << 20:
                number = next(k for k in range(len(taken) + 1) if k not in taken)
            self.buses[text] = number
        return self.buses[text]

    def _hex(self, data: tuple[bytes, ...], want: NDArray[np.int32]) -> list[bytes]:
        if self.dialect.decimal:
            numbers = [list(map(int, text.split()[:size])) for text, size in zip(data, want.tolist(), strict=True)]
            return [bytes(row).hex().encode() if max(row, default=0) < 256 else b"" for row in numbers]
        texts = [text.translate(None, b" \t") for text in data]
        if self.dialect.more:
            texts = [text[: 2 * size] for text, size in zip(texts, want.tolist(), strict=True)]
        return texts


def _payload(texts: list[bytes], sizes: NDArray[np.int32]) -> NDArray[np.uint8]:
    width = max(8, int(sizes.max()))
    if (sizes != width).any():
        texts = [text.ljust(2 * width, b"0") for text in texts]
    return np.frombuffer(bytes.fromhex(b"".join(texts).decode()), np.uint8).reshape(-1, width)
