"""A vehicle file of a long combination to fill in: positions and masses of the catalogue, the rest from classes."""

from collections.abc import Mapping
from typing import Any

from fifthwheel.errors import VehicleError, suggestion
from fifthwheel.vehicle.catalogue import get
from fifthwheel.vehicle.classes.commented import commented_toml
from fifthwheel.vehicle.classes.completion import complete
from fifthwheel.vehicle.unit import Unit
from fifthwheel.vehicle.vehicle import Vehicle

COMBINATIONS: Mapping[str, tuple[str, ...]] = {
    "b_double": ("tractor_6x4", "b_double_lead", "semitrailer_3"),
    "a_double": ("tractor_6x4", "semitrailer_3", "dolly", "semitrailer_3"),
    "truck_dolly_semitrailer": ("truck_6x2", "dolly", "semitrailer_3"),
    "truck_full_trailer": ("truck_6x2", "dolly", "full_trailer"),
}
"""Class of each unit, front to rear, by the name of a vehicle of the catalogue."""


def template(name: str) -> str:
    """The text of a vehicle file like a long combination of the catalogue; each number says whether to replace it.

    Args:
        name: one of `COMBINATIONS`.

    Raises:
        VehicleError: there is no such combination.
    """
    if name not in COMBINATIONS:
        raise VehicleError(f"{name}: no such combination; {suggestion(name, COMBINATIONS)}")
    like, sources = get(name), dict[str, str]()
    units = [_unit(unit, kind, sources, name) for unit, kind in zip(like.units, COMBINATIONS[name], strict=True)]
    couplings = []
    for coupling in like.couplings:
        couplings.append({"name": coupling.name, "leading_position": coupling.leading_position})
        sources[f"{coupling.name}.leading_position"] = _replace(name)
        sources[f"{coupling.name}.trailing_position"] = "the origin"
    fields = {
        "name": "truck",
        "source": f"lengths and masses of {name}, to be replaced; all else from classes",
        "units": units,
        "couplings": couplings,
        "stated": {},
    }
    return commented_toml(Vehicle(**complete(fields)), sources)


def _replace(name: str) -> str:
    return f"replace: that of {name}"


def _unit(unit: Unit, kind: str, sources: dict[str, str], name: str) -> dict[str, Any]:
    """Fields of a unit without the numbers that its class gives."""
    groups = [
        {"name": group.name, "axles": [{"name": a.name, "position": a.position} for a in group.axles]}
        for group in unit.axle_groups
    ]
    sources |= {f"{unit.name}.{axle.name}.position": _replace(name) for axle in unit.axles}
    fields: dict[str, Any] = {"name": unit.name, "vehicle_class": kind, "axle_groups": groups}
    if unit.payload:
        fields |= {"mass": unit.mass, "payload": {"mass": unit.payload.mass}}
        sources |= {f"{unit.name}.mass": _replace(name), f"{unit.name}.payload.mass": _replace(name)}
    return fields
