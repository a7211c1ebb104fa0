"""A vehicle as a TOML file: units written out, '475 kN/rad', plain numbers taken as SI.

name = "my truck"
source = "workshop, 3 May"

[[unit]]
name = "tractor"
mass = "7.2 t"
...
[unit.sprung]
...
[[unit.axle_group]]
name = "front"
position = "0 m"          # one axle; several are axles = [{ name = "front", position = "-6.7 m" }, ...]
steerable = true
...
[[coupling]]
...
"""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import tomli_w

from fifthwheel.errors import VehicleError
from fifthwheel.vehicle.part import suggestion
from fifthwheel.vehicle.paths import SI_UNITS
from fifthwheel.vehicle.quantity import quantity
from fifthwheel.vehicle.unit import Axle, AxleGroup, Payload, SprungMass, Unit
from fifthwheel.vehicle.vehicle import Coupling, Vehicle
from fifthwheel.whole import whole

Table = dict[str, Any]

IN_FILE = {"units": "unit", "couplings": "coupling", "axle_groups": "axle_group"}
"""Fields whose key in a file is the singular, since TOML repeats the header for each of them."""


def load(path: str | Path) -> Vehicle:
    """The vehicle in a TOML file."""
    try:
        text = Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise VehicleError(f"{path}: expected a readable TOML file of UTF-8, got {error}; check the path") from None
    try:
        return loads(text)
    except VehicleError as error:
        raise VehicleError(f"{path}: {error}") from None


def loads(text: str) -> Vehicle:
    """The vehicle in a TOML text."""
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise VehicleError(f"expected TOML, got {error}; correct that line") from None
    fields = _fields(table, "", Vehicle)
    fields["units"] = [_unit(unit, f"unit[{i}]") for i, unit in enumerate(_tables(fields, "units", ""))]
    fields["couplings"] = [
        _fields(coupling, _name(coupling, f"coupling[{i}]"), Coupling)
        for i, coupling in enumerate(_tables(fields, "couplings", ""))
    ]
    return Vehicle(**fields)


def save(vehicle: Vehicle, path: str | Path) -> None:
    """Write the vehicle to a TOML file that load() reads back equal."""
    with whole(path) as part:
        part.write_text(dump(vehicle), encoding="utf-8")


def dump(vehicle: Vehicle) -> str:
    """The vehicle as TOML, SI units written out; loads() reads it back equal."""
    table: Table = _written(vehicle.model_dump(exclude_none=True))
    return tomli_w.dumps(table)


def _written(value: Any, key: str = "") -> Any:
    """Fields as a file has them: singular headers, values with their units."""
    if isinstance(value, dict):
        return {IN_FILE.get(k, k): _written(v, k) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_written(item) for item in value]
    return f"{value!r} {SI_UNITS[key]}" if key in SI_UNITS else value


def _unit(table: Table, where: str) -> Table:
    path = _name(table, where)
    fields = _fields(table, path, Unit)
    for key, kind in (("sprung", SprungMass), ("payload", Payload)):
        if key in fields:
            fields[key] = _fields(_table(fields[key], f"{path}.{key}"), f"{path}.{key}", kind)
    groups = _tables(fields, "axle_groups", path)
    fields["axle_groups"] = [_group(group, path, alone=len(groups) == 1) for group in groups]
    return fields


def _group(written: Table, unit: str, *, alone: bool) -> Table:
    path = unit if alone else f"{unit}.{_name(written, 'axle_group')}"
    axle: Table = {key: written[key] for key in ("position", "steerable") if key in written}
    table: Table = {key: value for key, value in written.items() if key not in axle}
    if axle and "axles" in table:
        raise VehicleError(f"{path}: expected either axles or {' and '.join(axle)}, got both; keep one")
    fields = _fields(table, path, AxleGroup)
    axles = [axle] if axle else _tables(fields, "axles", path)
    fields["axles"] = [_fields(a, f"{unit}.{_name(a, _name(table, 'axles'))}", Axle) for a in axles]
    return fields


def _fields(
    table: Table, path: str, kind: type[Vehicle | Unit | SprungMass | Payload | AxleGroup | Axle | Coupling]
) -> Table:
    """A table with the keys of the model and its quantities in SI."""
    known = {IN_FILE.get(field, field): field for field in kind.model_fields}
    prefix = f"{path}." if path else ""
    for key in table:
        if key not in known:
            raise VehicleError(f"{prefix}{key}: no such key; {suggestion(key, known)}")
    return {
        known[key]: quantity(value, unit=SI_UNITS[key], path=f"{prefix}{key}") if key in SI_UNITS else value
        for key, value in table.items()
    }


def _name(table: Mapping[str, Any], otherwise: str) -> str:
    """How a message calls a table: its name if it has one."""
    name = table.get("name")
    return name if isinstance(name, str) else otherwise


def _tables(fields: Table, field: str, path: str) -> list[Table]:
    """The array of tables of a field; none where it is not given."""
    key, tables = IN_FILE.get(field, field), fields.get(field, [])
    where = f"{path}.{key}" if path else key
    if not isinstance(tables, list):
        raise VehicleError(f"{where}: expected an array of tables, got {tables!r}; write [[{key}]], or a list")
    return [_table(table, where) for table in tables]


def _table(value: Any, path: str) -> Table:
    if not isinstance(value, dict):
        raise VehicleError(f"{path}: expected a table, got {value!r}; give its keys and values")
    return value
