"""Names of signals, quantity.unit[.part], and headers of columns; signals are in SI and ISO 8855 (y left, z up).

"yaw_rate.tractor" is the yaw rate of the unit named tractor in rad/s; "steer.tractor.front" is the road-wheel angle of
its front axle in rad. "time" and "speed" belong to the whole vehicle and have no unit name. A column header may add a
physical unit, "yaw_rate.tractor [deg/s]", and the prefix "reference." for signals that no estimator uses.
"""

import re
from difflib import get_close_matches

from fifthwheel.channels import CHANNELS, SignalName, channel_of
from fifthwheel.errors import SignalError
from fifthwheel.units import is_unit

REFERENCE = "reference."
"""Prefix of the header of a reference signal."""

_NAME = re.compile(r"[a-z][a-z0-9_]*(\.[A-Za-z0-9_-]+)*")


def si_unit(name: str) -> str | None:
    """SI unit of a signal: "yaw_rate.tractor" -> "rad/s"; None where the name is not that of a signal."""
    channel = channel_of(name)
    if channel is None or not _NAME.fullmatch(name) or (channel.of == "vehicle") != (not SignalName.of(name).unit):
        return None
    return channel.unit


def checked_name(name: str) -> str:
    """The name itself.

    Raises:
        SignalError: it is not the name of a signal; the message suggests one.
    """
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
            cure = "expected quantity.unit[.part], such as 'yaw_rate.tractor' or 'steer.tractor.front'"
        raise SignalError(f"{name}: not the name of a signal; {cure}")
    return name


def header(name: str) -> str:
    """Column header of a signal with its SI unit: "reference.roll.tractor" -> "reference.roll.tractor [rad]"."""
    return f"{name} [{si_unit(checked_name(name.removeprefix(REFERENCE)))}]"


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
