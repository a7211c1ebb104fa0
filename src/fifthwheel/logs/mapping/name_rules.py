"""Rules for names of channels: the quantity, unit and place that the name and the unit of a column indicate."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from fifthwheel.errors import UnitError
from fifthwheel.names import split_source
from fifthwheel.record.signal_names import QUANTITIES
from fifthwheel.units import factor

SIGNAL_QUANTITIES = (
    *("speed", "steer", "yaw_rate", "roll_rate", "articulation", "lateral_acceleration"),
    *("wheel_speed", "roll", "axle_load"),
)
"""Quantities that a proposal maps to signals."""
REFERENCE_QUANTITIES = ("sideslip", "lateral_velocity")
"""Quantities that a proposal maps to reference signals."""


@dataclass(frozen=True, kw_only=True)
class ColumnHint:
    """What the name and the unit of a column indicate."""

    column: str
    quantity: str
    trailing: bool | None
    """Whether it belongs to a towed unit; None where the name does not say."""
    steering_wheel: bool = False
    """Whether it is the steering-wheel angle and not the road-wheel angle."""
    unit: str | None = None
    """The unit at the end of the name: km/h of v_kmh."""
    side: str = ""
    """Place of a wheel or axle: "front.left", "rear"."""
    words: str = ""
    """Words of the name and its source, with "_" before, between and after them."""
    number: int | None = None
    """The unit's number in the name, from 1."""

    def signal(self, units: Sequence[str]) -> str | None:
        """The signal of a vehicle with these units, front to rear; None where a proposal does not use the quantity."""
        if self.quantity not in (*SIGNAL_QUANTITIES, *REFERENCE_QUANTITIES):
            return None
        if self.quantity == "speed":
            return "speed"
        unit = self._unit(units)
        if self.quantity == "steer":
            return f"steer.{unit}.front" if unit == units[0] else f"steer.{unit}"
        if self.quantity in ("wheel_speed", "axle_load") and self.side:
            return f"{self.quantity}.{unit}.{self.side}"
        return f"{self.quantity}.{unit}"

    def _unit(self, units: Sequence[str]) -> str:
        """The unit that the name contains, else the one with its number, else the last one for a towed unit."""
        is_articulation = self.quantity == "articulation" and len(units) > 1
        named = [unit for unit in units[is_articulation:] if f"_{unit}_" in self.words]
        if len(named) == 1:
            return named[0]
        if len(units) > 2 and self.number and self.number <= len(units) and not is_articulation:
            return units[self.number - 1]
        return units[-1] if self.trailing or is_articulation else units[0]


# Patterns are searched in names of small letters with "_" before, between and after the words: "_yaw_rate_lkw_".
_NEVER = re.compile(
    "_(set|soll|target|demand|request|req|command|cmd|desired|limit|max|min|status|valid|validity|qual|quality|qbit|flag"
    "|counter|cnt|crc|checksum|type|error|err|fault|sigma|std|stddev|stdev|variance|var|cov|conf|accuracy|latency|age"
    "|offset|bias|relative|rel|rlative|inc|trig|trigger|pedal|ped|fraction|temp|temperature|torque|trq|moment|force"
    "|pressure|power|voltage|fluid|vz|enable|enabled|active|mode|switch|button|lamp|warning|available)_|_current_$"
)
"""Words of other channels: set values, states, accuracies, signs, forces."""
_RATE = "(ang[a-z]*|rotation[a-z]*)_?(vel[a-z]*|rate)"
_ACC = "acc(el|eleration)?(_hor|_body)?"
_VEL = "_vel[a-z]*(_hor|_body)?"
_RULES: tuple[tuple[str, str, str], ...] = (
    ("axle_load", "axle_(weight|load)|achslast", ""),
    ("wheel_speed", "(wheel|whl|axle)_?(speed|spd)|rad_?geschw|_v_rad|_spd_fa_", "steer|lenk|_ang|_rot"),
    (
        "speed",
        "(vehicle|_veh|_car|ground|gps|gnss)_?(speed|spd|vel)|_(speed|velocity|spd|vel|geschwindigkeit)(_?[23]d)?_$"
        f"|long(itudinal)?_?vel|{_VEL}_(forwards?|x)_|_(forwards?|x)_?vel|_v_?(x|ist|fzg|veh|ego|long|signal)?_$"
        "|_tacho_|_v_?x_(vehicle|veh|car|ego|cog)",
        "_lat(eral)?_|_side|_vert|_north|_east|_down|_up_|_[yz]_|_ang|_rot|yaw|gier|roll|wank|pitch|nick|steer|lenk"
        "|_eng(ine)?_|_motor_|shaft|_fan_|_pump_|turbo|_wind_|cruise|_gear|frame",
    ),
    ("steer_rate", "(steer|lenk|_swa_).*(rate|geschw|vel|speed)", ""),
    (
        "steer",
        "steer|lenk(rad)?_?w|_lenk(ung|rad)?_$|hand_?wheel|(road|front)_?wheel_?ang|rad_?einschlag|_swa_|_(sas|lws|lwi)_(.*_)?(ang|winkel)"
        "|_delta(_(front|vorne?|f|fl|fr|l|r|h|sw|1))?_$",
        "_[lr]_?[2-9]_",
    ),
    ("articulation_rate", "(articulat|hitch|knick).*(rate|vel|geschw)|_art_?r_h_", ""),
    ("articulation", "articulat|hitch|knick|coupling_angle|_gamma_|_art_h_", ""),
    ("yaw_acceleration", "yaw_?acc|gier_?beschl", ""),
    ("yaw_rate", "yaw_?(rate|vel)|gier_?(rate|geschw|winkelgeschw)|_psi_?(p|dot)_", ""),
    ("yaw_rate", f"gyr[a-z]*?_?z_|_(gz|wz|avz|omega_?z)_|_{_RATE}_(z|down|up)_|_rate_(body|hor)_z_", ""),
    ("roll_rate", "roll_?(rate|vel)|wank_?(rate|geschw|winkelgeschw)|_phi_?(p|dot)_", ""),
    ("roll_rate", f"gyr[a-z]*?_?x_|_(gx|wx|avx|omega_?x)_|_{_RATE}_(x|forward)_|_rate_(body|hor)_x_", ""),
    ("pitch_rate", "pitch_?(rate|vel)|nick_?(rate|geschw)|gyr[a-z]*?_?y_|_(gy|wy|avy|omega_?y)_", ""),
    ("pitch_rate", f"_{_RATE}_(y|lat[a-z]*)_|_rate_(body|hor)_y_", ""),
    ("lateral_acceleration", f"lat(eral)?_?acc|{_ACC}_?(y|lat[a-z]*)_?\\d?_|_a_?y(_|\\d)|_y_?acc|quer_?beschl", "_ang"),
    ("longitudinal_acceleration", f"long(itudinal)?_?acc|{_ACC}_?(x|long[a-z]*|forward)_?\\d?_|_a_?x(_|\\d)", "_ang"),
    ("longitudinal_acceleration", "_x_?acc|laengs_?beschl", "_ang"),
    ("vertical_acceleration", f"vert(ical)?_?acc|{_ACC}_?(z|vert[a-z]*|down)_?\\d?_|_a_?z(_|\\d)|_z_?acc", "_ang"),
    ("lateral_velocity", f"lat(eral)?_?vel|{_VEL}_(y|lat[a-z]*|side[a-z]*)_|_y_?vel|_v_?y_|quer_?geschw", "_ang|frame"),
    ("sideslip", "side_?slip|slip_?angle|angle_?slip|schwimm|_beta_", "_(front|rear|left|right)_|rate"),
    ("roll", "_roll(_?angle)?_|wank_?winkel|_phi_", "_[alr]\\d_"),
    ("pitch", "_pitch(_?angle)?_|nick_?winkel|_theta_", ""),
    ("yaw", "_(yaw|heading|psi)(_?angle)?_|gier_?winkel", ""),
    ("yaw_rate", "_(yaw|gier)_", "_[alr]\\d_"),
    ("roll_rate", "_(roll|wank)_", "_[alr]\\d_"),
)
"""Quantity, the pattern of its names in English and German, and what must not occur in them; special ones first."""

_UNIT_ENDINGS = {
    **dict.fromkeys(("km_h", "kmh", "kph"), "km/h"),
    **dict.fromkeys(("m_s2", "ms2", "mps2", "m_s_2"), "m/s^2"),
    **dict.fromkeys(("deg_s", "degs", "degps", "dps", "deg_per_s"), "deg/s"),
    **dict.fromkeys(("rad_s", "rads", "radps", "rad_per_s"), "rad/s"),
    **dict.fromkeys(("m_s", "mps"), "m/s"),
    **dict.fromkeys(("deg", "grad"), "deg"),
    "mph": "mph",
    "rad": "rad",
}
"""Units at the end of names."""

_TOWED = re.compile("trailer|semi|_(trl|anh|auflieger|sattelanh[a-z]*|st|towed|rear_unit)_|(ebs|rge)2\\d")
_LEADING = re.compile("tractor|truck|zugm|motor_?wagen|towing|_(trk|szm|cab|chassis|front_unit)_")
_NUMBER = re.compile("(?P<before>[a-z]+)_?(?P<number>[1-8])_$|_(imu|ins|gyro|unit|body)_?(?P<device>[1-8])_")
_NOT_A_UNIT_NUMBER = ("poi", "point", "axle", "wheel", "channel", "can", "bus", "sensor")
"""Words before a number that does not count the units of a vehicle."""
_STEERING_WHEEL = re.compile("wheel|whl|_(swa|sas|lws|lwi|sw)_|lenkrad|hand|column")
_ROAD_WHEEL = re.compile("road|_delta_|rad_?einschlag|front_?wheel|vorderrad")
_SIDES = {
    "front": {"front", "vorn", "vorne", "fa", "fl", "fr", "vl", "vr"},
    "rear": {"rear", "hinten", "ra", "rl", "rr", "hl", "hr"},
    "left": {"left", "links", "fl", "rl", "vl", "hl"},
    "right": {"right", "rechts", "fr", "rr", "vr", "hr"},
}


def classify_columns(units: Mapping[str, str | None]) -> dict[str, ColumnHint]:
    """Hints of all columns of a log, from the columns' units; columns without a hint are left out.

    A "1" at the end of a name counts the units of a vehicle, except where a column has the same name without it: then
    the name is a repeated one, as loggers and libraries number them.
    """
    hints = {column: hint for column, unit in units.items() if (hint := classify_column(column, unit))}
    by_name = {named_unit(split_source(column)[0])[0]: hint for column, hint in hints.items()}
    for name, hint in by_name.items():
        original = by_name.get(re.sub("_?1$", "", name), hint)
        hints[hint.column] = replace(hint, trailing=original.trailing, number=original.number)
    return hints


def classify_column(column: str, unit: str | None) -> ColumnHint | None:
    """The hint of a column's name, in English or German, and its unit; None if it is not a signal of this package."""
    name, source = split_source(column)
    base, ending = named_unit(name)
    words, last_part = f"_{base}_", f"_{normalised_name(re.split('[./]', name)[-1])}_"
    if _NEVER.search(last_part):
        return None
    for quantity, pattern, excluded in _RULES:
        if not re.search(pattern, words) or (excluded and re.search(excluded, words)):
            continue
        if not _fits(unit or ending, quantity):
            continue
        is_steering_wheel = bool(_STEERING_WHEEL.search(words)) and not _ROAD_WHEEL.search(words)
        place, number = f"{words}{normalised_name(source)}_", _unit_number(words)
        return ColumnHint(
            column=column,
            quantity=quantity,
            trailing=_is_trailing(place, number),
            words=place,
            number=number,
            unit=ending,
            steering_wheel=quantity == "steer" and is_steering_wheel,
            side=".".join(side for side, tokens in _SIDES.items() if tokens & set(base.split("_"))),
        )
    return None


def _unit_number(words: str) -> int | None:
    """The number of a unit in the words of a name."""
    number = _NUMBER.search(words)
    if number is None or number["before"] in _NOT_A_UNIT_NUMBER:
        return None
    return int(number["number"] or number["device"])


def _is_trailing(place: str, number: int | None) -> bool | None:
    """Whether a name belongs to a towed unit, by the words of its name and source, or by the number of a unit."""
    if _TOWED.search(place) or number == 2:
        return True
    return False if _LEADING.search(place) or number == 1 else None


def named_unit(name: str) -> tuple[str, str | None]:
    """A name in words without the unit at its end, and that unit: "v_kmh" -> ("v", "km/h")."""
    words = normalised_name(name)
    for ending, unit in _UNIT_ENDINGS.items():
        if words.endswith(f"_{ending}"):
            return words.removesuffix(f"_{ending}"), unit
    return words, None


def normalised_name(name: str) -> str:
    """A name in small letters with one underscore between words: "YawRate-Lkw" -> "yaw_rate_lkw"."""
    for letter, ascii_letters in (
        ("ä", "ae"),
        ("ö", "oe"),
        ("ü", "ue"),
        ("Ä", "Ae"),
        ("Ö", "Oe"),
        ("Ü", "Ue"),
        ("ß", "ss"),
    ):
        name = name.replace(letter, ascii_letters)
    name = re.sub("(?<=[a-z])(?=[A-Z])|(?<=[0-9])(?=[A-Z][a-z])", "_", name)
    name = re.sub("(?<![A-Za-z])(IMU|INS|GPS|GNSS|ESP)(?=[A-Za-z])", r"\1_", name)
    return re.sub("[^a-z0-9]+", "_", name.lower()).strip("_")


def _fits(unit: str | None, quantity: str) -> bool:
    """Whether a quantity can have a unit; a column without a unit can be any quantity."""
    if unit is None or unit.strip() in ("", "-", "1"):
        return True
    if unit.strip() == "%":
        return False
    try:
        factor(unit, QUANTITIES[quantity])
    except UnitError:
        return False
    return True
