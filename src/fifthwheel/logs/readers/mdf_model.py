"""Groups and channels of an MDF file, of version 3 and 4 alike, and where in a record each channel lies."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fifthwheel.logs.readers.mdf_data import BrokenError, Data

Array = NDArray[np.float64]
Bytes = NDArray[np.uint8]
Conversion = Callable[[Array], Array]

_MOST_WITHOUT_BYTES = 10_000_000


@dataclass(kw_only=True)
class Channel:
    """One channel, and where in a record it lies."""

    name: str
    unit: str | None = None
    about: str = ""
    kind: str = ""
    """Of number: "u", "i" or "f"; "" for what is none."""
    big: bool = False
    """Big endian."""
    bit: int = 0
    """Of the record, where it begins, counting each byte from its lowest bit."""
    bits: int = 0
    invalid: int | None = None
    """Bit behind the record that is set where it is not valid; -2 when it never is valid, None when always."""
    convert: Conversion | None = None
    """Raw to physical; None when they are the same."""
    virtual: bool = False
    """Has no bytes: its raw value is the number of the record."""
    lengths: "Data | int | None" = None
    """Of a value of any length: its bytes, each value after its length, or the identifier of the records with them."""
    trouble: str = ""
    """Why it cannot be read."""

    @property
    def numeric(self) -> bool:
        """Whether it is one number a sample, and can be read."""
        return (self.virtual or bool(self.kind)) and self.lengths is None and not self.trouble

    def fits(self, size: int) -> bool:
        """Whether it lies within a record of that many bytes, and is no wider than a number is."""
        shift = self.bit % 8
        return self.virtual or (self.bits > 0 and shift + self.bits <= 64 and self.bit + self.bits <= size * 8)

    def raw(self, rows: Bytes) -> NDArray[np.generic]:
        """Raw numbers (n,) of the records (n, bytes); BrokenError when they are too short for it."""
        first, shift = divmod(self.bit, 8)
        count = -(-(shift + self.bits) // 8)
        if self.bits <= 0 or count > 8 or first + count > rows.shape[1]:
            raise BrokenError(
                f"channel {self.name!r} has bits {self.bit} to {self.bit + self.bits} of {rows.shape[1]} bytes"
            )
        order = ">" if self.big else "<"
        part = rows[:, first : first + count]
        if shift == 0 and self.bits in (8, 16, 32, 64) and not (self.kind == "f" and self.bits == 8):
            plain: NDArray[np.generic] = np.ascontiguousarray(part).view(f"{order}{self.kind}{count}").ravel()
            return plain
        if self.kind == "f":
            raise BrokenError(f"channel {self.name!r} is a float of {self.bits} bits from bit {shift}")
        wide = np.zeros((rows.shape[0], 8), dtype=np.uint8)
        wide[:, 8 - count :] = part if self.big else part[:, ::-1]
        number = wide.view(">u8").ravel().astype(np.uint64) << np.uint64(64 - self.bits - shift)
        if self.kind == "i":
            return number.view(np.int64) >> np.int64(64 - self.bits)
        return number >> np.uint64(64 - self.bits)


@dataclass(kw_only=True, eq=False)
class Group:
    """Channels of one clock."""

    number: int
    label: str
    """What the file calls it; its number where it does not."""
    channels: list[Channel]
    time: Channel | None
    data: Data
    size: int
    """Bytes of a record that hold values."""
    invalid: int = 0
    """Bytes behind them that say which are not valid."""
    count: int | None = None
    """Records as announced; None when that was never filled in."""
    identifier: int | None = None
    """Of its records when those of several groups are mixed."""
    mix: "Mix | None" = None
    master: "Group | None" = None
    """Whose time it has, record by record, when not its own."""
    invalid_data: Data | None = None
    """Where the invalidation bytes lie when not behind each record."""
    frames: dict[str, Channel] = field(default_factory=dict)
    """Parts of the CAN frames in it by their names in the standard: ID, DataBytes and so on."""

    @property
    def timed(self) -> bool:
        """Whether it is known when its samples were taken."""
        return self.time is not None or (self.master is not None and self.master.time is not None)

    @property
    def width(self) -> int:
        return self.size + (0 if self.invalid_data is not None else self.invalid)

    @property
    def rows(self) -> int:
        """Records that are there, when they are not mixed with others."""
        there = self.data.size // self.width if self.width else _MOST_WITHOUT_BYTES
        return there if self.count is None else min(there, self.count)


@dataclass(kw_only=True, eq=False)
class Mix:
    """Records of several groups, each behind its identifier."""

    identifier_size: int
    """1, 2, 4 or 8 bytes."""
    sizes: dict[int, int]
    """Bytes of the records by identifier; -1 for those that begin with their own length."""
    after: bool = False
    """The identifier stands behind the record, too."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Rows:
    """Consecutive records of a group."""

    group: Group
    first: int
    """Number of the first."""
    records: Bytes
    """(n, width)"""
    invalid: Bytes | None = None
    """(n, invalid) bytes that say what is not valid; None when none is said to be."""
    lengths: Mapping[int, list[bytes]] = field(default_factory=dict)
    """Identifier of a channel of any length to its n values."""
    read: int = 0
    """Bytes read until here, of the group's data."""
