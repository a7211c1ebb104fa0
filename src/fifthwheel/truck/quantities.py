"""What is known of each kind of number of truck, tyres, road and model where nobody states more: one row for each.

The row of a number of the vehicle file stands beside its field (`component.number`); rows of all other numbers are
below. A row holds for every number whose name ends with its key; the longest such key counts. Errors of sensors have
theirs in their channel.

A gross error is one beyond the prior: another trailer, a load at one end. A number that follows from others has none:
an axle load is the result of masses and lengths. Nor has one whose prior covers all that a truck can have. The figures
of gross errors are judgements, in the order of what brochures, weighbridges, slipped fifth wheels and logs of other
clocks show. Ranks of causes hardly depend on them: `benchmarks/causes.py` names 25 of 29 faults first, and 24 or 25
with all sizes halved or doubled.
"""

from functools import lru_cache
from typing import Literal, NamedTuple

from fifthwheel.base.errors import VehicleError, suggestion
from fifthwheel.base.names import ParameterPath, ends_with
from fifthwheel.base.options import ObserverOptions

FRICTION = "road.friction"
SHAPE = "tyre.shape"
HALF_TRACK = "body.half_track"
STIFFNESS_SENSITIVITY = "tyre.stiffness_load_sensitivity"
FRICTION_SENSITIVITY = "tyre.friction_load_sensitivity"
COMBINED_SLIP = "tyre.combined_slip"
DRAG_AREA = "body.drag_area"
ROLLING_RESISTANCE = "tyre.rolling_resistance"
DRIVE_AXLE_BRAKING = "brakes.drive_axle"
ROAD_BANK, BANK_VARIATION, DISCREPANCY, TIME_BASE = "road.bank", "road.bank_variation", "discrepancy", "time_base"
MASS_SCALE = "mass_scale"
COUPLINGS = ("wheel", "drawbar", "coupling", "hitch", "turntable", "joint", "ball")
"""A word with one of these ends the name of a coupling."""
WIDE = 0.5
"""Prior standard deviation of a position that the logs are to determine, m."""

Scope = Literal["truck", "unit", "load", "axle load", "road", "log"]


class Sharing(NamedTuple):
    """The labels of a log that a number belongs to: logs with the same ones share it."""

    first: tuple[str, ...]  # of a number of the first unit
    others: tuple[str, ...]  # of all other numbers
    otherwise: Scope = "log"  # in a log that does not have all of these labels


_TRUCK, _TRAILER, _LOAD = ("tractor",), ("tractor", "trailer"), ("tractor", "trailer", "load")
SCOPES: dict[Scope, Sharing] = {
    "truck": Sharing(_TRUCK, _TRUCK),
    "unit": Sharing(_TRUCK, _TRAILER),
    "load": Sharing(_TRUCK, _LOAD),
    "axle load": Sharing(_LOAD, _LOAD),  # a load moves those of all axles
    "road": Sharing(("road",), ("road",)),
    "log": Sharing(("log",), ("log",)),
}
"""Which logs share a number, by its scope. A label is one of a log (`Labels` in
`estimate.identify.knowledge.information`), or a text field of the number's unit in the vehicle file."""


class Quantity(NamedTuple):
    """What is known of a kind of number."""

    sigma: float = 0.0
    """Prior standard deviation: a fraction of the value, or SI if `absolute`; 0: uncertain only where stated."""
    absolute: bool = False
    """Whether `sigma` and `guess` are SI and not fractions of the value."""
    mean: float | None = None
    """Prior mean, SI; None for the value of the vehicle, or 0."""
    guess: float = 0.3
    """Prior standard deviation where the logs are to determine it."""
    gross: float = 0.0
    """Standard deviation of a gross error: of the logarithm of a number above 0, m of a position, else SI."""
    weight: float = 1.0
    """How common a gross error is, relative to others."""
    unit: str = "1"
    """SI unit of the number."""
    default: float = 0.0
    """Value where neither a file nor a user gives one, SI."""
    signed: bool = False
    """Whether it may be 0 or negative, so that a fraction of it means nothing; all others keep their sign."""
    bounds: tuple[float, float] | None = None
    """Limits of its estimate, SI, if they are closer than those of the field."""
    by_change: bool = False
    """Whether `sigma` acts through a change that alters several numbers (`uncertainty.changes`)."""
    scope: Scope = "unit"
    """What it belongs to, and thus which logs share it: `SCOPES`."""
    of_roll: bool = False
    """Whether it acts on roll, so that lane changes with roll inform on it."""
    words: str = ""
    """Spoken name, where it is not the words of the key."""
    part: str = ""
    """The part of an axle group that has it: "tyres"."""
    source: str = ""
    """What the figures are based on."""

    @property
    def is_relative(self) -> bool:
        """Whether a standard deviation is shown as a fraction of the value, and not in the unit."""
        return not self.signed and self.bounds is None

    @property
    def is_position(self) -> bool:
        """Whether it counts from an origin, m."""
        return self.signed and self.unit == "m"

    def sigma_of(self, value: float) -> float:
        """The prior standard deviation, SI, at a value."""
        return self.sigma * (1.0 if self.absolute else abs(value))

    @property
    def is_uncertain(self) -> bool:
        """Whether a number of a vehicle file is uncertain by itself where nobody states it."""
        return self.sigma > 0 and not self.by_change and (self.signed or not self.absolute)

    def guess_of(self, value: float) -> float:
        """The prior standard deviation, SI, at a value that the logs are to determine."""
        return self.guess * (1.0 if self.absolute else abs(value))


TYRES: dict[str, Quantity] = {
    FRICTION: Quantity(0.4, default=0.75, mean=0.75, scope="road", source="truck tyres on a dry road"),
    SHAPE: Quantity(0.12, default=1.1, gross=0.2, weight=0.3),
    # half the distance of the tyres of both sides
    HALF_TRACK: Quantity(0.05, unit="m", default=ObserverOptions.half_track, gross=0.1, weight=0.3),
    STIFFNESS_SENSITIVITY: Quantity(
        0.4, default=0.2, gross=0.7, weight=0.3, source="six truck and bus tyres: 0.1 to 0.37"
    ),
    FRICTION_SENSITIVITY: Quantity(0.5, default=0.09, gross=0.8, weight=0.3, source="the same tyres: 0.07 to 0.19"),
    # 1: as stiff along the wheel as across it
    COMBINED_SLIP: Quantity(0.45, default=0.7, gross=0.8, weight=0.3, source="Magic Formula of truck tyres: 0.5"),
    # drag coefficient times frontal area
    DRAG_AREA: Quantity(0.25, unit="m^2", default=6.0, gross=0.4, weight=0.3, source="0.5 to 0.8 times 8 to 10 m^2"),
    # force over load
    ROLLING_RESISTANCE: Quantity(
        0.25, default=0.006, gross=0.4, weight=0.3, source="truck tyres of ISO 28580: 0.004 to 0.008"
    ),
    # the fraction of the braking force by engine and retarder; the default is that of brakes on all wheels
    DRIVE_AXLE_BRAKING: Quantity(0.4, absolute=True, mean=0.5, scope="log"),
}
"""Of all tyres that saturate."""
GROUP_TYRES: dict[str, Quantity] = {
    "static_load": Quantity(0.02, unit="N", scope="axle load", part="axle"),
    "relative_friction": Quantity(0.1, gross=0.2, weight=0.3, part="tyres"),  # to the friction of the road
    "tyres": Quantity(),  # their number
    # gained by a deceleration, where each group brakes by its load
    "braking_load": Quantity(unit="N/(m/s^2)", scope="axle load"),
    "pull_load": Quantity(scope="axle load"),  # gained by a pull of the first coupling, as a fraction of the pull
}
"""Of the tyres of each axle group that saturate; they follow from the vehicle."""
QUANTITIES: dict[str, Quantity] = {
    **TYRES,
    **GROUP_TYRES,
    # of linear tyres; sigma: `parameters.softening_priors`; gross: a slippery road
    "softening": Quantity(unit="1/rad", absolute=True, gross=8.0, part="tyres"),
    # of a laden unit, and between coupling and mean axle, which follow from others
    "cog_height": Quantity(unit="m", words="CoG height"),
    "wheelbase": Quantity(unit="m"),
    # gross: other tyres, or flat ones
    "cornering_stiffness.variation": Quantity(
        0.025, absolute=True, gross=0.3, weight=0.5, scope="log", source="temperature and pressure of the tyres"
    ),
    DISCREPANCY: Quantity(0.015, absolute=True, source="the least one of a model that runs free, of each signal"),
    ROAD_BANK: Quantity(0.03, unit="rad", absolute=True, source="the crossfall of roads, mean of a segment"),
    BANK_VARIATION: Quantity(
        0.005, unit="rad", absolute=True, source="within a log, with side wind and the pull of misaligned axles"
    ),
    TIME_BASE: Quantity(
        0.002,
        absolute=True,
        gross=0.03,
        weight=0.3,
        scope="truck",
        source="timestamps that are made from a nominal sampling rate",
    ),
    "time_base.delay": Quantity(0.1, unit="s", absolute=True, gross=0.3, weight=2.0),
    # changes of several numbers of the vehicle file; gross: tare in place of gross mass, or another load
    MASS_SCALE: Quantity(
        0.02,
        gross=0.3,
        weight=3.0,
        by_change=True,
        scope="truck",
        source="one scale weighs all units: a static weighbridge has 0.1 %, weighing in motion of class 2 (OIML R 134)"
        " 2 %, on-board scales 5 %",
    ),
    # gross: another trailer, or to another axle of the group
    "axle_positions": Quantity(
        0.03,
        unit="m",
        absolute=True,
        gross=0.6,
        weight=2.0,
        by_change=True,
        source="tape measure along the frame, to the middle of a wheel; or a brochure",
    ),
    "coupling": Quantity(  # of the wheelbase; gross: a fifth wheel slides by up to 0.6 m
        0.01,
        gross=0.4,
        weight=1.5,
        by_change=True,
        words="coupling position",
        source="a fifth wheel can be slid along the frame, in steps of 0.05 m or more",
    ),
    "tractor.cog": Quantity(  # the load of a tractor is on its fifth wheel
        unit="m", absolute=True, signed=True, guess=WIDE, gross=0.3, weight=0.5, by_change=True, words="CoG position"
    ),
    "cog.unladen": Quantity(
        0.05,
        unit="m",
        absolute=True,
        by_change=True,
        source="axle loads of 2 % give 0.02 m with a wheelbase of 3.7 m; tank and driver give the rest",
    ),
    "self_steering.castor": Quantity(
        0.1, absolute=True, by_change=True, source="friction, and springs or dampers that centre the wheels"
    ),
    "yaw_stiffness.spring": Quantity(0.3, by_change=True, source="as in roll"),
    "yaw_damping.damper": Quantity(0.3, by_change=True, source="a linear law for a damper with valves"),
}
"""By the end of the name. Each component of a vehicle adds the rows of its fields."""
UNITS: dict[str, str] = {
    ParameterPath.of(name).last_word: QUANTITIES[name].unit for name in (*TYRES, *GROUP_TYRES, "softening")
}
"""SI unit of each number by the last word of its name, which has one unit wherever it occurs."""
_OWN_UNITS: dict[str, str] = {}
"""Of the own parameters of a steering, by the last word of their paths."""


def register(key: str, row: Quantity) -> None:
    """Add the row of a number of the vehicle file, by the end of its path; a TypeError if its last word has another
    unit elsewhere."""
    last = ParameterPath.of(key).last_word
    if UNITS.setdefault(last, row.unit) != row.unit:
        raise TypeError(f"{key}: expected {UNITS[last]}, as {last} elsewhere, got {row.unit}")
    QUANTITIES[key] = row
    quantity_of.cache_clear()


def register_unit(path: str, unit: str) -> None:
    """The SI unit of an own parameter, in this process; a VehicleError where its last word has another unit."""
    last = ParameterPath.of(path).quantity
    if UNITS.get(last, unit) != unit:
        raise VehicleError(f"{path}: expected {UNITS[last]}, as {last} elsewhere, got {unit}; use another name")
    _OWN_UNITS[last] = unit


@lru_cache(maxsize=4096)
def quantity_of(name: str) -> Quantity:
    """The row of a number by its name; an empty one where there is none.

    >>> quantity_of("semitrailer.roll_stiffness").sigma, quantity_of("turntable.roll_stiffness").sigma
    (0.1, 0.3)
    """
    first, dot, rest = name.partition(".")
    if dot and first.endswith(COUPLINGS):
        name = f"coupling.{rest}"
    elif dot and first == TIME_BASE:
        name = f"{TIME_BASE}.{ParameterPath.of(name).quantity}"
    key = max((key for key in QUANTITIES if ends_with(name, key)), key=len, default="")
    return QUANTITIES.get(key, Quantity())


def unit_of(path: str) -> str:
    """SI unit of a parameter: 'N/rad', 'kg m^2', 'm'.

    A VehicleError if the path does not end with the name of a quantity.
    """
    last = ParameterPath.of(path).quantity
    unit = UNITS.get(last) or _OWN_UNITS.get(last)
    if unit is None:
        raise VehicleError(f"{path}: expected the path of a parameter; {suggestion(last, UNITS)}")
    return unit


def size_of(path: str, value: float, prior: float) -> float:
    """What a standard deviation of a parameter is compared with, SI: its value; of a signed one that of its prior."""
    return prior if quantity_of(path).signed or not value else abs(value)


class RoadFriction(NamedTuple):
    """Peak friction of a kind of road, and its standard deviation as a fraction."""

    value: float
    sigma: float


ROADS: dict[str, RoadFriction] = {
    # dry: five truck and bus tyres have 0.74 to 0.78 at their nominal load. The others: J. Y. Wong, Theory
    # of Ground Vehicles, coefficients of road adhesion: wet asphalt 0.5 to 0.7, hard-packed snow 0.2, ice 0.1; of wet
    # asphalt the lower end, because truck tyres have less than those of cars. sigma: the spread within such a kind.
    "dry": RoadFriction(0.75, 0.15),
    "wet": RoadFriction(0.5, 0.2),
    "snow": RoadFriction(0.2, 0.3),
    "ice": RoadFriction(0.1, 0.4),
    "unknown": RoadFriction(TYRES[FRICTION].default, TYRES[FRICTION].sigma),
}
"""By the word that a user gives for the road."""
