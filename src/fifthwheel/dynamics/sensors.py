"""What sensors on a unit see of the chain's motion, as expressions of the state.

A sensor is named quantity.unit. Its own errors are parameters too: it shows <sensor>.gain times the quantity, plus
<sensor>.offset. Where a quantity depends on the place, <sensor>.position (x on the unit, m) and <sensor>.height (above
the ground, m) say where.
"""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import casadi as ca

from fifthwheel.dynamics.chain import BANK, Motion
from fifthwheel.dynamics.unit import mass_matrix, tyre_forces
from fifthwheel.errors import SignalError
from fifthwheel.vehicle import Vehicle
from fifthwheel.vehicle.statics import STANDARD_GRAVITY as GRAVITY


class View(NamedTuple):
    """All that a sensor may look at."""

    p: Mapping[str, ca.SX]
    vehicle: Vehicle
    motion: Motion
    acceleration: tuple[ca.SX, ...]  # of each unit: (a, r', p'), a = v' + u r
    speed: ca.SX
    steer: Mapping[str, ca.SX]
    roll: bool


def _lateral_velocity(view: View, i: int, name: str) -> ca.SX:
    unit = view.vehicle.units[i].name
    arm = view.p[f"{name}.position"] - view.p[f"{unit}.cog"]
    above = view.p[f"{name}.height"] - view.p[f"{unit}.roll_axis_height"]
    return view.motion.v[i] + arm * view.motion.r[i] - above * view.motion.roll_rate[i]


def _sideslip(view: View, i: int, name: str) -> ca.SX:
    return _lateral_velocity(view, i, name) / view.speed


def _lateral_acceleration(view: View, i: int, name: str) -> ca.SX:
    """As an accelerometer fixed to the sprung body shows it: it leans, and so sees g times the roll angle and bank."""
    unit = view.vehicle.units[i].name
    arm = view.p[f"{name}.position"] - view.p[f"{unit}.cog"]
    above = view.p[f"{name}.height"] - view.p[f"{unit}.roll_axis_height"]
    a = view.acceleration[i]
    seen = a[0] + arm * a[1] + GRAVITY * view.motion.bank
    return seen - above * a[2] + GRAVITY * view.motion.roll[i] if view.roll else seen


def _articulation(view: View, i: int, name: str) -> ca.SX:
    if i == 0:
        raise SignalError(f"{name}: the first unit has no articulation angle; name a unit behind a coupling")
    return view.motion.heading[i] - view.motion.heading[i - 1]


def _coupling_force(view: View, i: int, name: str) -> ca.SX:
    """Side force of the coupling on the unit behind it, N: what the units from there on need besides their tyres."""
    if i == 0:
        raise SignalError(f"{name}: nothing is coupled in front of the first unit; name a unit behind a coupling")
    total = ca.SX(0)
    for k in range(i, len(view.vehicle.units)):
        unit, motion = view.vehicle.units[k], view.motion
        row = mass_matrix(view.p, unit, roll=view.roll)[0, :]
        inertia = row @ view.acceleration[k] + row[0] * GRAVITY * motion.bank
        going = (motion.across[k], motion.heading[k], motion.r[k], view.steer)
        tyres = tyre_forces(view.p, unit, *going, 1 / view.speed, motion.slip)[0]
        total += inertia - tyres
    return total


QUANTITIES: dict[str, tuple[str, bool, Callable[[View, int, str], ca.SX]]] = {
    "yaw_rate": ("rad/s", False, lambda view, i, _: view.motion.r[i]),
    "roll_rate": ("rad/s", False, lambda view, i, _: view.motion.roll_rate[i]),
    "roll": ("rad", False, lambda view, i, _: view.motion.roll[i]),
    "articulation": ("rad", False, _articulation),
    "sideslip": ("rad", True, _sideslip),
    "lateral_velocity": ("m/s", True, _lateral_velocity),
    "lateral_acceleration": ("m/s^2", True, _lateral_acceleration),
    "coupling_force": ("N", False, _coupling_force),
}
"""Quantity: its SI unit, whether it depends on the place, and its expression."""

NEEDS_ROLL = frozenset({"roll_rate", "roll"})


def unit_index(vehicle: Vehicle, name: str) -> int:
    """Which unit a signal belongs to.

    Raises:
        SignalError: the quantity or the unit is not one of the vehicle's.
    """
    quantity, _, rest = name.partition(".")
    unit = rest.partition(".")[0]
    names = [u.name for u in vehicle.units]
    if quantity not in QUANTITIES:
        raise SignalError(f"{name}: no such quantity; known are {', '.join(QUANTITIES)}")
    if unit not in names:
        raise SignalError(f"{name}: {vehicle.name} has no unit {unit!r}; it has {', '.join(names)}")
    return names.index(unit)


def sensor_parameters(vehicle: Vehicle, name: str) -> dict[str, float]:
    """The sensor's own parameters and their defaults: no error, on the roll axis under the CoG."""
    if name == BANK:
        return {}
    unit = vehicle.units[unit_index(vehicle, name)]
    own = {f"{name}.gain": 1.0, f"{name}.offset": 0.0}
    if QUANTITIES[name.partition(".")[0]][1]:
        own |= {f"{name}.position": unit.cog, f"{name}.height": unit.roll_axis_height}
    return own


def reading(view: View, name: str) -> ca.SX:
    """What the sensor shows, its errors included; of the road's bank, which no sensor shows, the state itself."""
    if name == BANK:
        return view.motion.bank
    i = unit_index(view.vehicle, name)
    return QUANTITIES[name.partition(".")[0]][2](view, i, name) * view.p[f"{name}.gain"] + view.p[f"{name}.offset"]
