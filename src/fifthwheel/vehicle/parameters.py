"""SI units of all parameters, and what `dynamics.tyres` needs for tyres that saturate beyond a vehicle file."""

from collections.abc import Mapping
from typing import NamedTuple

from fifthwheel.errors import VehicleError, suggestion
from fifthwheel.names import ParameterPath, ends_with
from fifthwheel.options import ObserverOptions
from fifthwheel.vehicle.component import SI_UNITS

POSITIONS = ("cog", "position", "leading_position", "trailing_position")
"""Quantities that count from an origin."""
SIGNED = frozenset({*POSITIONS, "roll_yaw_product"})
"""Quantities that may be 0 or negative, so that a fraction of one means nothing; all others keep their sign."""
FRICTION = "road.friction"
SHAPE = "tyre.shape"
HALF_TRACK = "body.half_track"
STIFFNESS_SENSITIVITY = "tyre.stiffness_load_sensitivity"
FRICTION_SENSITIVITY = "tyre.friction_load_sensitivity"
COMBINED_SLIP = "tyre.combined_slip"
DRAG_AREA = "body.drag_area"
ROLLING_RESISTANCE = "tyre.rolling_resistance"
DRIVE_AXLE_BRAKING = "brakes.drive_axle"


class TyreParameter(NamedTuple):
    """A number of all tyres that saturate."""

    unit: str
    default: float


TYRE_PARAMETERS: Mapping[str, TyreParameter] = {
    FRICTION: TyreParameter("1", 0.75),  # of truck tyres on a dry road
    SHAPE: TyreParameter("1", 1.1),
    HALF_TRACK: TyreParameter("m", ObserverOptions.half_track),  # half the distance of the tyres of both sides
    STIFFNESS_SENSITIVITY: TyreParameter("1", 0.2),  # of six truck and bus tyres: 0.1 to 0.37
    FRICTION_SENSITIVITY: TyreParameter("1", 0.09),  # of the same tyres: 0.07 to 0.19
    COMBINED_SLIP: TyreParameter("1", 0.7),  # 1: as stiff along the wheel as across it; Magic Formula of trucks: 0.5
    DRAG_AREA: TyreParameter("m^2", 6.0),  # drag coefficient times frontal area: 0.5 to 0.8 times 8 to 10 m^2
    ROLLING_RESISTANCE: TyreParameter("1", 0.006),  # force over load: 0.004 to 0.008 for truck tyres (ISO 28580)
    DRIVE_AXLE_BRAKING: TyreParameter("1", 0.0),  # 0: by brakes on all wheels; 1: by engine and retarder
}


class RoadFriction(NamedTuple):
    """Peak friction of a kind of road, and its standard deviation as a fraction."""

    value: float
    sigma: float


ROADS: Mapping[str, RoadFriction] = {
    # dry: five truck and bus tyres have 0.74 to 0.78 at their nominal load. The others: J. Y. Wong, Theory
    # of Ground Vehicles, coefficients of road adhesion: wet asphalt 0.5 to 0.7, hard-packed snow 0.2, ice 0.1; of wet
    # asphalt the lower end, because truck tyres have less than those of cars. sigma: the spread within such a kind.
    "dry": RoadFriction(0.75, 0.15),
    "wet": RoadFriction(0.5, 0.2),
    "snow": RoadFriction(0.2, 0.3),
    "ice": RoadFriction(0.1, 0.4),
    "unknown": RoadFriction(0.75, 0.4),
}
"""By the word that a user gives for the road."""
GROUP_TYRE_UNITS: Mapping[str, str] = {
    "static_load": "N",
    "relative_friction": "1",  # to the friction of the road
    "tyres": "1",  # their number
    "braking_load": "N/(m/s^2)",  # that the group gains by a deceleration, where each group brakes by its load
    "pull_load": "1",  # load that the group gains by a pull of the first coupling, as a fraction of the pull
}
"""Of the numbers of each axle group, which follow from the vehicle, by the last word of their names."""
_TYRE_UNITS = {**{name.rpartition(".")[2]: p.unit for name, p in TYRE_PARAMETERS.items()}, **GROUP_TYRE_UNITS}
_TYRE_UNITS["softening"] = "1/rad"  # of linear tyres

_OWN_UNITS: dict[str, str] = {}
"""Of the own parameters of a steering, by the last word of their paths."""


def register_unit(path: str, unit: str) -> None:
    """The SI unit of an own parameter, in this process; a VehicleError where its last word has another unit."""
    quantity = ParameterPath.of(path).quantity
    known = (SI_UNITS | _TYRE_UNITS).get(quantity, unit)
    if known != unit:
        raise VehicleError(f"{path}: expected {known}, as {quantity} elsewhere, got {unit}; use another name")
    _OWN_UNITS[quantity] = unit


def is_signed(path: str) -> bool:
    """Whether a parameter may be 0 or negative; see `SIGNED`."""
    return ParameterPath.of(path).quantity in SIGNED


def is_relative(path: str) -> bool:
    """Whether a standard deviation of a parameter is shown as a fraction of its value, and not in its unit."""
    return not (is_signed(path) or ends_with(path, "payload.height"))


def size_of(path: str, value: float, prior: float) -> float:
    """What a standard deviation of a parameter is compared with, SI: its value; of a signed one that of its prior."""
    return prior if is_signed(path) or not value else abs(value)


def unit_of(path: str) -> str:
    """SI unit of a parameter: 'N/rad', 'kg m^2', 'm'.

    Raises:
        VehicleError: the path does not end with the name of a quantity.
    """
    quantity = ParameterPath.of(path).quantity
    units = _OWN_UNITS | SI_UNITS | _TYRE_UNITS
    if quantity not in units:
        raise VehicleError(f"{path}: expected the path of a parameter; {suggestion(quantity, SI_UNITS)}")
    return units[quantity]
