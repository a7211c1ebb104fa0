"""Static vertical loads of the axle groups, from the equilibrium of each unit."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from fifthwheel.errors import VehicleError
from fifthwheel.units import STANDARD_GRAVITY


class Body(NamedTuple):
    """What the static loads of a unit depend on."""

    name: str
    mass: float  # kg
    cog: float  # m
    groups: Mapping[str, float]
    """Position of each axle group, the mean of its axles, m, by its path."""


def static_axle_loads(units: Sequence[Body], couplings: Sequence[tuple[float, float]]) -> dict[str, float]:
    """Vertical load of each axle group, N, by its path, front to rear, on level ground.

    The supports of a unit are its axle groups, at the mean position of their axles, and its front coupling. They carry
    its weight and the load of the unit behind. The moments are solved from the last unit to the first.

    Args:
        units: front to rear.
        couplings: leading and trailing position of each coupling, m.

    Raises:
        VehicleError: a unit does not have exactly two supports at two positions, so its loads are not determined.
    """
    loads: dict[str, float] = {}
    coupling_load, coupling_position = 0.0, 0.0  # load of the unit behind on this unit, N, and its x, m
    for i in reversed(range(len(units))):
        unit = units[i]
        supports = dict(unit.groups)
        if i:
            supports = {"": couplings[i - 1][1], **supports}
        if len(supports) != 2:
            raise VehicleError(
                f"{unit.name}: expected two supports among its front coupling and its axle groups, got {len(supports)};"
                " only then do moments determine the axle loads; put axles that share their load in one group"
            )
        (first, a), (second, b) = supports.items()
        if a == b:
            raise VehicleError(f"{unit.name}: expected supports at two positions, got both at {a:g} m; move one")
        weight = unit.mass * STANDARD_GRAVITY
        first_load = (weight * (unit.cog - b) + coupling_load * (coupling_position - b)) / (a - b)
        unit_loads = {first: first_load, second: weight + coupling_load - first_load}
        if i:
            coupling_load, coupling_position = unit_loads.pop(""), couplings[i - 1][0]
        loads = unit_loads | loads
    return loads
