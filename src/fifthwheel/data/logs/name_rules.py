"""Rules for names of channels: the quantity, unit and place that the name and the unit of a column indicate."""

import re
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from fifthwheel.base.errors import UnitError
from fifthwheel.base.names import split_source
from fifthwheel.base.units import factor
from fifthwheel.data.channels import ARTICULATION, CHANNELS, SPEED, STEER, Channel
from fifthwheel.data.channels.sensors import SENSOR_CLASSES

# Patterns are searched in names of small letters with "_" before, between and after the words: "_yaw_rate_lkw_".
_NEVER = re.compile(
    "_(set|soll|target|demand|request|req|command|cmd|desired|limit|max|min|status|valid|validity|qual|quality|qbit|flag"
    "|counter|cnt|crc|checksum|type|error|err|fault|sigma|std|stddev|stdev|variance|var|cov|conf|accuracy|latency|age"
    "|offset|bias|relative|rel|rlative|inc|trig|trigger|pedal|ped|fraction|temp|temperature|torque|trq|moment|force"
    "|couple|consigne|pressure|power|voltage|fluid|vz|enable|enabled|active|mode|switch|button|lamp|warning|available)_|_current_$"
)
"""Words of other channels: set values, states, accuracies, signs, forces."""
_RULES = [
    (channel, rule)
    for generic in (False, True)
    for channel in CHANNELS.values()
    for rule in channel.patterns
    if rule.generic == generic
]
"""In the order in which they are tried."""
NO_UNIT = ("", "-", "1")
"""What stands in a log for an unknown unit."""
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
_TOWED = re.compile(
    "trailer|semi|auflieger|anhaeng|remorque|nachlaeufer|_(tr[1-9]|trl|anh|nl|sa|st(?!_wh)|towed|rear_unit)_|(ebs|rge)2\\d|_hrw_.*_c[89a-f]_$"
)
_LEADING = re.compile(
    "tractor|tracteur|truck|zugm|motor_?wagen|vorderwagen|towing|_(prime|trk|szm|zm|lkw|vw|cab|chassis|front_unit)_"
)
_OF_WHEEL = re.compile(
    "_[lr]_?[1-9][io]?_|wheel(?!_?base)|whl|_rad_|_roue|knuckle|_hub_|_(axle|achse|essieu)_?[1-9]?_|_([fr][lr]|[vh][lr])_"
)
"""Words of wheels, knuckles and axles, which move unlike the body."""
_NUMBER = re.compile(
    "(?P<before>(?!(?<=_)[lr]_?\\d)[a-z]+)_?(?P<number>[1-8])_$|_(imu|ins|gyro|unit|body)_?(?P<device>[1-8])_"
)
_OF_TRAILERS = ("tr", "trl", "trailer", "anh", "anhaenger", "remorque")
"""Words before a number that counts the towed units only."""
_NOT_A_UNIT_NUMBER = ("poi", "point", "axle", "weight", "load", "wheel", "channel", "can", "bus", "sensor")
"""Words before a number that does not count the units of a vehicle."""
_MOST_TURNS = 200.0
"""rad, of a course that counts its turns."""
_LEAST_TOP_SPEED = 8.0
"""m/s; a truck on the road drives faster."""
_STEERING_WHEEL = re.compile("wheel|whl|_(swa|sas|lws|lwi|sw|lrw|hwa)_|lenkrad|hand|column|volant")
_ROAD_WHEEL = re.compile("_[lr]_?1_|knuckle|road|_delta_(?!lrw|swa|hwa)|rad_?einschlag|front_?wheel|vorderrad")
_COMPUTED = re.compile(
    "_(filt[a-z]*|gefiltert|lp\\d*|tp\\d*|low_?pass|tief_?pass|corr|corrected|korr|korrigiert|compensated|calc|calculated"
    "|maths?|smooth[a-z]*|avg|average|mean|mittel[a-z]*)_"
)
"""Words of columns that a logger computes from others."""
_DEVICE = re.compile("(?<=[a-z0-9])_(gps|gnss|obd|can)$")
"""Words at the end of a name for the device that has measured."""
_SENSORS = {
    "vdc2": "_vdc_?2_|vehicle_dynamic_stability",
    "ins": "_(ins|oxts|rt3000|rt1003|nov_?a_?tel|vector_?nav|adma|applanix)_",
}
"""Words for classes of sensors: the J1939 message 61449, and makes of inertial navigation systems."""
_UMLAUTS = str.maketrans({"ä": "ae", "ö": "oe", "ü": "ue", "Ä": "Ae", "Ö": "Oe", "Ü": "Ue", "ß": "ss"})
_SIDES = {
    "front": {"front", "vorn", "vorne", "avant", "fa", "fl", "fr", "vl", "vr"},
    "rear": {"rear", "hinten", "arriere", "ra", "rl", "rr", "hl", "hr"},
    "left": {"left", "links", "gauche", "fl", "rl", "vl", "hl"},
    "right": {"right", "rechts", "droite", "fr", "rr", "vr", "hr"},
}


@dataclass(frozen=True, kw_only=True)
class ColumnHint:
    """What the name and the unit of a column indicate."""

    column: str
    channel: Channel
    trailing: bool | None
    """Whether it belongs to a towed unit; None where the name does not say."""
    steering_wheel: bool = False
    """Whether it is the steering-wheel angle and not the road-wheel angle."""
    of_wheel: bool = False
    """Whether it is of a wheel, a knuckle or an axle: the road-wheel angle, or the motion of another body."""
    unit: str | None = None
    """The unit at the end of the name: km/h of v_kmh."""
    side: str = ""
    """Place of a wheel or axle: "front.left", "rear"."""
    part: str = ""
    """Part of the signal by its name: retarder."""
    is_relative: bool = False
    """Whether it is in percent of a reference value that the log does not have."""
    words: str = ""
    """Words of the name and its source, with "_" before, between and after them."""
    number: int | None = None
    """The unit's number in the name, from 1 for the leading unit."""

    @property
    def is_computed(self) -> bool:
        """Whether it is computed from another column by its name, whose noise it shares."""
        return _COMPUTED.search(self.words) is not None

    @property
    def sensor(self) -> str:
        """The class of its sensor; empty where the name does not say."""
        if self.channel is STEER:
            return "steering wheel" if self.steering_wheel else ""
        named = (name for name, pattern in _SENSORS.items() if re.search(pattern, self.words))
        return next((name for name in named if self.channel.quantity in SENSOR_CLASSES[name].offset), "")

    def signal(self, units: Sequence[str], steered: str = "front") -> str | None:
        """The signal of a vehicle with these units, front to rear; None where a proposal does not use the quantity.

        `steered` is the first steered axle group of the leading unit.
        """
        if self.channel.proposed is None:
            return None
        quantity, unit = self.channel.quantity, self._unit(units)
        if self.channel.of == "vehicle":
            return quantity
        if self.channel is STEER:
            return f"{quantity}.{unit}.{steered}" if unit == units[0] else f"{quantity}.{unit}"
        if self.channel.of == "part" and self.side:
            return f"{quantity}.{unit}.{self.side}"
        return f"{quantity}.{unit}.{self.part}" if self.part else f"{quantity}.{unit}"

    def _unit(self, units: Sequence[str]) -> str:
        """The unit that the name contains, else the one with its number, else the last one for a towed unit."""
        is_articulation = self.channel is ARTICULATION and len(units) > 1
        named = [unit for unit in units[is_articulation:] if f"_{unit}_" in self.words]
        if len(named) == 1:
            return named[0]
        if len(units) > 2 and self.number and self.number <= len(units) and not is_articulation:
            return units[self.number - 1]
        return units[-1] if self.trailing or is_articulation else units[0]


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
    """The hint of a column's name in English, German or French and its unit; None if it is no known quantity."""
    name, source = split_source(column)
    base, ending = named_unit(name)
    words, last_part = f"_{_DEVICE.sub('', base)}_", f"_{normalised_name(re.split('[./]', name)[-1])}_"
    is_other = bool(_NEVER.search(last_part))
    for channel, rule in _RULES:
        if is_other and not (rule.own and not _NEVER.search(re.sub(rule.own, "", last_part))):
            continue
        if not re.search(rule.pattern, words) or (rule.excluded and re.search(rule.excluded, words)):
            continue
        if not _fits(unit or ending, channel):
            continue
        is_road_wheel = bool(_ROAD_WHEEL.search(words))
        is_steering_wheel = bool(_STEERING_WHEEL.search(words)) and not is_road_wheel
        place, number = f"_{base}_{normalised_name(source)}_", _unit_number(words)
        is_towed = bool(_TOWED.search(place)) or number == 2
        return ColumnHint(
            column=column,
            channel=channel,
            trailing=is_towed or (False if _LEADING.search(place) or number == 1 else None),
            words=place,
            number=number,
            unit=ending,
            steering_wheel=channel is STEER and is_steering_wheel,
            of_wheel=is_road_wheel if channel is STEER else bool(_OF_WHEEL.search(f"_{base}_")),
            side=".".join(side for side, tokens in _SIDES.items() if tokens & set(base.split("_"))),
            part=rule.part,
            is_relative=channel.percent == "reference" and ((unit or "").strip() == "%" or "percent" in words),
        )
    return None


def is_course(column: str, unit: str | None, low: float, high: float) -> bool:
    """Whether a column is a course or heading by its name, its unit and its range in it."""
    if not re.search("_(heading|course|azimuth|kurs|kurswinkel|cap|cog)_", f"_{normalised_name(column)}_"):
        return False
    try:
        return high - low > 0 and (high - low) * factor(unit or "deg", "rad") < _MOST_TURNS
    except UnitError:
        return False


def is_rate_by_unit(column: str, unit: str | None) -> bool:
    """Whether a column whose name has no hint is an angular rate of a body by its unit, such as deg/s."""
    is_rate = unit is not None and re.fullmatch(r"(deg|°|rad)\w*\s*/\s*s\w*", unit.strip()) is not None
    return is_rate and not _NEVER.search(f"_{normalised_name(column)}_") and classify_column(column, unit) is None


def is_speed_by_unit(column: str, unit: str | None, low: float, high: float) -> bool:
    """Whether a column whose name has no hint is the speed by its unit, km/h or mph, and its range.

    It is if the largest value is usual on a road and the name is not that of another speed.
    """
    rule, words = SPEED.patterns[0], f"_{normalised_name(column)}_"
    excluded = _NEVER.search(words) or re.search(rule.excluded, words) or classify_column(column, unit)
    if unit is None or excluded or not _fits(unit, SPEED):
        return False
    si = factor(unit, SPEED.unit)
    assert SPEED.limit is not None
    is_of_road = _LEAST_TOP_SPEED < high * si < SPEED.limit.magnitude and low * si > -_LEAST_TOP_SPEED
    return factor("km/h", SPEED.unit) <= si < 1.0 and is_of_road


def _unit_number(words: str) -> int | None:
    """The number of a unit in the words of a name."""
    number = _NUMBER.search(words)
    if number is None or number["before"] in _NOT_A_UNIT_NUMBER:
        return None
    return int(number["number"] or number["device"]) + (number["before"] in _OF_TRAILERS)


def named_unit(name: str) -> tuple[str, str | None]:
    """A name in words without the unit at its end, and that unit: "v_kmh" -> ("v", "km/h")."""
    words = normalised_name(name)
    for ending, unit in _UNIT_ENDINGS.items():
        if words.endswith(f"_{ending}"):
            return words.removesuffix(f"_{ending}"), unit
    return words, None


def normalised_name(name: str) -> str:
    """A name in small letters with one underscore between words: "YawRate-Lkw" -> "yaw_rate_lkw"."""
    decomposed = unicodedata.normalize("NFKD", name.translate(_UMLAUTS))
    plain = "".join(character for character in decomposed if not unicodedata.combining(character))
    name = re.sub("(?<=[a-z])(?=[A-Z])|(?<=[0-9])(?=[A-Z][a-z])", "_", plain)
    name = re.sub("(?<![A-Za-z])(IMU|INS|GPS|GNSS|ESP)(?=[A-Za-z])", r"\1_", name)
    return re.sub("[^a-z0-9]+", "_", name.lower()).strip("_")


def _fits(unit: str | None, channel: Channel) -> bool:
    """Whether a quantity can have a unit; a column without a unit can be any quantity."""
    if unit is None or unit.strip() in NO_UNIT:
        return True
    if unit.strip() == "%":
        return channel.percent is not None
    try:
        factor(unit, channel.unit)
    except UnitError:
        return False
    return True
