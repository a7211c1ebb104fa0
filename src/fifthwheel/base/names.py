"""Structured names: parameters of a vehicle, unknowns of one log, measures, columns of a log; signals: `channels`.

parameter      unit[.component...].quantity  semitrailer.payload.height, tractor.front.cornering_stiffness
of one log     name@log                      steer.tractor.front.offset@bend
of a problem   name[@log[.segment]]          steer.tractor.front.offset@0, yaw_rate.tractor@0.2
measure        kind[.subject]                response_time.yaw_rate.tractor
column         name[@source]                 VDC2.yaw_rate@0B
"""

from functools import lru_cache
from typing import NamedTuple, Self

PAYLOAD_HEIGHT = "payload.height"
"""End of the path of a payload's height."""


class ParameterPath(NamedTuple):
    """The parts of a parameter's path.

    >>> ParameterPath.of("semitrailer.payload.height")
    ParameterPath(unit='semitrailer', component='payload', quantity='height')
    """

    unit: str  # unit or coupling
    component: str  # axle group, axle, "sprung" or "payload"; empty where the path has none
    quantity: str

    @classmethod
    @lru_cache(maxsize=4096)
    def of(cls, path: str) -> Self:
        """Parse a path; any text is accepted."""
        unit, _, rest = path.partition(".")
        component, _, quantity = rest.rpartition(".")
        return cls(unit, component, quantity)

    @property
    def owner(self) -> str:
        """What has the quantity: "semitrailer.payload"."""
        return f"{self.unit}.{self.component}" if self.component else self.unit

    @property
    def last_word(self) -> str:
        """The quantity, or the whole path if it is one word."""
        return self.quantity or self.unit


class NumberedName(NamedTuple):
    """The parts of the name of an unknown in a problem, with the numbers of its log and of a segment of the log."""

    base: str
    log: int | None = None  # None for an unknown that all logs share
    segment: int | None = None  # only of an initial state

    @classmethod
    def of(cls, name: str) -> Self:
        """Parse a name."""
        base, log = split_log(name)
        return cls(base, *map(int, log.split("."))) if log else cls(base)

    def of_log(self, log: str | int) -> str:
        """The name with another number of its log, or with the name of the log: "yaw_rate.tractor@bend.2"."""
        segment = "" if self.segment is None else f".{self.segment}"
        return self.base if self.log is None else f"{self.base}@{log}{segment}"


def split_log(name: str) -> tuple[str, str | None]:
    """A name without its log, and the log; None for a name that all logs share.

    >>> split_log("steer.tractor.front.offset@bend")
    ('steer.tractor.front.offset', 'bend')
    """
    base, at, log = name.partition("@")
    return base, log if at else None


def split_kind(name: str) -> tuple[str, str]:
    """Kind and subject of a measure or of a column of a diagram; the subject is empty where the name has none."""
    kind, _, subject = name.partition(".")
    return kind, subject


def split_source(column: str) -> tuple[str, str]:
    """Name and source of a log's column; the source is empty where the name has none.

    >>> split_source("VDC2.yaw_rate@0B"), split_source("vx")
    (('VDC2.yaw_rate', '0B'), ('vx', ''))
    """
    name, _, source = column.partition("@")
    return name, source


def ends_with(path: str, key: str) -> bool:
    """Whether `key` is the path or the end of it, in whole words.

    >>> ends_with("tractor.front.roll_stiffness", "roll_stiffness")
    True
    >>> ends_with("tractor.front.tyre_roll_stiffness", "roll_stiffness")
    False
    """
    return path == key or path.endswith(f".{key}")


def begins_with(path: str, key: str) -> bool:
    """Whether `key` is the path or the beginning of it, in whole words."""
    return path == key or path.startswith(f"{key}.")
