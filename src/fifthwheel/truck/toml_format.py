"""Vehicle files: TOML with quantities such as "475 kN/rad +- 10 %"; examples/every_key.toml has every key."""

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import tomli_w

from fifthwheel.base.errors import FifthwheelError, UnitError, VehicleError, suggestion
from fifthwheel.base.input_files import parse_toml, read_toml
from fifthwheel.base.units import uncertain_quantity
from fifthwheel.truck.component import Component
from fifthwheel.truck.driveline import Driveline
from fifthwheel.truck.quantities import unit_of
from fifthwheel.truck.steering import STEERING, stated_steering
from fifthwheel.truck.unit import Accelerometer, Axle, AxleGroup, Coupling, Payload, SprungMass, Unit

Table = dict[str, Any]

FILE_KEYS = {
    "units": "unit",
    "couplings": "coupling",
    "axle_groups": "axle_group",
    "stated": "exact",
    "vehicle_class": "class",
}
"""Key in a file of each field that has another one. For several tables it is the singular, because TOML repeats the
header for each table. A file states standard deviations beside the values, or that all of them are 0."""


def read(path: Path) -> str:
    """The text of a vehicle file; a VehicleError if it cannot be read."""
    try:
        return read_toml(path)
    except FifthwheelError as error:
        raise VehicleError(f"{error}; a vehicle file in TOML expected") from None


def parse(text: str, vehicle: type[Component]) -> tuple[Table, bool]:
    """Fields of a vehicle, which its class has, and whether all its numbers are exact.

    A VehicleError for a text that is not TOML, an unknown key, or a value that is no quantity of its unit.
    """
    try:
        table = parse_toml(text)
    except FifthwheelError as error:
        raise VehicleError(f"expected TOML, got {error}; correct that line") from None
    stated: dict[str, float] = {}
    fields = _fields(table, "", vehicle, stated)
    exact = fields.pop("stated", False)
    if not isinstance(exact, bool):
        raise VehicleError(f"exact: expected true or false, got {exact!r}; write exact = true, or omit the key")
    fields["units"] = [_unit(unit, f"unit[{i}]", stated) for i, unit in enumerate(_tables(fields, "units", ""))]
    fields["couplings"] = [
        _fields(coupling, _name(coupling, Coupling.model_fields["name"].default), Coupling, stated)
        for coupling in _tables(fields, "couplings", "")
    ]
    if "driveline" in fields:
        fields["driveline"] = _fields(_table(fields["driveline"], "driveline"), "driveline", Driveline, stated)
    if STEERING in fields:
        fields[STEERING], sigmas = stated_steering(_table(fields[STEERING], STEERING))
        stated |= sigmas
    for path, sigma in stated.items() if exact else ():
        if sigma:
            raise VehicleError(
                f"{path}: expected no '+-' where exact = true, got {sigma:g} {unit_of(path)}; remove one of them"
            )
    return {**fields, "stated": stated}, exact


def dump(fields: Table) -> str:
    """Fields of a vehicle as TOML; numbers are texts with their units."""
    table: Table = _file_value(fields)
    return tomli_w.dumps(table)


def text(value: float, si: str, sigma: float | None) -> str:
    """A number as it stands in a file."""
    unit = "" if si == "1" else f" {si}"
    stated = "" if sigma is None else f" +- {sigma!r}{unit}" if sigma else " exact"
    return f"{value!r}{unit}{stated}"


def _file_value(value: Any) -> Any:
    """Fields in the form of a file: with its keys, and without those that have no value."""
    if isinstance(value, dict):
        return {
            FILE_KEYS.get(k, k): _file_value(v)
            for k, v in value.items()
            if v is not None and v != {} and (k, v) != ("lifted", False)
        }
    return [_file_value(item) for item in value] if isinstance(value, (list, tuple)) else value


def _unit(table: Table, label: str, stated: dict[str, float]) -> Table:
    """Fields of a unit; `label` names it in messages if it has no name."""
    path = _name(table, label)
    fields = _fields(table, path, Unit, stated)
    for key, kind in (("sprung", SprungMass), ("payload", Payload), ("accelerometer", Accelerometer)):
        if key in fields:
            fields[key] = _fields(_table(fields[key], f"{path}.{key}"), f"{path}.{key}", kind, stated)
    if "accelerometers" in fields:
        places = f"{path}.accelerometers"
        fields["accelerometers"] = {
            name: _fields(_table(table, f"{places}.{name}"), f"{places}.{name}", Accelerometer, stated)
            for name, table in _table(fields["accelerometers"], places).items()
        }
    groups = _tables(fields, "axle_groups", path)
    fields["axle_groups"] = [_group(group, path, stated, only=len(groups) == 1) for group in groups]
    _require_plausible_axles(path, fields["axle_groups"])
    return fields


def _group(file_table: Table, unit: str, stated: dict[str, float], *, only: bool) -> Table:
    """Fields of an axle group; `only` where the unit has no other, so that its paths do not contain its name."""
    path = unit if only else f"{unit}.{_name(file_table, AxleGroup.model_fields['name'].default)}"
    axle: Table = {key: value for key, value in file_table.items() if key in Axle.model_fields and key != "name"}
    table: Table = {key: value for key, value in file_table.items() if key not in axle}
    if axle and "axles" in table:
        raise VehicleError(f"{path}: expected either axles or {' and '.join(axle)}, got both; keep one")
    fields = _fields(table, path, AxleGroup, stated)
    axles = [axle] if axle else _tables(fields, "axles", path)
    fields["axles"] = [_fields(a, f"{unit}.{_name(a, _name(table, 'axles'))}", Axle, stated) for a in axles]
    return fields


def _fields(table: Table, path: str, kind: type[Component], stated: dict[str, float]) -> Table:
    """The keys of a component as its fields, quantities in SI; the standard deviations are added to `stated`."""
    fields = {FILE_KEYS.get(field, field): field for field in kind.model_fields}
    prefix = f"{path}." if path else ""
    for key in table:
        if key not in fields:
            raise VehicleError(f"{prefix}{key}: no such key; {suggestion(key, fields)}")
    values: Table = {}
    for key, value in table.items():
        if key in kind.si_units:
            value, sigma = read_quantity(value, kind.si_units[key], f"{prefix}{key}")
            kind.require_plausible(key, value, path=f"{prefix}{key}", written=table[key])
            if sigma is not None:
                stated[f"{prefix}{key}"] = sigma
        values[fields[key]] = value
    return values


def _require_plausible_axles(unit: str, groups: list[Table]) -> None:
    """Raise a VehicleError where neighbouring axles of a unit are too close, or those of a group too far apart."""
    axles = [
        (axle["position"], k, axle.get("name", group.get("name", "axle")))
        for k, group in enumerate(groups)
        for axle in group["axles"]
        if isinstance(axle.get("position"), float)
    ]
    for (rear, k_rear, name_rear), (front, k_front, name_front) in pairwise(sorted(axles)):
        low, high = _AXLE_DISTANCES if k_rear == k_front else (_AXLE_DISTANCES[0], _UNIT_LENGTH)
        if not low <= front - rear <= high:
            raise VehicleError(
                f"{unit}: expected {low:g} to {high:g} m between neighbouring axles, got {front - rear:.4g} m between"
                f" {name_front} and {name_rear}; check their positions, m, positive forward"
            )


_AXLE_DISTANCES = (0.5, 6.0)
"""Between neighbouring axles of a group, m."""
_UNIT_LENGTH = 25.0
"""Largest distance of neighbouring axles of a unit, m."""
_CURES = {
    "N/rad": "give the side force per slip angle, the total of the group's axles",
    "N m/rad": "give the moment per angle; two springs of k N/m, each y m from the middle, have 2 k y^2",
}


def read_quantity(value: Any, si: str, path: str) -> tuple[float, float | None]:
    """A value of a vehicle file and its stated standard deviation, in the SI unit `si`.

    The value is a number in `si`, or a text as in `units.uncertain_quantity`. An angle is a dimension: N is not
    accepted for N/rad. A VehicleError begins with the path.
    """
    try:
        return uncertain_quantity(value, si, strict=True)
    except UnitError as error:
        cure = f"; {_CURES[si]}" if si in _CURES else ""
        raise VehicleError(f"{path}: {error}{cure}") from None


def _name(table: Mapping[str, Any], label: str) -> str:
    """Name of a table in messages: its own name, or the label if it has none."""
    name = table.get("name")
    return name if isinstance(name, str) else label


def _tables(fields: Table, field: str, path: str) -> list[Table]:
    """The array of tables of a field; empty if the key is missing."""
    key, tables = FILE_KEYS.get(field, field), fields.get(field, [])
    path = f"{path}.{key}" if path else key
    if not isinstance(tables, list):
        raise VehicleError(f"{path}: expected an array of tables, got {tables!r}; write [[{key}]], or a list")
    return [_table(table, path) for table in tables]


def _table(value: Any, path: str) -> Table:
    if not isinstance(value, dict):
        raise VehicleError(f"{path}: expected a table, got {value!r}; give its keys and values")
    return value
