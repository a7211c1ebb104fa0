"""Static vertical loads, by moments from the last unit of the chain to the first."""

from collections.abc import Sequence

from fifthwheel.errors import VehicleError
from fifthwheel.vehicle.unit import Unit

STANDARD_GRAVITY = 9.80665
"""m/s^2, exact by definition."""


def group_loads(units: Sequence[Unit], couplings: Sequence[tuple[float, float]]) -> dict[str, float]:
    """Vertical load of each axle group, N, by its path, front to rear.

    couplings holds the leading and the trailing position of each coupling, m. A unit stands on its axle groups, each at
    the mean position of its axles, and on the unit in front; it carries itself and the load of the unit behind.
    Two supports determine the loads, no more and no less.
    """
    loads: dict[str, float] = {}
    behind, behind_at = 0.0, 0.0  # load that the unit behind puts on this one, and where
    for i in reversed(range(len(units))):
        unit = units[i]
        supports = {unit.group_path(group): group.position for group in unit.axle_groups}
        if i:
            supports = {"": couplings[i - 1][1], **supports}
        if len(supports) != 2:
            raise VehicleError(
                f"{unit.name}: expected two supports among its front coupling and its axle groups, got {len(supports)};"
                " axle loads follow from moments only then; put axles that share their load in one group"
            )
        (first, a), (second, b) = supports.items()
        if a == b:
            raise VehicleError(f"{unit.name}: expected supports at two positions, got both at {a:g} m; move one")
        weight = unit.mass * STANDARD_GRAVITY
        on_first = (weight * (unit.cog - b) + behind * (behind_at - b)) / (a - b)
        here = {first: on_first, second: weight + behind - on_first}
        if i:
            behind, behind_at = here.pop(""), couplings[i - 1][0]
        loads = here | loads
    return loads
