"""Every scalar of a vehicle has a path, 'tractor.front.cornering_stiffness', and every path a unit."""

from collections.abc import Iterable

from fifthwheel.errors import VehicleError
from fifthwheel.vehicle.part import Part, suggestion
from fifthwheel.vehicle.unit import AxleGroup, SprungMass, Unit

SI_UNITS = {
    "mass": "kg",
    "cog": "m",
    "yaw_inertia": "kg m^2",
    "roll_axis_height": "m",
    "cog_height": "m",
    "roll_inertia": "kg m^2",
    "roll_yaw_product": "kg m^2",
    "height": "m",
    "width": "m",
    "floor_height": "m",
    "cornering_stiffness": "N/rad",
    "roll_stiffness": "N m/rad",
    "tyre_roll_stiffness": "N m/rad",
    "roll_damping": "N m s/rad",
    "relaxation_length": "m",
    "position": "m",
    "leading_position": "m",
    "trailing_position": "m",
}
"""Unit of each scalar, by the last word of its path."""

Place = tuple[str | int, ...]
"""Where a scalar is in the nested fields: ('units', 0, 'sprung', 'mass')."""


def unit_of(path: str) -> str:
    """SI unit of a parameter, for people: 'N/rad', 'kg m^2', 'm'."""
    word = path.rpartition(".")[2]
    if word not in SI_UNITS:
        raise VehicleError(f"{path}: expected the path of a parameter; {suggestion(word, SI_UNITS)}")
    return SI_UNITS[word]


def places(units: Iterable[Unit], couplings: Iterable[Part]) -> dict[str, Place]:
    """Path -> place of every scalar, in the order of the vehicle."""
    found: dict[str, Place] = {}

    def add(prefix: str, kind: type[Part], place: Place) -> None:
        found.update({f"{prefix}.{word}": (*place, word) for word in kind.model_fields if word in SI_UNITS})

    for i, unit in enumerate(units):
        here: Place = ("units", i)
        add(unit.name, Unit, here)
        add(f"{unit.name}.sprung", SprungMass, (*here, "sprung"))
        if unit.payload is not None:
            add(f"{unit.name}.payload", type(unit.payload), (*here, "payload"))
        for j, group in enumerate(unit.axle_groups):
            add(unit.group_path(group), AxleGroup, (*here, "axle_groups", j))
            for k, axle in enumerate(group.axles):
                add(f"{unit.name}.{axle.name}", type(axle), (*here, "axle_groups", j, "axles", k))
    for i, coupling in enumerate(couplings):
        add(str(getattr(coupling, "name")), type(coupling), ("couplings", i))  # noqa: B009
    return found
