"""Static loads of axle groups, and mass, CoG height and roll inertia of laden sprung bodies.

The former follow from the equilibrium of each unit, the latter are equations (8) and (9) of C. Cheng, D. Cebon,
"Parameter and state estimation for articulated heavy vehicles", Vehicle System Dynamics 49 (2011). The functions use
only + - * /, so they accept floats, NumPy arrays and CasADi symbols.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from fifthwheel.base.errors import VehicleError
from fifthwheel.base.names import ParameterPath
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.truck.unit import AxleGroup, Coupling, Unit


class SupportedBody(NamedTuple):
    """What the static loads of a unit depend on."""

    name: str
    mass: Any  # kg
    cog: Any  # m
    groups: Mapping[str, Any]
    """Position of each axle group, the mean of its axles on the road, m, by its path."""
    has_front_support: bool = True
    """Whether the coupling in front carries vertical load; a hinged drawbar carries none."""


class Joint(NamedTuple):
    """What the static loads depend on of a coupling."""

    leading: Any  # m, on the unit in front
    trailing: Any  # m, on the unit behind
    pitches: bool = True  # whether it is free in pitch


def group_position(p: Mapping[str, Any], unit: Unit, group: AxleGroup) -> Any:
    """Mean x of the axles on the road of a group, m."""
    return sum(p[f"{unit.name}.{axle.name}.position"] for axle in group.on_road) / len(group.on_road)


def axle_loads(p: Mapping[str, Any], units: Sequence[Unit], couplings: Sequence[Coupling]) -> dict[str, Any]:
    """Vertical load of each axle group of a vehicle by its path, N; see `static_axle_loads`, also for the error.

    p has the parameters by path, numbers or symbols; units and couplings give names and structure only.
    """
    bodies = [
        SupportedBody(
            unit.name,
            p[f"{unit.name}.mass"],
            p[f"{unit.name}.cog"],
            {unit.group_path(group): group_position(p, unit, group) for group in unit.axle_groups},
        )
        for unit in units
    ]
    joints = [Joint(p[f"{c.name}.leading_position"], p[f"{c.name}.trailing_position"], c.pitches) for c in couplings]
    return static_axle_loads(bodies, joints)


def static_axle_loads(units: Sequence[SupportedBody], joints: Sequence[Joint]) -> dict[str, Any]:
    """Vertical load of each axle group, N, by its path, front to rear, on level ground.

    The supports of a unit are its axle groups, at the mean position of their axles, and its front coupling. They carry
    its weight and the load of the unit behind. The moments are solved from the last unit to the first. Two units whose
    joint is not free in pitch are one body, with the axle groups of both as its supports. Units and joints are in the
    order from front to rear. A VehicleError if a unit does not have exactly two supports at two positions, so its loads
    are not determined.
    """
    units, joints = _joined(units, joints)
    loads: dict[str, Any] = {}
    coupling_load, coupling_position = 0.0, 0.0  # load of the unit behind on this unit, N, and its x, m
    for i in reversed(range(len(units))):
        unit = units[i]
        supports = dict(unit.groups)
        if i and unit.has_front_support:
            supports = {"": joints[i - 1].trailing, **supports}
        if len(supports) != 2:
            raise VehicleError(
                f"{unit.name}: expected two supports among its front coupling and its axle groups, got {len(supports)};"
                " only then do moments determine the axle loads; put axles that share their load in one group"
            )
        (first, a), (second, b) = supports.items()
        weight = unit.mass * STANDARD_GRAVITY
        try:
            first_load = (weight * (unit.cog - b) + coupling_load * (coupling_position - b)) / (a - b)
        except ZeroDivisionError:
            raise VehicleError(
                f"{unit.name}: expected supports at two positions, got both at {a:g} m; move one"
            ) from None
        unit_loads = {first: first_load, second: weight + coupling_load - first_load}
        if i:
            coupling_load, coupling_position = unit_loads.pop("", 0.0), joints[i - 1].leading
        loads = unit_loads | loads
    return loads


def _joined(units: Sequence[SupportedBody], joints: Sequence[Joint]) -> tuple[list[SupportedBody], list[Joint]]:
    """The bodies that pitch on their own, and the joints between them."""
    bodies, between = list(units), list(joints)
    for i in reversed(range(len(between))):
        joint = between[i]
        if joint.pitches:
            continue
        front, rear, shift = bodies[i], bodies.pop(i + 1), joint.leading - joint.trailing
        del between[i]
        mass = front.mass + rear.mass
        bodies[i] = SupportedBody(
            name=front.name,
            mass=mass,
            cog=(front.mass * front.cog + rear.mass * (rear.cog + shift)) / mass,
            groups={**front.groups, **{path: x + shift for path, x in rear.groups.items()}},
            has_front_support=False,
        )
        if i < len(between):
            between[i] = between[i]._replace(leading=between[i].leading + shift)
    return bodies, between


class Laden(NamedTuple):
    """The sprung body with its payload; numbers, arrays or symbols."""

    mass: Any
    """kg."""
    cog_height: Any
    """Above the ground, m."""
    roll_inertia: Any
    """About the roll axis, kg m^2."""


def laden(p: Mapping[str, Any], unit: Unit) -> Laden:
    """Laden sprung mass, CoG height and roll inertia of a unit: equations (8) and (9).

    The CoG of a payload is at half its height above the floor. A point mass has no term (D_p^2 + h_p^2) / 12. p has the
    parameters by path; the unit gives its name and the shape of the payload, its numbers are not used.
    """
    mass, cog_height = p[f"{unit.name}.sprung.mass"], p[f"{unit.name}.sprung.cog_height"]
    roll_axis = p[f"{unit.name}.roll_axis_height"]
    lever = cog_height - roll_axis
    inertia = p[f"{unit.name}.sprung.roll_inertia"] + mass * (lever * lever)
    if unit.payload is None:
        return Laden(mass, cog_height, inertia)
    load, height, width, floor = (
        p[f"{unit.name}.payload.{key}"] for key in ("mass", "height", "width", "floor_height")
    )
    cog, lever = floor + height / 2, floor + height / 2 - roll_axis
    inertia = inertia + load * (lever * lever)
    if unit.payload.shape == "uniform":
        inertia = inertia + load * (width * width + height * height) / 12
    return Laden(mass + load, (cog_height * mass + cog * load) / (mass + load), inertia)


def unit_cog_height(p: Mapping[str, Any], unit: Unit) -> Any:
    """CoG height of a laden unit above the ground, m, with its unsprung mass at the height of the roll axis; else as
    `laden`.
    """
    body = laden(p, unit)
    sprung = body.mass / p[f"{unit.name}.mass"]
    return sprung * body.cog_height + (1 - sprung) * p[f"{unit.name}.roll_axis_height"]


def lumped_sigmas(stated: Mapping[str, float], unit: str, paths: Iterable[str]) -> dict[str, float]:
    """Stated standard deviations once the payload of a unit is lumped into its sprung body; see `Vehicle.lumped`."""
    body, payload = f"{unit}.sprung", f"{unit}.payload"
    inputs = [p for p in paths if ParameterPath.of(p).owner in (body, payload) or p == f"{unit}.roll_axis_height"]
    replaced = {f"{body}.{key}" for key in ("mass", "cog_height", "roll_inertia")}
    lumped = {path: s for path, s in stated.items() if path not in replaced and ParameterPath.of(path).owner != payload}
    masses = [stated[path] for path in (f"{body}.mass", f"{payload}.mass") if path in stated]
    if len(masses) == 2:
        lumped[f"{body}.mass"] = math.hypot(*masses)
    if all(stated.get(path) == 0 for path in inputs):
        lumped |= dict.fromkeys(replaced, 0.0)
    return lumped
