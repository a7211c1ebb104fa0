"""Databases of CAN messages by cantools: those of the user, then J1939; which message a frame is, and its numbers."""

import math
import struct
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import cantools.database
import numpy as np
from numpy.typing import NDArray

from fifthwheel.base.errors import FifthwheelError, SignalError
from fifthwheel.base.input_files import require_regular
from fifthwheel.data.logs.source import damage


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
_PLACEHOLDER = "VECTOR__INDEPENDENT_SIG_MSG"
_FORMATS = ("dbc", "arxml", "kcd", "sym")
_ENCODINGS = {"dbc": "cp1252", "sym": "cp1252"}


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
