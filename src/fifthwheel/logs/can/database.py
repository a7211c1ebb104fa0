"""Databases of CAN messages: those the user gives, then J1939; which message a frame is."""

import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fifthwheel.errors import SignalError
from fifthwheel.logs.can.bits import Bits

_PLACEHOLDER = "VECTOR__INDEPENDENT_SIG_MSG"
_FORMATS = ("dbc", "arxml", "kcd", "sym")
_ENCODINGS = {"dbc": "cp1252", "sym": "cp1252"}


@dataclass(frozen=True, kw_only=True)
class Signal:
    """One signal of a message."""

    name: str
    bits: Bits
    scale: float
    offset: float
    unit: str | None
    about: str
    gates: tuple[tuple[str, Bits, frozenset[int]], ...] = ()
    """Present in frames where each of these multiplexers, by name, has one of these values."""
    highest: int | None = None
    """Raw values above it mean an error or no value; None where all are values."""

    def present(self, data: NDArray[np.uint8], length: NDArray[np.int32]) -> NDArray[np.bool_]:
        """(n,) whether payloads (n, width) of these lengths (n,) hold it, by their multiplexers."""
        there = np.ones(len(data), np.bool_)
        for _, bits, values in self.gates:
            there &= bits.there(length) & np.isin(bits.raw(data), np.array(sorted(values)))
        return there

    def values(self, data: NDArray[np.uint8], length: NDArray[np.int32]) -> NDArray[np.float64]:
        """(n,) in its unit, NaN where the payload is too short or its value means none."""
        raw = self.bits.raw(data)
        good = self.bits.there(length)
        if self.highest is not None:
            good &= raw <= self.highest
        with np.errstate(all="ignore"):  # floating signals may be anything
            values = raw.astype(np.float64) * self.scale + self.offset
        return np.where(good & np.isfinite(values), values, np.nan)


@dataclass(frozen=True, kw_only=True, eq=False)
class Message:
    """One message of a database."""

    name: str
    extended: bool
    signals: tuple[Signal, ...]
    about: str
    source: str
    """Name of the file that defines it."""


class Databases:
    """Some databases in the order in which they are asked."""

    def __init__(self, tables: Iterable[Sequence[tuple[int, bool, Message]]]) -> None:
        self._exact: dict[tuple[int, bool], Message] = {}
        self._groups: dict[int, Message] = {}
        for table in tables:
            for number, extended, message in table:
                self._exact.setdefault((number, extended), message)
                if extended:
                    self._groups.setdefault(group(number), message)

    def message(self, number: int, extended: bool) -> Message | None:
        """What a frame with this id is: by the id, else, with 29 bits, by its parameter group from whatever source."""
        exact = self._exact.get((number, extended))
        if exact is None and extended:
            return self._groups.get(group(number))
        return exact


def group(number: int) -> int:
    """J1939 parameter group number of a 29-bit id: neither priority, source nor destination address are in it."""
    return number >> 8 & (0x3FFFF if number >> 16 & 0xFF >= 240 else 0x3FF00)


def load(paths: Sequence[str | Path]) -> Databases:
    """The databases in some files, DBC, ARXML, KCD or SYM, and then J1939.

    Raises SignalError for a file that cannot be read or is no database of CAN messages, ImportError without cantools.
    """
    import cantools.database  # noqa: F401  before a missing one is taken for a damaged file

    tables = [_file(Path(path)) for path in paths]
    text = files("fifthwheel.logs.can").joinpath("j1939.dbc").read_text("utf-8")
    return Databases([*tables, _table(_parse(text, "dbc"), "J1939", ours=True)])


def _file(path: Path) -> list[tuple[int, bool, Message]]:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise SignalError(f"{path}: the database cannot be read ({error.strerror}); check the path") from error
    kind = path.suffix[1:].lower()
    kinds = (kind,) if kind in _FORMATS else _FORMATS
    reasons = []
    for kind in kinds:
        try:
            found = _parse(data.decode(_ENCODINGS.get(kind, "utf-8"), "replace").removeprefix("\ufeff"), kind)
            table = _table(found, path.name, ours=False)
        except (KeyboardInterrupt, MemoryError):
            raise
        except Exception as error:  # whatever cantools meets in a file that is none
            reasons.append(" ".join(str(error).split())[:200] or type(error).__name__)
            continue
        if table:
            return table
        reasons.append("it defines no message")
    raise SignalError(f"{path.name}: no database of CAN messages ({reasons[0]}); give a DBC or ARXML file")


def _parse(text: str, kind: str) -> Any:
    from cantools.database import load_string

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return load_string(text, kind, strict=False)


def _table(database: Any, source: str, *, ours: bool) -> list[tuple[int, bool, Message]]:
    """Id, whether it has 29 bits, and message, of all messages of a cantools database."""
    return [
        (message.frame_id, bool(message.is_extended_frame), _message(message, source, ours=ours))
        for message in database.messages
        if message.signals and message.name != _PLACEHOLDER
    ]


def _message(message: Any, source: str, *, ours: bool) -> Message:
    by_name = {signal.name: signal for signal in message.signals}
    return Message(
        name=message.name,
        extended=bool(message.is_extended_frame),
        signals=tuple(
            Signal(
                name=signal.name,
                bits=_bits(signal),
                scale=float(signal.scale),
                offset=float(signal.offset),
                unit=str(signal.unit) if signal.unit else None,
                about=" ".join(str(signal.comment or message.comment or "").split()),
                gates=_gates(signal, by_name),
                highest=_highest(signal, message, ours=ours),
            )
            for signal in message.signals
        ),
        about=" ".join(str(message.comment or "").split()),
        source=source,
    )


def _bits(signal: Any) -> Bits:
    return Bits(
        start=signal.start,
        length=signal.length,
        little=signal.byte_order == "little_endian",
        signed=bool(signal.is_signed),
        floating=bool(signal.is_float),
    )


def _gates(signal: Any, by_name: dict[str, Any]) -> tuple[tuple[str, Bits, frozenset[int]], ...]:
    """The multiplexers of a signal, from the outermost."""
    gates: list[tuple[str, Bits, frozenset[int]]] = []
    while signal.multiplexer_ids and signal.multiplexer_signal in by_name and len(gates) < len(by_name):
        parent = by_name[signal.multiplexer_signal]
        gates.insert(0, (parent.name, _bits(parent), frozenset(signal.multiplexer_ids)))
        signal = parent
    return tuple(gates)


def _highest(signal: Any, message: Any, *, ours: bool) -> int | None:
    """The largest raw value that J1939 lets a value have: above it are error, not available and reserved codes.

    Of a user's database it holds for 29-bit messages and fields as J1939 has them, whole bytes or two bits; unless the
    database says a range that goes beyond and does not say that the message is J1939.
    """
    if not message.is_extended_frame or signal.is_signed or signal.is_float or signal.length == 1:
        return None
    aligned = signal.start % 8 == (0 if signal.byte_order == "little_endian" else 7)
    highest: int
    if aligned and signal.length in (8, 16, 24, 32):
        highest = (0xFB << (signal.length - 8)) - 1
    elif signal.length == 2:
        highest = 1
    elif ours:
        return (1 << int(signal.length)) - 2
    else:
        return None
    if ours or message.protocol == "j1939" or signal.maximum is None or not signal.scale:
        return highest
    return highest if abs(signal.maximum - signal.offset) <= abs(signal.scale) * (highest + 0.5) else None
