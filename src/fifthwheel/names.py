"""Structured names: parameters of a vehicle, unknowns of one log, and columns of a log; signals: `channels`.

parameter      unit[.component...].quantity  semitrailer.payload.height, tractor.front.cornering_stiffness
of one log     name@log                      steer.tractor.front.offset@bend
column         name[@source]                 VDC2.yaw_rate@0B
"""

from functools import lru_cache
from typing import NamedTuple, Self


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


def split_log(name: str) -> tuple[str, str | None]:
    """A name without its log, and the log; None for a name that all logs share.

    >>> split_log("steer.tractor.front.offset@bend")
    ('steer.tractor.front.offset', 'bend')
    """
    base, at, log = name.partition("@")
    return base, log if at else None


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
