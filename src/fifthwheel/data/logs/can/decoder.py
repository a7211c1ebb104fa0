"""Frames of a bus as they arrive: the values of the columns that a signal map names."""

from collections.abc import Iterable
from enum import Enum
from typing import NamedTuple

from fifthwheel.base.errors import SignalError, suggestion
from fifthwheel.base.names import split_source
from fifthwheel.data.channels import split_header
from fifthwheel.data.logs.can.database import CanSignal, Databases, group


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
