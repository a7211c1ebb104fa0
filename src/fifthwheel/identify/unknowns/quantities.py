"""What is uncertain of a truck, its tyres, the road and the model: one row for each kind of number.

A row holds for every number whose name ends with its own; the longest such name counts. Masses and lengths of a vehicle
file have their standard deviations from `vehicle.uncertainty`, sensor errors from their channel.

A gross error is one beyond the prior: another trailer, a gain of another unit. A number that follows from others has
none: an axle load is the result of masses and lengths. Nor has one whose prior covers all that a truck can have. The
figures of gross errors are judgements, in the order of what brochures, weighbridges, slipped fifth wheels and logs of
other clocks show. Ranks of causes hardly depend on them: `benchmarks/causes.py` names 25 of 29 faults first, and 24 or
25 with all sizes halved or doubled.
"""

from collections.abc import Mapping
from typing import NamedTuple

from fifthwheel.identify.statement import BANK_VARIATION, DISCREPANCY, ROAD_BANK, TIME_BASE, refused, stated
from fifthwheel.identify.unknowns.unknown import Unknown
from fifthwheel.names import ends_with
from fifthwheel.vehicle.parameters import DRIVE_AXLE_BRAKING, FRICTION, POSITIONS, TYRE_PARAMETERS

RANGE = 3.0
"""A gross error is at most so many of its standard deviations."""
GUESS_TAIL = 3.0
"""Beyond about this number of standard deviations the prior of a guess falls only exponentially: it may be far off."""


class Quantity(NamedTuple):
    """What is known of numbers of a kind where nobody states more."""

    sigma: float = 0.0
    """Prior standard deviation: a fraction of the value, or in the unit; 0 if it is uncertain only where stated."""
    unit: str = ""
    """SI unit of sigma and mean; empty for a fraction of the value."""
    mean: float | None = None
    """Prior mean, SI; None for that of the vehicle, or 0."""
    guess: float = 0.3
    """Prior standard deviation where the logs are to determine it, as a fraction of the value."""
    gross: float = 0.0
    """Standard deviation of a gross error: of the logarithm of a number above 0, m of a position, else SI."""
    weight: float = 1.0
    """How common a gross error is, relative to others."""


QUANTITIES: Mapping[str, Quantity] = {
    # estimated parameters
    "cornering_stiffness": Quantity(),
    "yaw_inertia": Quantity(0.1, gross=0.4),
    "payload.height": Quantity(0.75, "m", 1.4),  # any height up to 2.7 m, the inside of a usual body
    FRICTION: Quantity(0.4, mean=TYRE_PARAMETERS[FRICTION].default),
    # of the suspension and the body; the figures are the spread of published trucks
    "roll_stiffness": Quantity(0.1, gross=0.5),  # of one axle in place of the group
    "tyre_roll_stiffness": Quantity(0.1, gross=0.5, weight=0.5),
    "roll_damping": Quantity(0.3, gross=0.8, weight=0.5),
    "roll_axis_height": Quantity(0.1, gross=0.4, weight=0.5),
    "fifth_wheel.roll_stiffness": Quantity(0.3, gross=0.5),
    "sprung.cog_height": Quantity(0.1, gross=0.3),
    # guess: a payload of the same height may be a point, or stand along the sides
    "sprung.roll_inertia": Quantity(0.2, guess=0.6, gross=0.4, weight=0.5),
    "body.half_track": Quantity(0.05, gross=0.1, weight=0.3),
    "body.drag_area": Quantity(0.25, gross=0.4, weight=0.3),
    # of the tyres; sources of the values: `vehicle.parameters.TYRE_PARAMETERS`
    "relaxation_length": Quantity(0.2, gross=0.4, weight=0.3),
    "pneumatic_trail": Quantity(0.2),
    "tyre.shape": Quantity(0.12, gross=0.2, weight=0.3),
    "tyre.stiffness_load_sensitivity": Quantity(0.4, gross=0.7, weight=0.3),
    "tyre.friction_load_sensitivity": Quantity(0.5, gross=0.8, weight=0.3),
    "tyre.combined_slip": Quantity(0.45, gross=0.8, weight=0.3),
    "tyre.rolling_resistance": Quantity(0.25, gross=0.4, weight=0.3),
    "static_load": Quantity(0.02),
    "relative_friction": Quantity(0.1, gross=0.2, weight=0.3),
    "softening": Quantity(unit="1/rad", gross=8.0),  # a slippery road; sigma: `parameters.softening_priors`
    # from log to log, with temperature and pressure of the tyres; gross: other tyres, or flat ones
    "cornering_stiffness.variation": Quantity(0.025, "1", gross=0.3, weight=0.5),
    # of a fixed last axle of a group behind the first unit; gross: a castor axle
    "self_steering": Quantity(0.015, "1", gross=0.4),
    # of each log: the fraction of the braking force by engine and retarder
    DRIVE_AXLE_BRAKING: Quantity(0.4, "1", 0.5),
    # of the model and the road
    DISCREPANCY: Quantity(0.015, "1"),  # the least one of a free-running model, as a fraction of each signal
    ROAD_BANK: Quantity(0.03, "rad"),  # mean of a segment
    BANK_VARIATION: Quantity(0.005, "rad"),  # within a log, with side wind and the pull of misaligned axles
    # timestamps are sometimes made from a nominal sampling rate
    TIME_BASE: Quantity(0.002, "1", gross=0.03, weight=0.3),
    "time_base.delay": Quantity(0.1, "s", gross=0.3, weight=2.0),
    # gross errors of masses and lengths
    "mass_scale": Quantity(gross=0.3, weight=3.0),  # tare in place of gross mass, or another load
    "mass": Quantity(gross=0.3, weight=3.0),
    "payload.mass": Quantity(gross=0.3, weight=2.0),
    "cog": Quantity(gross=0.7),  # the load at one end
    "tractor.cog": Quantity(gross=0.3, weight=0.5),  # whose load is on the fifth wheel
    "axle_positions": Quantity(gross=0.6, weight=2.0),  # another trailer; or to another axle of the group
    "coupling": Quantity(gross=0.4, weight=1.5),  # a fifth wheel slides by up to 0.6 m
    "position": Quantity(gross=0.6),
    "leading_position": Quantity(gross=0.4, weight=1.5),
    "trailing_position": Quantity(gross=0.4),
    # gross errors of sensors
    "delay": Quantity(gross=0.3, weight=2.0),
    "gain": Quantity(gross=0.4, weight=2.0),
    "misalignment": Quantity(gross=0.4),
    "yaw_rate.offset": Quantity(gross=0.04),
    "roll_rate.offset": Quantity(gross=0.04),
    "steer.offset": Quantity(gross=0.04, weight=1.5),
    "articulation.offset": Quantity(gross=0.05),
    "lateral_acceleration.offset": Quantity(gross=1.0, weight=0.5),
    "lateral_acceleration.position": Quantity(gross=1.5, weight=0.5),
    "lateral_acceleration.height": Quantity(gross=0.6, weight=0.5),
    "wheel_speed_difference.offset": Quantity(gross=0.02),
}
"""By the end of the name; a sensor error also by quantity and kind, as "steer.offset"."""
FRACTIONS: Mapping[str, float] = {key: row.sigma for key, row in QUANTITIES.items() if row.sigma and not row.unit}
"""Prior standard deviations that are a fraction of the value."""


def quantity(name: str) -> Quantity:
    """The row of a number; an empty one where there is none."""
    of_sensor = f"{name.partition('.')[0]}.{name.rpartition('.')[2]}"
    return QUANTITIES.get(of_sensor if of_sensor in QUANTITIES else longest_end(name, QUANTITIES) or "", Quantity())


def prior_of(given: Mapping[str, str | float], name: str) -> tuple[float, float]:
    """Prior mean and standard deviation, SI, of a number that no vehicle file has, as stated or by its row."""
    row = quantity(name)
    found = stated(given, name, row.unit or "1", row.mean or 0.0)
    if found.free:
        raise refused(found, "is estimated already; give its standard deviation")
    return found.value, found.or_sigma(row.sigma)


def longest_end(name: str, table: Mapping[str, object]) -> str | None:
    """The longest key of a table that is a name or the end of it; None if there is none."""
    return max((key for key in table if ends_with(name, key)), key=len, default=None)


def gross_error(unknown: Unknown) -> Quantity | None:
    """The row of an unknown, with the gross error in units of its prior; None if that is not larger than the prior."""
    row = quantity(unknown.name)
    row = row._replace(gross=row.gross / _unit(unknown))
    return row if row.gross > 1 else None


def is_possible(unknown: Unknown, deviation: float) -> bool:
    """Whether a truck can have an unknown so many prior standard deviations from its prior mean."""
    return abs(deviation) <= largest_possible(unknown)


def largest_possible(unknown: Unknown) -> float:
    """Prior standard deviations from its prior mean that a truck can have an unknown."""
    row = gross_error(unknown)
    reach = RANGE * (row.gross if row else max(1.0, unknown.tail))
    if unknown.logarithmic:
        return reach
    return min(reach, max(abs(end - unknown.centre) for end in unknown.possible) / unknown.scale)


def _unit(unknown: Unknown) -> float:
    """The prior standard deviation in the unit of the rows."""
    lengths = [abs(slope) for path, slope in unknown.moves.items() if path.rpartition(".")[2] in POSITIONS]
    if lengths:
        return max(lengths) * unknown.scale
    relative = [abs(unknown.moves[path] / value) for path, value in unknown.given.items() if path.endswith("mass")]
    return max(relative, default=1.0) * unknown.scale
