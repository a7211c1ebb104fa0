"""Names of signals, quantity.unit[.axle], and headers of columns; signals are in SI and ISO 8855 (y left, z up).

"yaw_rate.tractor" is the yaw rate of the unit named tractor in rad/s; "steer.tractor.front" is the road-wheel angle of
its front axle in rad. "time" and "speed" belong to the whole vehicle and have no unit name. A column header may add a
physical unit, "yaw_rate.tractor [deg/s]", and the prefix "reference." for signals that no estimator uses.
"""

import re
from difflib import get_close_matches

from fifthwheel.errors import SignalError
from fifthwheel.names import SignalName
from fifthwheel.units import is_unit

REFERENCE = "reference."
"""Prefix of the header of a reference signal."""

QUANTITIES: dict[str, str] = {
    "time": "s",
    "speed": "m/s",
    "longitudinal_velocity": "m/s",
    "lateral_velocity": "m/s",
    "longitudinal_acceleration": "m/s^2",
    "lateral_acceleration": "m/s^2",
    "vertical_acceleration": "m/s^2",
    "steer": "rad",
    "steer_rate": "rad/s",
    "yaw": "rad",
    "yaw_rate": "rad/s",
    "yaw_acceleration": "rad/s^2",
    "roll": "rad",
    "roll_rate": "rad/s",
    "roll_acceleration": "rad/s^2",
    "pitch": "rad",
    "pitch_rate": "rad/s",
    "articulation": "rad",
    "articulation_rate": "rad/s",
    "sideslip": "rad",
    "sideslip_rate": "rad/s",
    "slip_angle": "rad",
    "longitudinal_force": "N",
    "lateral_force": "N",
    "vertical_force": "N",
    "coupling_force": "N",
    "load_transfer": "1",
    "predicted_load_transfer": "1",
    "position_x": "m",
    "position_y": "m",
    "curvature": "1/m",
    "wheel_speed": "m/s",
    "axle_load": "N",
    "bank": "rad",
}
"""Every quantity of a signal, with its SI unit."""
_WHOLE_VEHICLE = ("time", "speed")
"""Quantities without a unit name."""

_NAME = re.compile(r"[a-z][a-z0-9_]*(\.[A-Za-z0-9_-]+)*")


def si_unit(name: str) -> str | None:
    """SI unit of a signal: "yaw_rate.tractor" -> "rad/s"; None where the name is not that of a signal."""
    quantity, unit, _ = SignalName.of(name)
    if not _NAME.fullmatch(name) or (quantity in _WHOLE_VEHICLE) != (not unit):
        return None
    return QUANTITIES.get(quantity)


def checked_name(name: str) -> str:
    """The name itself.

    Raises:
        SignalError: it is not the name of a signal; the message suggests one.
    """
    if si_unit(name) is None:
        signal = SignalName.of(name)
        similar = get_close_matches(signal.quantity, QUANTITIES, n=1)
        if signal.quantity in _WHOLE_VEHICLE and signal.unit:
            cure = f"it belongs to the whole vehicle; call it {signal.quantity!r}"
        elif signal.quantity in QUANTITIES and not signal.unit:
            cure = f"add the name of the unit, such as '{signal.quantity}.tractor'"
        elif similar:
            cure = f"did you mean {'.'.join([similar[0], signal.place]) if signal.unit else similar[0]!r}?"
        else:
            cure = "expected quantity.unit[.axle], such as 'yaw_rate.tractor' or 'steer.tractor.front'"
        raise SignalError(f"{name}: not the name of a signal; {cure}")
    return name


def is_input(name: str) -> bool:
    """Whether a signal is an input of the vehicle model (speed, steer), needed at every instant."""
    return SignalName.of(name).quantity in ("speed", "steer")


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
