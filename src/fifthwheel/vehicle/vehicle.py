"""A vehicle: units in a chain, one coupling between each and the next."""

import functools
from collections.abc import Mapping
from itertools import pairwise
from typing import Any, Self

from pydantic import Field, model_validator

from fifthwheel.errors import VehicleError
from fifthwheel.vehicle.part import Name, NotNegative, Number, Part, suggestion
from fifthwheel.vehicle.paths import Place, places
from fifthwheel.vehicle.payload import laden
from fifthwheel.vehicle.statics import group_loads
from fifthwheel.vehicle.unit import Unit, reject_doubles

REACH_BEHIND = 10.0  # m: no coupling is farther behind the last axle of the unit in front
REACH_AHEAD = 25.0  # m: nor farther ahead of the last axle of the unit behind


class Coupling(Part):
    """A fifth wheel or a drawbar eye between a unit and the one behind it; it carries side force and roll moment."""

    name: Name = "fifth_wheel"
    leading_position: Number = Field(description="x on the unit in front, from that unit's origin, m.")
    trailing_position: Number = Field(description="x on the unit behind, from that unit's origin, m.")
    height: NotNegative = Field(description="Above the ground, m.")
    roll_stiffness: NotNegative = Field(description="Between the two sprung bodies, N m/rad; a drawbar eye has none.")
    roll_damping: NotNegative = Field(default=0.0, description="Between the two sprung bodies, N m s/rad.")


class Vehicle(Part):
    """Units from front to rear, and the couplings between them. Every scalar has a path; see parameters()."""

    name: str
    source: str = Field(default="", description="Where the numbers come from.")
    units: tuple[Unit, ...] = Field(min_length=1)
    couplings: tuple[Coupling, ...] = ()

    @classmethod
    def _prefix(cls, data: dict[str, Any]) -> str:
        return ""  # paths begin with the unit, not with the name of the vehicle

    @model_validator(mode="after")
    def _check(self) -> Self:
        if len(self.couplings) != len(self.units) - 1:
            raise VehicleError(
                f"couplings: expected {len(self.units) - 1} between {len(self.units)} units,"
                f" got {len(self.couplings)}; give one for each pair of neighbours"
            )
        reject_doubles("names of units and couplings", [u.name for u in self.units] + [c.name for c in self.couplings])
        for coupling, (front, rear) in zip(self.couplings, pairwise(self.units), strict=True):
            x, supports = coupling.leading_position, self._supports(front)
            reject_out_of_reach(f"{coupling.name}.leading_position", x, min(supports) - REACH_BEHIND, max(supports))
            x, last = coupling.trailing_position, min(axle.position for axle in rear.axles)
            reject_out_of_reach(f"{coupling.name}.trailing_position", x, last, last + REACH_AHEAD)
        for unit in self.units:
            supports = self._supports(unit)
            if not min(supports) <= unit.cog <= max(supports):
                raise VehicleError(
                    f"{unit.name}.cog: expected between {min(supports):g} and {max(supports):g} m, where the unit is"
                    f" supported, got {unit.cog:g} m; x is positive forward from the unit's own origin"
                )
        return self

    def _supports(self, unit: Unit) -> list[float]:
        """x of the axles of a unit and of its front coupling, m."""
        i = self.units.index(unit)
        ahead = [self.couplings[i - 1].trailing_position] if i else []
        return [axle.position for axle in unit.axles] + ahead

    def unit(self, name: str) -> Unit:
        """The unit of that name."""
        for unit in self.units:
            if unit.name == name:
                return unit
        raise VehicleError(f"{name}: no such unit in {self.name}; {suggestion(name, [u.name for u in self.units])}")

    def parameters(self) -> dict[str, float]:
        """Every scalar by its path, SI, in the order of the vehicle: 'tractor.front.cornering_stiffness': 4.75e5."""
        return dict(self._parameters)

    @functools.cached_property
    def _parameters(self) -> dict[str, float]:
        fields = self.model_dump()
        return {path: _owner(fields, place)[place[-1]] for path, place in places(self.units, self.couplings).items()}

    def replace(self, values: Mapping[str, float]) -> "Vehicle":
        """The same vehicle with other values at some paths, validated again."""
        fields, known = self.model_dump(), places(self.units, self.couplings)
        for path, value in values.items():
            if path not in known:
                raise VehicleError(f"{path}: no such parameter in {self.name}; {suggestion(path, known)}")
            _owner(fields, known[path])[known[path][-1]] = value
        return Vehicle(**fields)

    def lumped(self) -> "Vehicle":
        """The same vehicle with every payload made a part of its sprung body, about that body's own CoG: a load of any
        shape, whose CoG height and roll inertia are then two parameters."""
        p, fields = self.parameters(), self.model_dump()
        for unit in fields["units"]:
            if unit["payload"] is not None:
                body = laden(p, self.unit(unit["name"]))
                lever = body.cog_height - unit["roll_axis_height"]
                own = body.roll_inertia - body.mass * lever**2
                unit["sprung"] |= {"mass": body.mass, "cog_height": body.cog_height, "roll_inertia": own}
                unit["payload"] = None
        return Vehicle(**fields)

    def axle_loads(self) -> dict[str, float]:
        """Static vertical load of each axle group by its path, N, on level ground; see statics.group_loads."""
        return group_loads(self.units, [(c.leading_position, c.trailing_position) for c in self.couplings])

    @property
    def wheelbase(self) -> float:
        """From the first axle of the first unit to the mean of its other groups' axles, m."""
        front, *others = self.units[0].axle_groups
        rear = [axle.position for group in others for axle in group.axles] or [self.units[0].axles[-1].position]
        return front.axles[0].position - sum(rear) / len(rear)

    def steer_signals(self) -> tuple[str, ...]:
        """Names of the steer angles that are inputs of the vehicle, front to rear: 'steer.tractor.front'."""
        return tuple(f"steer.{unit.name}.{axle.name}" for unit in self.units for axle in unit.axles if axle.steerable)

    def derived(self) -> dict[str, float]:
        """For each unit, with its payload: <unit>.cog_height of the sprung body above the ground, m, and
        <unit>.roll_inertia of the sprung body about the roll axis, kg m^2; equations (8) and (9)."""
        p, found = self.parameters(), {}
        for unit in self.units:
            body = laden(p, unit)
            found[f"{unit.name}.cog_height"] = body.cog_height
            found[f"{unit.name}.roll_inertia"] = body.roll_inertia
        return found


def reject_out_of_reach(path: str, position: float, low: float, high: float) -> None:
    """Raise where a coupling is not between low and high on a unit."""
    if not low <= position <= high:
        raise VehicleError(
            f"{path}: expected between {low:g} and {high:g} m, given the unit's axles, got {position:g} m;"
            " x is positive forward, from the origin of that unit"
        )


def _owner(fields: Any, place: Place) -> Any:
    """The innermost mapping that holds the scalar at a place."""
    for key in place[:-1]:
        fields = fields[key]
    return fields
