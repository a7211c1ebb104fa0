"""Databases of CAN messages by cantools: those of the user, then J1939; which message a frame is, and its values."""

import math
import struct
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import Enum
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

import cantools.database
import numpy as np
from numpy.typing import NDArray

from fifthwheel.base.errors import FifthwheelError, SignalError, suggestion
from fifthwheel.base.input_files import require_regular
from fifthwheel.base.names import split_source
from fifthwheel.data.channels import split_header
from fifthwheel.data.logs.source import damage

_PLACEHOLDER = "VECTOR__INDEPENDENT_SIG_MSG"
_FORMATS = ("dbc", "arxml", "kcd", "sym")
_ENCODINGS = {"dbc": "cp1252", "sym": "cp1252"}


@dataclass(frozen=True, kw_only=True)
class Bits:
    """Position of a number in a payload, as in a DBC: bit k is bit k % 8 of byte k // 8."""

    start: int
    """Its lowest bit; its highest bit when it is big endian."""
    length: int
    """1 to 64."""
    little: bool = True
    signed: bool = False
    floating: bool = False
    """IEEE 754 of 16, 32 or 64 bits."""

    @property
    def span(self) -> tuple[int, int]:
        """First byte, and the byte after the last."""
        before = self.start & 7 if self.little else 7 - (self.start & 7)
        return self.start >> 3, (self.start >> 3) + (before + self.length + 7 >> 3)

    @property
    def shift(self) -> int:
        """Bits below its lowest one in the byte that has that one."""
        return self.start & 7 if self.little else (self.start + 1 - self.length) & 7

    def present(self, length: NDArray[np.int32]) -> NDArray[np.bool_]:
        """(n,) whether payloads of these lengths contain it."""
        return length >= self.span[1]

    def raw(self, data: NDArray[np.uint8]) -> NDArray[np.uint64] | NDArray[np.int64] | NDArray[np.floating]:
        """(n,) numbers in payloads (n, width): unsigned, signed or floating; zeros where the width is too small."""
        first, end = self.span
        if end > data.shape[1]:
            return np.zeros(len(data), np.uint64)
        number, shift = np.zeros(len(data), np.uint64), self.shift
        for k, byte in enumerate(range(first, end) if self.little else range(end - 1, first - 1, -1)):
            part = data[:, byte].astype(np.uint64)
            number |= part >> np.uint64(shift) if k == 0 else part << np.uint64(8 * k - shift)
        if self.length < 64:
            number &= np.uint64((1 << self.length) - 1)
        if self.floating:
            return number.astype(f"u{self.length // 8}").view(f"f{self.length // 8}")
        if self.signed:
            sign = np.uint64(1 << (self.length - 1))
            return ((number ^ sign) - sign).view(np.int64)
        return number

    def number(self, payload: bytes) -> int | float:
        """The number in one payload that contains it, equal to that of `raw`."""
        first, end = self.span
        number = int.from_bytes(payload[first:end], "little" if self.little else "big") >> self.shift
        number &= (1 << self.length) - 1
        if self.floating:
            code = {2: "e", 4: "f", 8: "d"}[size := self.length // 8]
            value: float = struct.unpack(f"<{code}", number.to_bytes(size, "little"))[0]
            return value
        if self.signed:
            sign = 1 << (self.length - 1)
            return (number ^ sign) - sign
        return number


Gates = tuple[tuple[str, Bits, frozenset[int]], ...]
"""The multiplexers of a signal by name, from the outermost, and their values with which it is present."""


@dataclass(frozen=True, kw_only=True)
class CanSignal:
    """One signal of a message."""

    name: str
    bits: Bits
    scale: float
    offset: float
    unit: str | None
    gates: Gates = ()
    highest: int | None = None
    """Raw values above it mean an error or not available; None where all are values."""

    def present(self, data: NDArray[np.uint8], length: NDArray[np.int32]) -> NDArray[np.bool_]:
        """(n,) whether payloads (n, width) of these lengths (n,) contain it, by their multiplexers."""
        present = np.ones(len(data), np.bool_)
        for _, bits, values in self.gates:
            present &= bits.present(length) & np.isin(bits.raw(data), np.array(sorted(values)))
        return present

    def values(self, data: NDArray[np.uint8], length: NDArray[np.int32]) -> NDArray[np.float64]:
        """(n,) in its unit, NaN where the payload is too short or the value means not available."""
        raw = self.bits.raw(data)
        good = self.bits.present(length)
        if self.highest is not None:
            good &= raw <= self.highest
        with np.errstate(all="ignore"):  # floating signals may have any value
            values = raw.astype(np.float64) * self.scale + self.offset
        return np.where(good & np.isfinite(values), values, np.nan)

    def in_payload(self, payload: bytes) -> bool:
        """Whether one payload contains it, by its length and its multiplexers."""
        if len(payload) < self.bits.span[1]:
            return False
        return all(len(payload) >= b.span[1] and b.number(payload) in allowed for _, b, allowed in self.gates)

    def value(self, payload: bytes) -> float:
        """The value in one payload that contains it, equal to that of `values`."""
        raw = self.bits.number(payload)
        if self.highest is not None and raw > self.highest:
            return math.nan
        value = float(raw) * self.scale + self.offset
        return value if math.isfinite(value) else math.nan


@dataclass(frozen=True, kw_only=True, eq=False)
class Message:
    """One message of a database."""

    name: str
    signals: tuple[CanSignal, ...]


class Databases:
    """Some databases in the order in which they are searched."""

    def __init__(self, tables: Iterable[Sequence[tuple[int, bool, Message]]]) -> None:
        self._exact: dict[tuple[int, bool], Message] = {}
        self._groups: dict[int, Message] = {}
        for table in tables:
            for number, extended, message in table:
                self._exact.setdefault((number, extended), message)
                if extended:
                    self._groups.setdefault(group(number), message)

    def message(self, number: int, extended: bool) -> Message | None:
        """The message with this id; with 29 bits, else that of its parameter group, from any source."""
        exact = self._exact.get((number, extended))
        if exact is None and extended:
            return self._groups.get(group(number))
        return exact

    def ids(self) -> list[tuple[int, bool, Message]]:
        """Every id, whether it has 29 bits, and its message."""
        return [(number, extended, message) for (number, extended), message in self._exact.items()]

    def named(self) -> dict[str, Message]:
        """The messages by name; of several with the same name, the first."""
        messages: dict[str, Message] = {}
        for message in self._exact.values():
            messages.setdefault(message.name, message)
        return messages


def group(number: int) -> int:
    """J1939 parameter group number of a 29-bit id: without priority, source and destination address."""
    return number >> 8 & (0x3FFFF if number >> 16 & 0xFF >= 240 else 0x3FF00)


def load(paths: Sequence[str | Path]) -> Databases:
    """The databases in some files, DBC, ARXML, KCD or SYM, and then J1939.

    Raises SignalError for a file that cannot be read or is no database of CAN messages.
    """
    tables = [_file(Path(path)) for path in paths]
    text = files("fifthwheel.data.logs.can").joinpath("j1939.dbc").read_text("utf-8")
    return Databases([*tables, _table(text, "dbc", builtin=True)])


def _file(path: Path) -> list[tuple[int, bool, Message]]:
    try:
        require_regular(path)
        data = path.read_bytes()
    except FifthwheelError as error:
        raise SignalError(f"the database {error}") from None
    except OSError as error:
        raise SignalError(f"the database {path}: cannot be read ({error.strerror}); check the path") from error
    ending = path.suffix[1:].lower()
    reasons: list[str] = []
    for kind in (ending,) if ending in _FORMATS else _FORMATS:
        with damage() as troubles:
            text = data.decode(_ENCODINGS.get(kind, "utf-8"), "replace").removeprefix("\ufeff")
            if table := _table(text, kind):
                return table
            troubles.append("it defines no message")
        reasons += troubles
    why = reasons[0].partition(': "')[0]  # without the line of the file
    raise SignalError(f"{path.name}: not a valid CAN database ({why}); give a DBC or ARXML file")


def _table(text: str, kind: str, *, builtin: bool = False) -> list[tuple[int, bool, Message]]:
    """Id, whether it has 29 bits, and message, of all messages in the text of a database."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        database: Any = cantools.database.load_string(text, kind, strict=False)
    return [
        (message.frame_id, bool(message.is_extended_frame), _message(message, builtin=builtin))
        for message in database.messages
        if message.signals and message.name != _PLACEHOLDER
    ]


def _message(message: Any, *, builtin: bool) -> Message:
    by_name = {signal.name: signal for signal in message.signals}
    signals = tuple(
        CanSignal(
            name=signal.name,
            bits=_bits(signal),
            scale=float(signal.scale),
            offset=float(signal.offset),
            unit=str(signal.unit) if signal.unit else None,
            gates=_gates(signal, by_name),
            highest=_highest(signal, message, builtin=builtin),
        )
        for signal in message.signals
    )
    return Message(name=message.name, signals=signals)


def _bits(signal: Any) -> Bits:
    return Bits(
        start=signal.start,
        length=signal.length,
        little=signal.byte_order == "little_endian",
        signed=bool(signal.is_signed),
        floating=bool(signal.is_float),
    )


def _gates(signal: Any, by_name: dict[str, Any]) -> Gates:
    gates: list[tuple[str, Bits, frozenset[int]]] = []
    while signal.multiplexer_ids and signal.multiplexer_signal in by_name and len(gates) < len(by_name):
        parent = by_name[signal.multiplexer_signal]
        gates.insert(0, (parent.name, _bits(parent), frozenset(signal.multiplexer_ids)))
        signal = parent
    return tuple(gates)


def _highest(signal: Any, message: Any, *, builtin: bool) -> int | None:
    """The largest raw value that is a value in J1939: above it are error, not available and reserved codes."""
    if not message.is_extended_frame or signal.is_signed or signal.is_float or signal.length == 1:
        return None
    aligned = signal.start % 8 == (0 if signal.byte_order == "little_endian" else 7)
    highest: int
    if aligned and signal.length in (8, 16, 24, 32):
        highest = (0xFB << (signal.length - 8)) - 1
    elif signal.length == 2:
        highest = 1
    elif builtin:
        return (1 << int(signal.length)) - 2
    else:
        return None
    if builtin or message.protocol == "j1939" or signal.maximum is None or not signal.scale:
        return highest
    # not where the database of the user gives a range that goes beyond it
    return highest if abs(signal.maximum - signal.offset) <= abs(signal.scale) * (highest + 0.5) else None


class Frame(NamedTuple):
    """One data frame of a bus."""

    time: float
    """Timestamp of the bus, s."""
    id: int
    """11 or 29 bits, without flags."""
    data: bytes
    extended: bool = False
    """Whether the id has 29 bits."""
    bus: int = 0
    """Number of the bus, as in a log."""


class Quality(Enum):
    """Of one value in a frame."""

    VALID = "valid"
    NOT_AVAILABLE = "not available"
    """The sender reports an error or has no value."""
    WRONG_LENGTH = "wrong length"
    """The payload is too short for the signal."""


class Reading(NamedTuple):
    """One column in a frame."""

    column: str
    """One of `FrameDecoder.columns`."""
    value: float
    """In the unit of the database; NaN unless valid."""
    quality: Quality


class _Wanted(NamedTuple):
    """A column of the map, which "Message.Signal@source:bus" names."""

    column: str
    """With its unit in brackets."""
    message: str
    signal: str
    source: int | None
    bus: int | None


class FrameDecoder:
    """Decodes the columns that a signal map names, with the databases of the user and J1939.

    Columns are "Message.Signal", "Message.Signal@source" or "Message.Signal@source:bus", as in a log, with or without a
    [unit]; a SignalError for one that no database has. A column without a source address or a bus takes the first one
    that sends it; `other_sources` lists the others.
    """

    def __init__(self, databases: Databases, columns: Iterable[str]) -> None:
        self._databases = databases
        messages = databases.named()
        self._wanted: list[_Wanted] = []
        for text in dict.fromkeys(columns):
            column = _wanted(text)
            if column.message not in messages:
                raise SignalError(
                    f"{text}: no database has a message {column.message!r}; {suggestion(column.message, messages)}"
                )
            signals = {signal.name: signal for signal in messages[column.message].signals}
            if column.signal not in signals:
                raise SignalError(
                    f"{text}: {column.message} has no signal {column.signal!r}; {suggestion(column.signal, signals)}"
                )
            unit = split_header(text)[1] or signals[column.signal].unit
            self._wanted.append(column._replace(column=f"{column.column} [{unit}]" if unit else column.column))
        self._messages = {wanted.message for wanted in self._wanted}
        self._routes: dict[tuple[int, bool, int], list[tuple[str, CanSignal]]] = {}
        self._chosen: dict[str, tuple[int, bool, int]] = {}
        self.other_sources: dict[str, list[str]] = {}
        """Frames that have a column too, but from another source or bus than the one that is used."""

    @property
    def columns(self) -> tuple[str, ...]:
        """The columns of the readings: as in the map, with the unit of the map or of the database in brackets."""
        return tuple(wanted.column for wanted in self._wanted)

    def decode(self, frame: Frame) -> list[Reading]:
        """The columns in a frame; none for a frame of another message."""
        key = (frame.id, frame.extended, frame.bus)
        if key not in self._routes:
            self._routes[key] = self._route(frame)
        readings = []
        for column, signal in self._routes[key]:
            if signal.in_payload(frame.data):
                value = signal.value(frame.data)
                readings.append(Reading(column, value, Quality.VALID if value == value else Quality.NOT_AVAILABLE))
            elif len(frame.data) < signal.bits.span[1]:
                readings.append(Reading(column, float("nan"), Quality.WRONG_LENGTH))
        return readings

    def own(self, ids: Iterable[int], *, extended: bool) -> int | None:
        """The first of these ids that a wanted message has; None if there is none."""
        messages = ((number, self._databases.message(number, extended)) for number in ids)
        return next((number for number, message in messages if message and message.name in self._messages), None)

    def filters(self) -> list[dict[str, int | bool]]:
        """Filters for a bus of python-can that accept every frame with a column: id, mask, 29 bits."""
        filters: list[dict[str, int | bool]] = []
        for number, extended, message in self._databases.ids():
            if message.name in self._messages:
                pdu1 = extended and number >> 16 & 0xFF < 240
                mask = (0x03FF0000 if pdu1 else 0x03FFFF00) if extended else 0x7FF
                filters.append({"can_id": number & mask, "can_mask": mask, "extended": extended})
        return filters

    def _route(self, frame: Frame) -> list[tuple[str, CanSignal]]:
        """The wanted signals of frames with this id from this bus."""
        message = self._databases.message(frame.id, frame.extended)
        if message is None:
            return []
        source, key = frame.id & 0xFF if frame.extended else None, (frame.id, frame.extended, frame.bus)
        route = []
        signals = {signal.name: signal for signal in message.signals}
        for wanted in self._wanted:
            is_sender = wanted.source in (None, source) and wanted.bus in (None, frame.bus)
            if wanted.message != message.name or wanted.signal not in signals or not is_sender:
                continue
            chosen = self._chosen.setdefault(wanted.column, key)
            if _sender(chosen) == _sender(key):
                route.append((wanted.column, signals[wanted.signal]))
            else:
                address = f"@{frame.id & 0xFF:02X}:{frame.bus}" if frame.extended else f"@:{frame.bus}"
                self.other_sources.setdefault(wanted.column, []).append(address)
        return route


def signal_columns(databases: Databases) -> list[str]:
    """All columns that some databases may have: "Message.Signal"."""
    return [f"{name}.{signal.name}" for name, message in databases.named().items() for signal in message.signals]


def _sender(key: tuple[int, bool, int]) -> tuple[int, bool, int]:
    """What frames of one message from one sender have in common; the priority of a 29-bit id may change."""
    number, extended, bus = key
    return (group(number) << 8 | number & 0xFF if extended else number, extended, bus)


def _wanted(text: str) -> _Wanted:
    column = split_header(text)[0]
    name, origin = split_source(column)
    message, _, signal = name.partition(".")
    source, _, bus = origin.partition(":")
    try:
        return _Wanted(column, message, signal, int(source, 16) if source else None, int(bus) if bus else None)
    except ValueError:
        raise SignalError(
            f"{text}: expected a source address and a bus as in VDC2.yaw_rate@0B:1, got {origin!r}"
        ) from None
