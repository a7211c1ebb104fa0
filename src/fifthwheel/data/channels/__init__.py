"""Channels: the quantities that signals have. Each is one object with all that the package knows of it.

Checks, filters, time bases, estimators, signal maps and pages iterate them. To add a quantity, write its `Channel` in
`table.py` and add it to `ALL` there; to `MEASURED` and `IDENTIFIED` if observers and identifications use it.
"""

import re
from collections.abc import Container, Iterable, Sequence
from dataclasses import replace
from difflib import get_close_matches
from functools import lru_cache
from typing import NamedTuple, Self

from fifthwheel.base.errors import SignalError
from fifthwheel.base.names import split_log
from fifthwheel.base.units import is_unit
from fifthwheel.data.channels.channel import Channel as Channel
from fifthwheel.data.channels.channel import ErrorKind, SensorModel, SignalLimits, StateNoise
from fifthwheel.data.channels.channel import SignalName as SignalName
from fifthwheel.data.channels.table import ALL
from fifthwheel.data.channels.table import ARTICULATION as ARTICULATION
from fifthwheel.data.channels.table import AXLE_LOAD as AXLE_LOAD
from fifthwheel.data.channels.table import BRAKING as BRAKING
from fifthwheel.data.channels.table import DRIVING as DRIVING
from fifthwheel.data.channels.table import ENGINE_SPEED as ENGINE_SPEED
from fifthwheel.data.channels.table import GRADE as GRADE
from fifthwheel.data.channels.table import GROSS_WEIGHT as GROSS_WEIGHT
from fifthwheel.data.channels.table import LATERAL_ACCELERATION as LATERAL_ACCELERATION
from fifthwheel.data.channels.table import LATERAL_VELOCITY as LATERAL_VELOCITY
from fifthwheel.data.channels.table import LOAD_TRANSFER as LOAD_TRANSFER
from fifthwheel.data.channels.table import PREDICTED_LOAD_TRANSFER as PREDICTED_LOAD_TRANSFER
from fifthwheel.data.channels.table import ROLL as ROLL
from fifthwheel.data.channels.table import ROLL_RATE as ROLL_RATE
from fifthwheel.data.channels.table import SIDESLIP as SIDESLIP
from fifthwheel.data.channels.table import SPEED as SPEED
from fifthwheel.data.channels.table import STEER as STEER
from fifthwheel.data.channels.table import WEIGHT as WEIGHT
from fifthwheel.data.channels.table import WEIGHTS as WEIGHTS
from fifthwheel.data.channels.table import WHEEL_SPEED as WHEEL_SPEED
from fifthwheel.data.channels.table import WHEEL_SPEED_DIFFERENCE as WHEEL_SPEED_DIFFERENCE
from fifthwheel.data.channels.table import YAW_RATE as YAW_RATE

CHANNELS: dict[str, Channel] = {channel.quantity: channel for channel in ALL}
"""By quantity; `register` adds to this and to the lists below."""
INPUTS = (SPEED, STEER)
"""Of the model, which needs them at every instant."""
MEASURED = [YAW_RATE, ARTICULATION, ROLL_RATE, ROLL, LATERAL_ACCELERATION, WHEEL_SPEED_DIFFERENCE]
"""Measurements that an observer compares with the model, in its order."""
IDENTIFIED = [YAW_RATE, ARTICULATION, ROLL_RATE, LATERAL_ACCELERATION, WHEEL_SPEED_DIFFERENCE]
"""Those that an identification compares with the model, in its order."""
USUAL = (YAW_RATE, ARTICULATION, ROLL_RATE)
"""Those of them that test trucks usually have, and that two stages use; one stage uses the others too."""
LEARNED = (*USUAL, WHEEL_SPEED_DIFFERENCE)
"""Those of them that a learner uses."""
MOTION = (YAW_RATE, ARTICULATION, LATERAL_ACCELERATION)
"""Those of which one, of any unit, is enough for an identification; roll rates alone are not."""
GYROS = (YAW_RATE, ROLL_RATE)
"""Those whose delay is the latency of a gyro."""
MODELLED = [channel for channel in ALL if channel.model and channel.of == "unit"]
"""What the model gives for a sensor on a unit."""
PLACE_KINDS = ("position", "height")
"""Errors of a sensor whose output depends on its place: where it is, absolute."""
REFERENCE = "reference."
"""Prefix of the header of a reference signal, which no estimator uses."""
_NAME = re.compile(r"[a-z][a-z0-9_]*(\.[A-Za-z0-9_-]+)*")
_ERROR_UNITS = {error.kind: error.unit for channel in ALL for error in channel.errors if error.unit}
_ERROR_KINDS = {error.kind for channel in ALL for error in channel.errors}


def register(channel: Channel) -> None:
    """Add a quantity of your own that observers and identifications compare with the model.

    It stays registered in this process; a later one of the same quantity replaces it. See docs/howto/extend.md.

    Args:
        channel: of a unit, with `limit`, `noise` and `model`, whose `value` returns an expression of CasADi; each of
            `errors` is an offset, a gain, with `rate` of the model a delay, or one of its `sensitivities`, and has a
            `prior`.

    Raises:
        SignalError: something is missing, or the quantity is one of fifthwheel.

    Example:
        >>> from fifthwheel.data.channels import register
        >>> from fifthwheel.data.channels.channel import Channel
        >>> try:
        ...     register(Channel(quantity="yaw_rate", unit="rad/s"))
        ... except ValueError as error:
        ...     print(error)
        yaw_rate: is a quantity of fifthwheel; give yours another name
    """
    quantity, model = channel.quantity, channel.model
    if any(quantity == own.quantity for own in ALL):
        raise SignalError(f"{quantity}: is a quantity of fifthwheel; give yours another name")
    if not _NAME.fullmatch(quantity) or "." in quantity:
        raise SignalError(f"quantity: expected small letters, digits and _, got {quantity!r}; correct it")
    if not is_unit(channel.unit):
        raise SignalError(f"{quantity}, unit: expected a unit in SI, got {channel.unit!r}; correct it")
    if channel.of != "unit" or model is None or model.has_place:
        raise SignalError(f"{quantity}, model: expected a value of a unit without parameters of a place; correct it")
    for field in ("limit", "noise"):
        if getattr(channel, field) is None:
            raise SignalError(f"{quantity}, {field}: expected a value, got none; add it")
    possible = ["offset", "gain", *["delay"] * bool(model.rate), *(_ERROR_UNITS.keys() & model.sensitivities)]
    for error in channel.errors:
        if error.kind not in possible:
            raise SignalError(f"{quantity}, errors: expected {' or '.join(possible)}, got {error.kind!r}; correct it")
        if error.prior < 0:
            raise SignalError(
                f"{quantity}, {error.kind}: expected a prior of 0 or more, got {error.prior}; give it in SI"
            )
    if (former := CHANNELS.get(quantity)) is not None:  # perhaps a state of own equations
        channel = replace(channel, state=channel.state or former.state)
    for listed in (MEASURED, IDENTIFIED, MODELLED):
        listed[:] = [*[other for other in listed if other.quantity != quantity], channel]
    CHANNELS[quantity] = channel


OWN_STATE = SensorModel(value=lambda now, _, name: now.own_state(name))
"""Of a state of a user's own equations."""


def register_state(name: str, unit: str, initial_sigma: float) -> None:
    """Make a state of a user's own equations a quantity, in this process. It has no process noise.

    Raises:
        SignalError: the name is not quantity.unit, or that of a quantity of fifthwheel or with another unit.
    """
    quantity, unit_name, _ = SignalName.of(name)
    if not _NAME.fullmatch(name) or not unit_name:
        raise SignalError(f"{name}: expected quantity.unit, such as 'actuator.semitrailer'; correct it")
    known = CHANNELS.get(quantity)
    if any(quantity == channel.quantity for channel in ALL):
        raise SignalError(f"{name}: {quantity} is another quantity; give yours another name")
    if known and known.unit != unit:
        cure = f"give it the unit {known.unit}, or another name"
        raise SignalError(f"{name}: {quantity} has the unit {known.unit} in this process, got {unit}; {cure}")
    noise = StateNoise(process=0.0, observer_process=0.0, initial_sigma=initial_sigma)
    if known is None or known.state != noise:
        channel = replace(known or Channel(quantity=quantity, unit=unit, model=OWN_STATE), state=noise)
        for listed in (MEASURED, IDENTIFIED, MODELLED):
            listed[:] = [channel if other is known else other for other in listed]
        CHANNELS[quantity] = channel


def own_channels(names: Iterable[str]) -> tuple[Channel, ...]:
    """The registered channels of some signals."""
    channels = {channel_of(name): None for name in names}
    return tuple(c for c in channels if c and c not in ALL and c.model is not OWN_STATE)


def channel_of(name: str) -> Channel | None:
    """The channel of a signal or of a state with this name; None for another name."""
    return CHANNELS.get(SignalName.of(name).quantity)


def limit_of(name: str) -> SignalLimits | None:
    """What a heavy vehicle can do in a signal's quantity; None where that is not known."""
    channel = channel_of(name)
    return channel.limit if channel else None


def is_of(name: str, *channels: Channel) -> bool:
    """Whether a signal is of one of the channels.

    >>> is_of("steer.tractor.front", SPEED, STEER)
    True
    """
    return channel_of(name) in channels


def names_of(channel: Channel, names: Iterable[str]) -> list[str]:
    """Those of the signals that are of a channel."""
    return [name for name in names if channel_of(name) is channel]


def missing_for_mass(signals: Iterable[str]) -> list[str]:
    """What the mass from driving (`gross_mass`) needs and these signals lack.

    >>> missing_for_mass(["speed", "engine_speed", "braking.tractor"])
    ['engine_torque']
    """
    names = set(signals)
    force = ("drive_force",) if "drive_force" in names else ("engine_speed", "engine_torque")
    missing = [name for name in ("speed", *force) if name not in names]
    return missing if names_of(BRAKING, names) else [*missing, "braking.tractor"]


def is_input(name: str) -> bool:
    """Whether a signal is an input of the model."""
    return is_of(name, *INPUTS)


def si_unit(name: str) -> str | None:
    """SI unit of a signal: "yaw_rate.tractor" -> "rad/s"; None where the name is not that of a signal."""
    channel = channel_of(name)
    if channel is None or not _NAME.fullmatch(name) or (channel.of == "vehicle") != (not SignalName.of(name).unit):
        return None
    return channel.unit


def checked_name(name: str) -> str:
    """The name itself; where it is not that of a signal, a SignalError suggests one."""
    if si_unit(name) is None:
        signal, channel = SignalName.of(name), channel_of(name)
        similar = get_close_matches(signal.quantity, CHANNELS, n=1)
        if channel and channel.of == "vehicle" and signal.unit:
            cure = f"it belongs to the whole vehicle; call it {signal.quantity!r}"
        elif channel and not signal.unit:
            cure = f"add the name of the unit, such as '{signal.quantity}.tractor'"
        elif similar:
            cure = f"did you mean {'.'.join([similar[0], signal.place]) if signal.unit else similar[0]!r}?"
        else:
            cure = "expected quantity.unit[.part], such as 'yaw_rate.tractor'; a quantity of yours: register it"
        raise SignalError(f"{name}: not the name of a signal; {cure}")
    return name


def header(name: str) -> str:
    """Column header of a signal with its SI unit: "reference.roll.tractor" -> "reference.roll.tractor [rad]"."""
    return f"{name} [{si_unit(checked_name(split_reference(name)[0]))}]"


def split_reference(name: str) -> tuple[str, bool]:
    """The name of a signal without the prefix of a reference signal, and whether it has this prefix."""
    signal = name.removeprefix(REFERENCE)
    return signal, signal != name


def split_header(text: str) -> tuple[str, str | None]:
    """Name and unit of a column header: "speed [km/h]", "speed (km/h)" -> ("speed", "km/h"); no brackets, no unit.

    The headers of dSPACE have "|" for "/" in the unit, "v_x_Vehicle_CoG[km|h]": it is replaced.
    """
    name, unit = text.replace("\n", " ").strip(), ""
    for opening, closing in ("[]", "()"):
        start = name.rfind(opening)
        last = name[start + 1 : -1]
        if start >= 0 and name.endswith(closing) and closing not in last and (closing == "]" or is_unit(last)):
            name, unit = name[:start].rstrip(), last
            break
    return name, unit.strip().replace("|", "/") or None


def measured_signals(
    logged: Container[str] | Iterable[str], units: Sequence[str], channels: Sequence[Channel] = IDENTIFIED
) -> tuple[str, ...]:
    """Those of the signals that are measurements on a vehicle with these units: by channel, then unit front to rear.

    A unit may have several sensors of a channel.
    """
    names = sorted(logged)  # type: ignore[arg-type]
    return tuple(
        name
        for channel in channels
        for i, unit in enumerate(units)
        for name in names_of(channel, names)
        if SignalName.of(name).unit == unit and (i or not (channel.model and channel.model.behind_coupling))
    )


class SensorErrorName(NamedTuple):
    """The signal and the kind of a sensor error.

    >>> SensorErrorName.of("steer.tractor.front.offset")
    SensorErrorName(signal='steer.tractor.front', kind='offset')
    """

    signal: str
    kind: str
    """As in `ErrorKind`."""

    @classmethod
    @lru_cache(maxsize=4096)
    def of(cls, name: str) -> Self | None:
        """Parse a name without its log; None where it does not name a sensor error."""
        error = cls.split(name)
        known = error.row is not None if error.kind in PLACE_KINDS else error.kind in _ERROR_KINDS
        return error if known else None

    @classmethod
    def split(cls, name: str) -> Self:
        """The parts of any text, whether or not a sensor can have such an error."""
        signal, _, kind = name.rpartition(".")
        return cls(signal, kind)

    @property
    def row(self) -> ErrorKind | None:
        """What its channel has on it; None where the channel has no such error."""
        channel = channel_of(self.signal)
        return channel.error(self.kind) if channel else None

    @property
    def unit(self) -> str | None:
        """SI unit of the error; None for the offset of an unknown quantity."""
        channel = channel_of(self.signal)
        return _ERROR_UNITS.get(self.kind) or (channel.unit if channel else None)


def is_sensor_error(name: str, kind: str | None = None) -> bool:
    """Whether a name, with or without its log, is that of a sensor error, of one kind if given.

    >>> is_sensor_error("steer.tractor.front.offset@bend"), is_sensor_error("steer.tractor.front.gain", "delay")
    (True, False)
    """
    error = SensorErrorName.of(split_log(name)[0])
    return error is not None and kind in (None, error.kind)


def channels_with_errors() -> tuple[Channel, ...]:
    """The channels of whose sensors one stage estimates errors."""
    return (*INPUTS, *IDENTIFIED)


def error_kinds(signal: str) -> tuple[str, ...]:
    """The kinds of errors of the sensor of a signal that one stage estimates; none where it does not use the signal.

    >>> error_kinds("yaw_rate.tractor")
    ('offset', 'gain', 'misalignment', 'delay')
    """
    channel = channel_of(signal)
    if channel is None or channel not in channels_with_errors():
        return ()
    return tuple(error.kind for error in channel.errors)
