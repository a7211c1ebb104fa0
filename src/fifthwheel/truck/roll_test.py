"""Roll stiffness and roll axis height of a unit from a static test: a known load is moved sideways on the parked truck.

A load of mass m that is moved sideways by the distance d changes the roll moment by m g d. For small angles the roll
angles of all units are in equilibrium, S phi = moments, with

    S_ii = K*_i - m_i g h_i + sum of the stiffnesses K_c of its couplings,    S_ij = -K_c,

where K* is the stiffness of suspensions and tyres in series, and m g h the moment of gravity per roll angle (Cheng and
Cebon 2011, equations (A3) and (A6) without motion). The neighbours of unit i follow its roll, so that

    moment / phi_i = K*_i + s_i,    s_i = -m_i g h_i + K_c - (Schur complement of the neighbours).

A point of the body at the height z moves to the side toward which the body leans by phi (z - h_r), because the body
rolls about its axis. K* alone is in the equations of motion, not suspension and tyres separately: the test determines
the stiffness of the suspension for the given stiffness of the tyres, and the latter then counts as exact.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

from fifthwheel.base.errors import VehicleError
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.truck.loads import laden
from fifthwheel.truck.unit import Unit
from fifthwheel.truck.vehicle import Vehicle

MAX_ROLL = math.radians(5.0)
"""Largest roll angle of a test, rad: beyond it the equations are not linear."""
STEP = 1e-4
"""Of the derivatives, as a fraction of a standard deviation."""


class Measured(NamedTuple):
    """A measured number and its standard deviation, SI."""

    value: float
    sigma: float


class RollTest(NamedTuple):
    """The readings of a static roll test; differences between both positions of the load."""

    unit: str
    """Name of the unit on which the load is moved."""
    load: Measured
    """Mass of the load, kg; it belongs to the masses of the vehicle."""
    shift: Measured
    """Distance by which the load is moved sideways, m."""
    roll: Measured
    """Roll angle of the body of the unit, rad."""
    displacement: Measured | None = None
    """Displacement of a point of the body toward the side to which it leans, m."""
    height: Measured | None = None
    """Height of that point above the ground, m."""


def with_roll_test(vehicle: Vehicle, test: RollTest, sigmas: Mapping[str, float]) -> Vehicle:
    """The vehicle with the roll stiffness of a unit from a test, and the roll axis height if it was measured.

    Both state their standard deviation, which includes that of the readings and of all other numbers.

    Args:
        vehicle: as it stands in the test.
        test: on a unit with one axle group.
        sigmas: assumed standard deviations of other numbers by path, SI.

    Raises:
        VehicleError: there is no such unit, it has several axle groups, or the readings are not plausible.
    """
    unit = vehicle.unit(test.unit)
    group, *others = unit.axle_groups
    if others:
        raise VehicleError(
            f"{unit.name}: expected one axle group, got {len(unit.axle_groups)}; the test does not divide the stiffness"
            " among several. Test a trailer, or state each roll_stiffness in the vehicle file"
        )
    path = unit.group_path(group)
    _check_readings(test)
    moment = test.load.value * STANDARD_GRAVITY * test.shift.value
    total = moment / test.roll.value - stiffness_of_rest(vehicle, unit.name)
    if not 0 < total < group.tyre_roll_stiffness:
        raise VehicleError(
            f"{path}.roll_stiffness: expected suspension and tyres together between 0 and the"
            f" {group.tyre_roll_stiffness:.4g} N m/rad of the tyres, got {total:.4g} from the test; check load, shift,"
            f" roll angle and {path}.tyre_roll_stiffness"
        )
    relative = [m.sigma / m.value for m in (test.load, test.shift, test.roll)]
    own = {f"{path}.roll_stiffness", f"{path}.tyre_roll_stiffness"}
    effects = [_effect(vehicle, unit.name, p, s) for p, s in sigmas.items() if s and p not in own]
    total_sigma = math.hypot(*(moment / test.roll.value * r for r in relative), *effects)
    suspension = 1 / (1 / total - 1 / group.tyre_roll_stiffness)
    values = {f"{path}.roll_stiffness": suspension}
    stated = {f"{path}.roll_stiffness": (suspension / total) ** 2 * total_sigma, f"{path}.tyre_roll_stiffness": 0.0}
    if test.displacement and test.height:
        y, z, roll = test.displacement, test.height, test.roll
        values[f"{unit.name}.roll_axis_height"] = z.value - y.value / roll.value
        terms = (z.sigma, y.sigma / roll.value, y.value * roll.sigma / roll.value**2)
        stated[f"{unit.name}.roll_axis_height"] = math.hypot(*terms)
    return vehicle.replace(values).with_stated(stated)


def stiffness_of_rest(vehicle: Vehicle, unit: str) -> float:
    """Roll moment per roll angle of a unit, N m/rad, without its own suspension: gravity, couplings, neighbours."""
    units, couplings = vehicle.units, vehicle.couplings
    p, i = vehicle.parameters(), [u.name for u in units].index(unit)
    before = after = 0.0
    for k in range(i):
        before = _in_series(_own(p, units[k]) + before, couplings[k].roll_stiffness)
    for k in range(len(units) - 1, i, -1):
        after = _in_series(_own(p, units[k]) + after, couplings[k - 1].roll_stiffness)
    return before + after + _gravity(p, units[i])


def _own(p: Mapping[str, float], unit: Unit) -> float:
    """Roll moment per roll angle of a unit that stands alone, N m/rad."""
    return sum(group.total_roll_stiffness for group in unit.axle_groups) + _gravity(p, unit)


def _gravity(p: Mapping[str, float], unit: Unit) -> float:
    body = laden(p, unit)
    moment: float = body.mass * STANDARD_GRAVITY * (body.cog_height - unit.roll_axis_height)
    return -moment


def _in_series(a: float, b: float) -> float:
    return a * b / (a + b) if a + b else 0.0


def _effect(vehicle: Vehicle, unit: str, path: str, sigma: float) -> float:
    """Change of `stiffness_of_rest` by one standard deviation of a parameter, N m/rad."""
    value = vehicle.parameters()[path]
    higher, lower = (stiffness_of_rest(vehicle.replace({path: value + step * sigma}), unit) for step in (STEP, -STEP))
    return (higher - lower) / (2 * STEP)


def _check_readings(test: RollTest) -> None:
    """Raise where a reading is not above 0, the roll angle is too large, or one of two readings is missing."""
    for name, (value, _) in (("load", test.load), ("shift", test.shift), ("roll", test.roll)):
        if not value > 0:
            raise VehicleError(f"{name}: expected above 0, got {value:g}; give the magnitude of the change")
    if test.roll.value > MAX_ROLL:
        raise VehicleError(f"roll: expected at most 5 deg, got {math.degrees(test.roll.value):.1f} deg; check its unit")
    if (test.displacement is None) != (test.height is None):
        raise VehicleError("displacement: expected with height, got one of them; give both, or neither")
