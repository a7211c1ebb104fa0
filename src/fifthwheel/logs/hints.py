"""What the name and the unit of a column say it may be."""

import re
from dataclasses import dataclass

from fifthwheel.errors import SignalError
from fifthwheel.logs.names import QUANTITIES
from fifthwheel.logs.units import factor

_NOT = (
    r"(^|_)(set|soll|target|demand|request|req|status|valid|qual|flag|counter|turn_counter|type|err|sigma|std|var|cov"
    r"|offset|relative)(_|$)"
)
_ANGULAR = r"(ang(ular)?|rotation)_?(vel|velocity|rate)"
_RULES: tuple[tuple[str, str], ...] = (
    ("axle_load", r"axle_(weight|load)|achslast"),
    ("wheel_speed", r"(wheel|whl|axle)_?(speed|spd)|rad_?(drehzahl|geschw)|v_rad"),
    ("speed", r"vehicle_speed|veh_?spd|(^|_)(speed|velocity|spd|geschwindigkeit)$|(^|_)v_?(x|ist|fzg|veh|ego|long)?$"),
    ("speed", r"long(itudinal)?_vel|gps_(speed|vel)|ground_speed|tacho"),
    ("steer_rate", r"(steer|lenk|swa).*(rate|geschw|vel|speed)"),
    ("steer", r"steer|lenk|(^|_)(swa|sas|lws|lwi|delta)(_|$)|hand_?wheel"),
    ("articulation_rate", r"(articulat|hitch|knick).*(rate|vel|geschw)"),
    ("articulation", r"articulat|hitch|knick|coupling_angle|(^|_)gamma(_|$)"),
    ("yaw_acceleration", r"yaw_?acc|gier_?beschl"),
    ("yaw_rate", r"yaw_?(rate|vel)|gier_?(rate|geschw|winkelgeschw)|psi_?(p|dot)(_|$)"),
    ("yaw_rate", rf"gyro_?z|(^|_)(gz|wz|omega_?z)(_|$)|{_ANGULAR}_?z"),
    ("roll_rate", r"roll_?(rate|vel)|wank_?(rate|geschw|winkelgeschw)|phi_?(p|dot)(_|$)"),
    ("roll_rate", rf"gyro_?x|(^|_)(gx|wx|omega_?x)(_|$)|{_ANGULAR}_?x"),
    ("pitch_rate", rf"pitch_?(rate|vel)|nick_?(rate|geschw)|gyro_?y|(^|_)(gy|wy|omega_?y)(_|$)|{_ANGULAR}_?y"),
    ("lateral_acceleration", r"lat(eral)?_?acc|acc(el|eleration)?_?y|(^|_)a_?y(_|\d|$)|quer_?beschl"),
    ("longitudinal_acceleration", r"long(itudinal)?_?acc|acc(el|eleration)?_?x|(^|_)a_?x(_|\d|$)|laengs_?beschl"),
    ("vertical_acceleration", r"vert(ical)?_?acc|acc(el|eleration)?_?z|(^|_)a_?z(_|\d|$)"),
    ("lateral_velocity", r"lat(eral)?_?vel|(^|_)v_?y(_|$)|velocity_y|quer_?geschw"),
    ("sideslip", r"side_?slip|slip_?angle|schwimm|(^|_)beta(_|$)"),
    ("roll", r"(^|_)roll(_?angle)?(_|$)|wank_?winkel|(^|_)phi(_|$)"),
    ("pitch", r"(^|_)pitch(_?angle)?(_|$)|nick_?winkel|(^|_)theta(_|$)"),
    ("yaw", r"(^|_)(yaw|heading|psi)(_?angle)?(_|$)|gier_?winkel"),
    ("yaw_rate", r"(^|_)(yaw|gier)(_|$)"),
    ("roll_rate", r"(^|_)(roll|wank)(_|$)"),
)
"""Quantity and the names it goes by, in English and German, the more special first."""

_ENDINGS = {
    **dict.fromkeys(("km_h", "kmh", "kph"), "km/h"),
    **dict.fromkeys(("m_s2", "ms2", "mps2", "m_s_2"), "m/s^2"),
    **dict.fromkeys(("deg_s", "degs", "degps", "dps", "deg_per_s"), "deg/s"),
    **dict.fromkeys(("rad_s", "rads", "radps", "rad_per_s"), "rad/s"),
    **dict.fromkeys(("m_s", "mps"), "m/s"),
    **dict.fromkeys(("deg", "grad"), "deg"),
    "mph": "mph",
    "rad": "rad",
}
"""Units as names end with them."""

_TRAILING = re.compile(r"trailer|semi|(^|_)(trl|anh|auflieger|sattelanh\w*|st|towed|rear_unit)(_|$)|(ebs|rge)2\d")
_LEADING = re.compile(r"tractor|truck|zugm|motor_?wagen|towing|(^|_)(trk|szm|cab|chassis|front_unit)(_|$)")
_SECOND, _FIRST = re.compile(r"[a-z]_?2(_|$)"), re.compile(r"[a-z]_?1(_|$)")
_WHEEL = re.compile(r"wheel|(^|_)(swa|sas|lws|lwi)(_|$)|lenkrad|hand|column")
_ROAD = re.compile(r"road|(^|_)delta(_|$)|rad_?einschlag|front_wheel|vorderrad")


@dataclass(frozen=True, kw_only=True)
class Hint:
    """What a column may be."""

    column: str
    quantity: str
    trailing: bool | None
    """Whether it is of a towed unit; None where the name does not say."""
    steering_wheel: bool = False
    """Whether it is the driver's angle rather than that of the road wheels."""
    unit: str | None = None
    """That its name ends with, such as km/h of v_kmh."""
    side: str = ""
    """For a wheel or axle: "front.left", "rear"."""


def hint(column: str, unit: str | None) -> Hint | None:
    """What a column may be by its name, in English or German, and its unit; None for what is nothing of ours."""
    name, _, source = column.partition("@")
    words, told = named_unit(name)
    unit = unit or told
    if re.search(_NOT, words):
        return None
    for quantity, pattern in _RULES:
        if re.search(pattern, words) and _fits(unit, quantity):
            return Hint(
                column=column,
                quantity=quantity,
                trailing=_trailing(f"{words}_{plain(source)}", named_unit(name.rpartition(".")[2])[0]),
                unit=told,
                steering_wheel=quantity == "steer" and bool(_WHEEL.search(words)) and not _ROAD.search(words),
                side=".".join(side for side in ("front", "rear", "left", "right") if side in words.split("_")),
            )
    return None


def _trailing(words: str, last: str) -> bool | None:
    """Whether a name is of a towed unit; a number counts only in the last part, as messages have some of their own."""
    if _TRAILING.search(words) or _SECOND.search(last):
        return True
    return False if _LEADING.search(words) or _FIRST.search(last) else None


def named_unit(name: str) -> tuple[str, str | None]:
    """A name in plain words without the unit that it ends with, and that unit: "v_kmh" -> ("v", "km/h")."""
    words = plain(name)
    for ending, unit in _ENDINGS.items():
        if words.endswith(f"_{ending}"):
            return words.removesuffix(f"_{ending}"), unit
    return words, None


def plain(name: str) -> str:
    """A name in small letters with one underscore between its words: "YawRate-Lkw" -> "yaw_rate_lkw"."""
    for letter, ours in (("ä", "ae"), ("ö", "oe"), ("ü", "ue"), ("Ä", "Ae"), ("Ö", "Oe"), ("Ü", "Ue"), ("ß", "ss")):
        name = name.replace(letter, ours)
    name = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name)
    return re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")


def _fits(unit: str | None, quantity: str) -> bool:
    if unit is None or unit.strip() in ("", "-", "1"):
        return True
    try:
        factor(unit, QUANTITIES[quantity])
    except SignalError:
        return False
    return True
