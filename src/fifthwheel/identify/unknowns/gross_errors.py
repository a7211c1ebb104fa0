"""Gross errors: what can be wrong in a vehicle file or on a sensor beyond its prior, by how much, and how commonly.

A number that follows from others has no row: an axle load is the result of masses and lengths, and is not wrong alone.
Nor has one whose prior already covers all that a truck can have.
"""

from collections.abc import Mapping
from typing import NamedTuple

from fifthwheel.identify.unknowns.unknown import Unknown
from fifthwheel.names import ends_with
from fifthwheel.vehicle.parameters import POSITIONS

RANGE = 3.0
"""A gross error is at most so many of its standard deviations."""


class GrossError(NamedTuple):
    """The distribution of the error of a number that is wrong."""

    sigma: float
    """Standard deviation: of the logarithm of a number above 0, m of a position, else SI."""
    weight: float
    """How common it is, relative to other errors."""


GROSS_ERRORS: Mapping[str, GrossError] = {
    "mass_scale": GrossError(0.3, 3.0),  # tare in place of gross mass, or another load
    "mass": GrossError(0.3, 3.0),
    "payload.mass": GrossError(0.3, 2.0),
    "cog": GrossError(0.7, 1.0),  # the load at one end
    "tractor.cog": GrossError(0.3, 0.5),  # whose load is on the fifth wheel
    "axle_positions": GrossError(0.6, 2.0),  # another trailer; or to another axle of the group
    "coupling": GrossError(0.4, 1.5),  # a fifth wheel slides by up to 0.6 m
    "position": GrossError(0.6, 1.0),
    "leading_position": GrossError(0.4, 1.5),
    "trailing_position": GrossError(0.4, 1.0),
    "yaw_inertia": GrossError(0.4, 1.0),
    "roll_inertia": GrossError(0.4, 0.5),
    "cog_height": GrossError(0.3, 1.0),
    "roll_axis_height": GrossError(0.4, 0.5),
    "roll_stiffness": GrossError(0.5, 1.0),  # of one axle in place of the group
    "tyre_roll_stiffness": GrossError(0.5, 0.5),
    "roll_damping": GrossError(0.8, 0.5),
    "relaxation_length": GrossError(0.4, 0.3),
    "variation": GrossError(0.3, 0.5),  # of the tyres in one log: others, or flat ones
    "self_steering": GrossError(0.4, 1.0),  # a castor axle
    "softening": GrossError(8.0, 1.0),  # 1/rad, a slippery road
    "half_track": GrossError(0.1, 0.3),
    "relative_friction": GrossError(0.2, 0.3),
    "stiffness_load_sensitivity": GrossError(0.7, 0.3),
    "friction_load_sensitivity": GrossError(0.8, 0.3),
    "combined_slip": GrossError(0.8, 0.3),
    "shape": GrossError(0.2, 0.3),
    "drag_area": GrossError(0.4, 0.3),
    "rolling_resistance": GrossError(0.4, 0.3),
    "time_base": GrossError(0.03, 0.3),
    "delay": GrossError(0.3, 2.0),
    "gain": GrossError(0.4, 2.0),
    "misalignment": GrossError(0.4, 1.0),
    "yaw_rate.offset": GrossError(0.04, 1.0),
    "roll_rate.offset": GrossError(0.04, 1.0),
    "steer.offset": GrossError(0.04, 1.5),
    "articulation.offset": GrossError(0.05, 1.0),
    "lateral_acceleration.offset": GrossError(1.0, 0.5),
    "lateral_acceleration.position": GrossError(1.5, 0.5),
    "lateral_acceleration.height": GrossError(0.6, 0.5),
    "wheel_speed_difference.offset": GrossError(0.02, 1.0),
}
"""By the end of a name; of a sensor error also by its quantity. The figures are judgements, in the order of what
brochures, weighbridges, slipped fifth wheels and logs of other clocks show. Ranks of causes hardly depend on them:
`benchmarks/causes.py` names 25 of 29 faults first, and 24 or 25 with all sizes halved or doubled."""


def gross_error(unknown: Unknown) -> GrossError | None:
    """The gross error of an unknown, with sigma in units of its prior; None if it has none larger than its prior."""
    row = GROSS_ERRORS.get(_kind(unknown.name))
    if row is None:
        return None
    sigma = row.sigma / _unit(unknown)
    return row._replace(sigma=sigma) if sigma > 1 else None


def is_possible(unknown: Unknown, deviation: float) -> bool:
    """Whether a truck can have an unknown so many prior standard deviations from its prior mean."""
    return abs(deviation) <= largest_possible(unknown)


def largest_possible(unknown: Unknown) -> float:
    """Prior standard deviations from its prior mean that a truck can have an unknown."""
    row = gross_error(unknown)
    reach = RANGE * (row.sigma if row else max(1.0, unknown.tail))
    if unknown.logarithmic:
        return reach
    return min(reach, max(abs(end - unknown.centre) for end in unknown.possible) / unknown.scale)


def _kind(name: str) -> str:
    """The row of an unknown: of a sensor error by its quantity, else the longest end of its name that has one."""
    of_sensor = f"{name.partition('.')[0]}.{name.rpartition('.')[2]}"
    if of_sensor in GROSS_ERRORS:
        return of_sensor
    return max((key for key in GROSS_ERRORS if ends_with(name, key)), key=len, default="")


def _unit(unknown: Unknown) -> float:
    """The prior standard deviation in the unit of the rows."""
    lengths = [abs(slope) for path, slope in unknown.moves.items() if path.rpartition(".")[2] in POSITIONS]
    if lengths:
        return max(lengths) * unknown.scale
    relative = [abs(unknown.moves[path] / value) for path, value in unknown.given.items() if path.endswith("mass")]
    return max(relative, default=1.0) * unknown.scale
