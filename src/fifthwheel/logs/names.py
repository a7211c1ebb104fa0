"""Names of signals: quantity.unit[.axle], always in SI and ISO 8855 (x forward, y left, z up).

"yaw_rate.tractor" is the yaw rate of the unit named tractor in rad/s; "steer.tractor.front" the road-wheel angle of
its front axle in rad. Two quantities belong to the whole vehicle and stand alone: "time" and "speed". A file's header
may add the unit it is written in, "yaw_rate.tractor [deg/s]", and "reference." in front of what an estimator must
never see.
"""

import re
from difflib import get_close_matches

from fifthwheel.errors import SignalError
from fifthwheel.logs.units import is_unit

REFERENCE = "reference."

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
    "position_x": "m",
    "position_y": "m",
    "curvature": "1/m",
    "wheel_speed": "m/s",
    "axle_load": "N",
    "bank": "rad",
}
"""Every quantity a signal can be, with its SI unit."""

_NAME = re.compile(r"[a-z][a-z0-9_]*(\.[A-Za-z0-9_-]+)*")
_HEADER = re.compile(r"\s*(?P<name>.*?)\s*(\[(?P<unit>[^\[\]]*)\])?\s*")
_ROUND = re.compile(r"(?P<name>.*?)\s*\((?P<unit>[^()]+)\)")


def si_unit(name: str) -> str | None:
    """SI unit of a signal by its quantity ("yaw_rate.tractor" -> "rad/s"); None when the name follows no convention."""
    quantity, _, place = name.partition(".")
    if not _NAME.fullmatch(name) or (quantity in ("time", "speed")) != (not place):
        return None
    return QUANTITIES.get(quantity)


def known(name: str) -> str:
    """The name itself when it follows the convention, otherwise a SignalError that says what might be meant."""
    if si_unit(name) is None:
        quantity, _, place = name.partition(".")
        meant = get_close_matches(quantity, QUANTITIES, n=1)
        if quantity in ("time", "speed") and place:
            cure = f"it belongs to the whole vehicle and is called {quantity!r}"
        elif quantity in QUANTITIES and not place:
            cure = f"say of which unit, such as '{quantity}.tractor'"
        elif meant:
            cure = f"did you mean {'.'.join([meant[0], place]) if place else meant[0]!r}?"
        else:
            cure = "expected quantity.unit[.axle], such as 'yaw_rate.tractor' or 'steer.tractor.front'"
        raise SignalError(f"{name}: not the name of a signal; {cure}")
    return name


def is_input(name: str) -> bool:
    """Whether a signal drives the vehicle (speed, steer) and so is needed at every instant; others are measurements."""
    return name == "speed" or name.startswith("steer.")


def header(name: str) -> str:
    """Column header of a signal with its SI unit: "reference.roll.tractor" -> "reference.roll.tractor [rad]"."""
    return f"{name} [{si_unit(known(name.removeprefix(REFERENCE)))}]"


def split_header(text: str) -> tuple[str, str | None]:
    """Name and unit of a column header: "speed [km/h]", "speed (km/h)" -> ("speed", "km/h"); no brackets, no unit."""
    match = _HEADER.fullmatch(text.replace("\n", " "))
    if match is None:  # cannot be: every part of the pattern may be empty
        return text, None
    if match["unit"] is None and (round_ := _ROUND.fullmatch(match["name"])) and is_unit(round_["unit"]):
        return round_["name"], round_["unit"].strip()
    return match["name"], (match["unit"] or "").strip() or None


def suggest(name: str, among: list[str]) -> str:
    """A sentence's end for an unknown name: the close ones, or all of them."""
    close = get_close_matches(name, among, n=3, cutoff=0.5)
    return f"did you mean {' or '.join(map(repr, close))}?" if close else f"there is {', '.join(among) or 'none'}"
