"""CAN traces by python-can: Vector BLF and ASC, PCAN trace, candump, and texts that become lines of candump."""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from functools import partial
from itertools import islice
from pathlib import Path
from typing import BinaryIO

import can
import numpy as np

from fifthwheel.data.logs.can.log import CanLog, Frames, open_can_log
from fifthwheel.data.logs.readers import has_asc_header, trace_kind
from fifthwheel.data.logs.readers.can_text import TEXT_TRACES
from fifthwheel.data.logs.source import ReadProgress, damage, no_progress

_BATCH = 50_000
_MOST_AT_ONCE = 2_000_000
"""Frames of one container; more, and damage makes python-can read the same object for ever."""
_CHECKED = 1000
"""Frames after which the place in the file is looked up."""
_MOST_DAMAGED = 1000
"""Damaged lines more than frames after which reading stops."""
_MOST_HEADER_LINES = 100
_READERS = {"asc": can.ASCReader, "trc": can.TRCReader}
_FIRST_BUS = {"blf": 1, "asc": 1}
"""python-can counts these from 0, the log from 1."""
_ASC_DEFAULT = ("base hex  timestamps absolute\n", "internal events logged\n")
"""Header for an ASC file without one."""
_HEADER = re.compile(r"\s*(?:;|date\b|base\b|(?:no\s+)?internal\b)", re.IGNORECASE)
_TRC_ERROR = re.compile(r"\s*\d+\)?\s+[\d.]+\s+(?:\d+\s+)?(?:ER|Error)\b")
_STAMP = re.compile(r"\s*(\d+\.\d+)")
_LONG_CANDUMP = re.compile(
    r"\s*(\(\S+\)\s+\S+)\s+(?:[RT]X\s+\S+\s+\S+\s+)?([0-9A-Fa-f]+)\s+\[\d+\]((?:\s+[0-9A-Fa-f]{2}\b)*)(.*)"
)


def open_log(path: Path, databases: Sequence[str | Path] = (), progress: ReadProgress = no_progress) -> CanLog:
    """The log in a file of CAN frames; SignalError where it has none, or none that a database has."""
    return open_can_log(path.name, partial(read_frames, path), databases, progress)


def read_frames(path: Path, notes: list[str]) -> Iterator[tuple[Frames, float]]:
    """The frames of a trace in batches, and the fraction read; `notes` gets what is left out."""
    tally: Counter[str] = Counter()
    buses: dict[str, int] = {}
    with path.open("rb") as file:
        size, head = path.stat().st_size, file.read(4096)
        kind = trace_kind(head) or "candump"
        file.seek(0)
        default: tuple[str, ...] = ()
        if kind == "asc" and not has_asc_header(head):
            default = _ASC_DEFAULT
            notes.append("an ASC file without its header: identifiers and data read as hexadecimal, times as absolute")
        messages = _messages(file, kind, default, tally, notes)
        while batch := list(islice(messages, _BATCH)):
            yield _frames(batch, tally, buses, _FIRST_BUS.get(kind, 0)), 1.0 if file.closed else file.tell() / size
    notes += [f"{count} {what}{'s' * (count > 1)} left out" for what, count in tally.items() if count]


def _messages(
    file: BinaryIO, kind: str, header: Sequence[str], tally: Counter[str], notes: list[str]
) -> Iterator[can.Message]:
    """What python-can reads below a header and the file; where a line is damaged, it goes on with the next one."""
    if kind == "blf":
        yield from _blf_messages(file, notes)
        return
    reader = _READERS.get(kind, can.CanutilsLogReader)  # which reads all texts that become lines of candump
    lines, count, at, ended = _Lines(file, kind, header), 0, -1, False
    while not ended and lines.number > at and tally["damaged line"] < count + _MOST_DAMAGED:
        at = lines.number
        try:
            for message in reader(lines):
                count += 1
                yield message
            ended = True
        except MemoryError:
            raise
        except Exception:
            tally["damaged line"] += 1
            lines.restart()
    tally["error frame"] += lines.errors
    if lines.unfinished:
        notes.append("last line left out: it has no line end and may be cut short")


def _blf_messages(file: BinaryIO, notes: list[str]) -> Iterator[can.Message]:
    count, since, place, message = 0, 0, 0, None
    with damage() as troubles:
        for count, message in enumerate(can.BLFReader(file), 1):
            if count % _CHECKED == 0 and file.tell() != place:
                place, since = file.tell(), count
            if count - since > _MOST_AT_ONCE:
                troubles.append("one object is repeated")
                break
            yield message
    at = f", at {message.timestamp:.1f} s" if message else ""
    notes += [f"broken after {count} frames{at}: {why}" for why in troubles]


class _Lines:
    """The lines of a text trace, as python-can iterates over a file; in the form that it can read."""

    def __init__(self, file: BinaryIO, kind: str, header: Sequence[str]) -> None:
        self._file, self._kind = file, kind
        self.number = 0
        """Lines read."""
        self.unfinished = False
        """Whether the last line has no line end, and was left out."""
        self.errors = 0
        """Error frames of a PCAN trace, which python-can passes over."""
        self._header = [*header]
        self._again = self._header[::-1]
        self._last = ""
        self._relative = False
        self._clock = 0.0

    def restart(self) -> None:
        """Give the header again to a new reader, without the line that the last one could not read."""
        self._header = [line for line in self._header if line != self._last]
        self._again = self._header[::-1]

    def __iter__(self) -> "_Lines":
        return self

    def __next__(self) -> str:
        if self._again:
            return self._again.pop()
        raw = self._file.readline()
        self.unfinished = bool(raw) and not raw.endswith(b"\n")
        if not raw or self.unfinished:
            raise StopIteration
        self.number += 1
        self._last = self._readable(raw.decode("latin-1"))
        return self._last

    def _readable(self, line: str) -> str:
        if self._kind in TEXT_TRACES:
            return TEXT_TRACES[self._kind].candump(line)
        if self._kind == "candump":
            long = _LONG_CANDUMP.match(line)
            if long is None:
                return line
            if "ERRORFRAME" in long[4]:
                return "\n"
            return f"{long[1]} {long[2]}#{''.join(long[3].split())}{'R' * ('remote' in long[4])}\n"
        if len(self._header) < _MOST_HEADER_LINES and _HEADER.match(line):
            self._header.append(line)
            self._relative |= self._kind == "asc" and "timestamps relative" in line
        elif self._kind == "trc":
            self.errors += _TRC_ERROR.match(line) is not None
        elif self._relative and (stamp := _STAMP.match(line)):
            self._clock += float(stamp[1])
            return f"{self._clock:.6f}{line[stamp.end() :]}"
        return line

    def close(self) -> None:
        """python-can closes what it has read to the end."""


def _frames(messages: Sequence[can.Message], tally: Counter[str], buses: dict[str, int], first_bus: int) -> Frames:
    """The data frames among some messages; the others are counted."""
    frames = [m for m in messages if not (m.is_error_frame or m.is_remote_frame)]
    errors = sum(m.is_error_frame for m in messages)
    tally["error frame"] += errors
    tally["remote frame"] += len(messages) - errors - len(frames)
    data = [m.data[:64] for m in frames]
    length = np.array(list(map(len, data)), np.int32)
    width = max(8, int(length.max(initial=0)))
    joined = b"".join([payload.ljust(width, b"\0") for payload in data])
    time = np.array([m.timestamp for m in frames], np.float64)
    number = np.array([min(m.arbitration_id, 1 << 32) for m in frames], np.int64)
    extended = np.array([m.is_extended_id for m in frames], np.bool_)
    bus = [m.channel if isinstance(m.channel, int) else _bus_number(str(m.channel), buses) for m in frames]
    complete = np.array([m.is_fd or len(m.data) >= m.dlc for m in frames], np.bool_)
    good = complete & (number >= 0) & (number <= np.where(extended, 0x1FFFFFFF, 0x7FF)) & np.isfinite(time)
    tally["damaged frame"] += int((~good).sum())
    return Frames(
        time=time,
        id=number.astype(np.uint32),
        extended=extended,
        bus=np.array([number + first_bus & 0x7FFFFFFF for number in bus], np.int32),
        data=np.frombuffer(joined, np.uint8).reshape(-1, width),
        length=length,
    ).take(np.flatnonzero(good))


def _bus_number(name: str, buses: dict[str, int]) -> int:
    """The number at the end of a bus's name, else the next free one; `buses` are those so far."""
    if name not in buses:
        digits, taken = re.search(r"\d{1,6}$", name), set(buses.values())
        free = next(k for k in range(len(taken) + 1) if k not in taken)
        buses[name] = int(digits[0]) if digits and int(digits[0]) not in taken else free
    return buses[name]
