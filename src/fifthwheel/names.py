"""Structured names: signals, parameters of a vehicle, sensor errors, unknowns of one log, and columns of a log.

    signal         quantity.unit[.axle]          yaw_rate.tractor, steer.tractor.front, speed
    parameter      unit[.component...].quantity  semitrailer.payload.height, tractor.front.cornering_stiffness
    sensor error   signal.kind                   steer.tractor.front.offset, yaw_rate.tractor.gain
    of one log     name@log                      steer.tractor.front.offset@bend
    column         name[@source]                 VDC2.yaw_rate@0B

All modules parse names here. A result is cached, so parsing is cheap.
"""

from functools import lru_cache
from typing import NamedTuple, Self

SENSOR_ERROR_KINDS = ("offset", "gain", "delay", "misalignment", "play")
ACCELEROMETER = "lateral_acceleration"
PLACE_KINDS = ("position", "height")
"""Errors of an accelerometer only: where it is, absolute."""
STEER_ERROR_KINDS = ("offset", "gain", "delay")


class SignalName(NamedTuple):
    """The parts of a signal's name.

    >>> SignalName.of("steer.tractor.front")
    SignalName(quantity='steer', unit='tractor', axle='front')
    """

    quantity: str
    unit: str
    """Empty for a signal of the whole vehicle, such as speed."""
    axle: str
    """Empty where the name has no axle; may hold several words, such as "front.left"."""

    @classmethod
    @lru_cache(maxsize=4096)
    def of(cls, name: str) -> Self:
        """Parse a name; any text is accepted."""
        quantity, _, place = name.partition(".")
        unit, _, axle = place.partition(".")
        return cls(quantity, unit, axle)

    @property
    def place(self) -> str:
        """Unit and axle: "tractor.front"."""
        return f"{self.unit}.{self.axle}" if self.axle else self.unit


class ParameterPath(NamedTuple):
    """The parts of a parameter's path.

    >>> ParameterPath.of("semitrailer.payload.height")
    ParameterPath(unit='semitrailer', component='payload', quantity='height')
    """

    unit: str
    """Unit or coupling."""
    component: str
    """Axle group, axle, "sprung" or "payload"; empty where the path has none."""
    quantity: str

    @classmethod
    @lru_cache(maxsize=4096)
    def of(cls, path: str) -> Self:
        """Parse a path; any text is accepted."""
        unit, _, rest = path.partition(".")
        component, _, quantity = rest.rpartition(".")
        return cls(unit, component, quantity)

    @property
    def is_payload_height(self) -> bool:
        """Whether the path names a payload height, whose prior is in metres and not relative."""
        return (self.component, self.quantity) == ("payload", "height")


class SensorErrorName(NamedTuple):
    """The signal and the kind of a sensor error.

    >>> SensorErrorName.of("steer.tractor.front.offset")
    SensorErrorName(signal='steer.tractor.front', kind='offset')
    """

    signal: str
    kind: str
    """One of `SENSOR_ERROR_KINDS`; of an accelerometer also one of `PLACE_KINDS`."""

    @classmethod
    @lru_cache(maxsize=4096)
    def of(cls, name: str) -> Self | None:
        """Parse a name without its log; None where it does not name a sensor error."""
        signal, _, kind = name.rpartition(".")
        is_place = kind in PLACE_KINDS and SignalName.of(signal).quantity == ACCELEROMETER
        return cls(signal, kind) if kind in SENSOR_ERROR_KINDS or is_place else None


def is_sensor_error(name: str, kind: str | None = None) -> bool:
    """Whether a name, with or without its log, is that of a sensor error, of one kind if given.

    >>> is_sensor_error("steer.tractor.front.offset@bend"), is_sensor_error("steer.tractor.front.gain", "delay")
    (True, False)
    """
    error = SensorErrorName.of(split_log(name)[0])
    return error is not None and kind in (None, error.kind)


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
