"""Vehicle files as text: the catalogue, files to fill in, and files with other numbers.

The catalogue has vehicles with published numbers; the comments of each file give the origin of every value. In a file
to fill in, assumed numbers are comments, so that the classes give them. A line that is removed from its comment
replaces the number of the class. The other assumed numbers continue to follow from what the file states. A file with
other numbers keeps its comments and its order.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache
from importlib.resources import files
from typing import Any

from fifthwheel.base.errors import VehicleError, suggestion
from fifthwheel.base.formatting import digits, plain_ascii, shown, value_and_sigma
from fifthwheel.truck import toml_format
from fifthwheel.truck.classes import complete
from fifthwheel.truck.component import Component
from fifthwheel.truck.quantities import unit_of
from fifthwheel.truck.unit import AxleGroup, Unit
from fifthwheel.truck.vehicle import Vehicle

COMBINATIONS: Mapping[str, tuple[str, ...]] = {
    "b_double": ("tractor_6x4", "b_double_lead", "semitrailer_3"),
    "a_double": ("tractor_6x4", "semitrailer_3", "dolly", "semitrailer_3"),
    "truck_dolly_semitrailer": ("truck_6x2", "dolly", "semitrailer_3"),
    "truck_full_trailer": ("truck_6x2", "dolly", "full_trailer"),
}
"""Class of each unit, front to rear, by the name of a vehicle of the catalogue."""
_MINUS = str.maketrans({"\u2212": "-", "\u202f": "", "\u00a0": " "})
_COLUMN = 60
"""Where comments begin."""


def names() -> tuple[str, ...]:
    """Names of all vehicles in the catalogue, sorted."""
    folder = files(__package__) / "vehicles"
    return tuple(sorted(file.name.removesuffix(".toml") for file in folder.iterdir() if file.name.endswith(".toml")))


def get(name: str) -> Vehicle:
    """A vehicle of the catalogue.

    Raises:
        VehicleError: the catalogue has no vehicle of that name.

    Example:
        >>> import fifthwheel as fw
        >>> fw.vehicle("cheng_cebon_2011")
        Vehicle('cheng_cebon_2011', tractor + semitrailer, 40.6 t)
    """
    return Vehicle.loads(text(name))


@lru_cache
def text(name: str) -> str:
    """The TOML file of a vehicle with its comments, a template for other vehicles; errors as in `get`."""
    if name not in names():
        file = "; fw.Vehicle.load reads a file" if str(name).endswith(".toml") else ""
        raise VehicleError(f"{name}: no such vehicle in the catalogue; {suggestion(str(name), names())}{file}")
    return (files(__package__) / "vehicles" / f"{name}.toml").read_text(encoding="utf-8")


def template(name: str) -> str:
    """The text of a vehicle file like one of `COMBINATIONS`; each number says whether to replace it.

    A VehicleError if there is no combination of that name.
    """
    if name not in COMBINATIONS:
        raise VehicleError(f"{name}: no such combination; {suggestion(name, COMBINATIONS)}")
    like, sources = get(name), dict[str, str]()
    units = [_fields(unit, kind, sources, name) for unit, kind in zip(like.units, COMBINATIONS[name], strict=True)]
    couplings = []
    for coupling in like.couplings:
        couplings.append({"name": coupling.name, "leading_position": coupling.leading_position})
        sources[f"{coupling.name}.leading_position"] = _to_replace(name)
        sources[f"{coupling.name}.trailing_position"] = "the origin"
    fields = {
        "name": "truck",
        "source": f"lengths and masses of {name}, to be replaced; all else from classes",
        "units": units,
        "couplings": couplings,
        "stated": {},
    }
    return commented_toml(Vehicle(**complete(fields)), sources)


def _to_replace(name: str) -> str:
    return f"replace: that of {name}"


def _fields(unit: Unit, kind: str, sources: dict[str, str], name: str) -> dict[str, Any]:
    """Fields of a unit without the numbers that its class gives."""
    groups = [
        {"name": group.name, "axles": [{"name": a.name, "position": a.position} for a in group.axles]}
        for group in unit.axle_groups
    ]
    sources |= {f"{unit.name}.{axle.name}.position": _to_replace(name) for axle in unit.axles}
    fields: dict[str, Any] = {"name": unit.name, "vehicle_class": kind, "axle_groups": groups}
    if unit.payload:
        fields |= {"mass": unit.mass, "payload": {"mass": unit.payload.mass}}
        sources |= {f"{unit.name}.mass": _to_replace(name), f"{unit.name}.payload.mass": _to_replace(name)}
    return fields


def commented_toml(vehicle: Vehicle, sources: Mapping[str, str]) -> str:
    """The text, from which `Vehicle.loads` reads the vehicle with rounded numbers; `sources` are those of the numbers
    that are not assumed, by path. A number without a source is left out if it is the default."""
    lines = [
        "# Each number has its source behind it; the number after +- is one standard deviation. A key behind a # has",
        "# an assumed number, from the class of its unit and what the other lines state. To replace it, remove the #,",
        "# and write a measured value.",
        f'name = "{vehicle.name}"',
        f'source = "{vehicle.source}"',
    ]
    numbers = _Numbers(vehicle, sources)
    for unit in vehicle.units:
        lines += ["", "[[unit]]", *_unit_lines(unit, numbers)]
    for coupling in vehicle.couplings:
        lines += ["", "[[coupling]]", f'name = "{coupling.name}"', f'kind = "{coupling.kind}"']
        lines += numbers.lines(coupling.name, type(coupling))
    return "\n".join([*lines, ""])


def _unit_lines(unit: Unit, numbers: "_Numbers") -> Iterator[str]:
    yield f'name = "{unit.name}"'
    if unit.vehicle_class:
        yield f'class = "{unit.vehicle_class}"'
    yield from numbers.lines(unit.name, Unit)
    yield from ("", "[unit.sprung]")
    yield from numbers.lines(f"{unit.name}.sprung", type(unit.sprung))
    if unit.payload:
        yield from ("", "[unit.payload]")
        yield from numbers.lines(f"{unit.name}.payload", type(unit.payload))
        yield f'shape = "{unit.payload.shape}"'
    for group in unit.axle_groups:
        yield from ("", "[[unit.axle_group]]", f'name = "{group.name}"', "axles = [")
        for axle in group.axles:
            path = f"{unit.name}.{axle.name}"
            keys = [f'name = "{axle.name}"', f'position = "{numbers.text(f"{path}.position")}"']
            keys += [f"{key} = true" for key in ("steerable", "lifted") if getattr(axle, key)]
            steering = ("self_steering", "command_steering")
            keys += [f'{key} = "{numbers.text(f"{path}.{key}")}"' for key in steering if getattr(axle, key) is not None]
            text = f"  {{ {', '.join(keys)} }},"
            yield numbers.with_comment(text, numbers.sources.get(f"{path}.position", ""))
        yield "]"
        if group.driven:
            yield "driven = true"
        if group.tyres:
            yield f"tyres = {group.tyres}"
        yield from numbers.lines(unit.group_path(group), AxleGroup)


class _Numbers:
    """Numbers of a vehicle as lines of a file."""

    def __init__(self, vehicle: Vehicle, sources: Mapping[str, str]) -> None:
        self.vehicle, self.values, self.sources = vehicle, vehicle.parameters(), sources

    def lines(self, prefix: str, kind: type[Component]) -> Iterator[str]:
        """One line for each number of a component."""
        for key in kind.si_units:
            path = f"{prefix}.{key}"
            if path in self.vehicle.assumed:
                yield self.with_comment(f'# {key} = "{self.text(path)}"', self.vehicle.assumed[path])
            elif path in self.sources:
                yield self.with_comment(f'{key} = "{self.text(path)}"', self.sources[path])

    def text(self, path: str) -> str:
        """A number with its standard deviation, rounded to two digits of it, in a practical unit."""
        si = unit_of(path)
        unit = shown(si)
        sigma = self.vehicle.stated.get(path)
        value, spread = value_and_sigma(self.values[path] * unit.factor, (sigma or 0.0) * unit.factor)
        if spread is None:
            value = digits(self.values[path] * unit.factor, 6, exact=True)
        stated = f" +- {spread} {unit.name}" if spread else " exact" if sigma == 0 else ""
        return plain_ascii(f"{value} {unit.name}{stated}".translate(_MINUS))

    @staticmethod
    def with_comment(line: str, comment: str) -> str:
        """A line with the source of its number."""
        return f"{line:{_COLUMN}s} # {comment}" if comment else line


def edited(text: str, vehicle: Vehicle) -> str:
    """The text of a vehicle file with the numbers, standard deviations and source of another vehicle where they differ.

    If the text has other units, axle groups or payloads, the result is `vehicle.to_toml()`, without comments.
    """
    before = Vehicle.loads(text)
    if before.parameters().keys() != vehicle.parameters().keys() or vehicle.is_exact != before.is_exact:
        return vehicle.to_toml()
    changed = [
        path
        for path, value in vehicle.parameters().items()
        if (value, vehicle.stated.get(path)) != (before.parameters()[path], before.stated.get(path))
    ]
    result = with_numbers(text, vehicle, changed)
    return result if Vehicle.loads(result) == vehicle else vehicle.to_toml()


def with_numbers(text: str, vehicle: Vehicle, paths: Iterable[str]) -> str:
    """The text of a vehicle file with the name, the source and the numbers at `paths` of another vehicle of the same
    units; numbers that the classes give follow from them."""
    import tomlkit  # slow to import

    document = tomlkit.parse(text)
    document["name"] = vehicle.name
    if vehicle.source:
        document["source"] = vehicle.source
    values, locations, stated = vehicle.parameters(), vehicle.locations(), {} if vehicle.is_exact else vehicle.stated
    for path in paths:
        table: Any = document
        comment: Any = None
        *keys, last = locations[path]
        name = str(last)
        for key in keys:
            if key == "axles" and "axles" not in table:  # a single axle: its position stands in the group
                break
            comment = _comment_behind(table, key)
            table = table[toml_format.FILE_KEYS.get(key, key) if isinstance(key, str) else key]
        _replace_number(table, name, toml_format.text(values[path], unit_of(path), stated.get(path)), comment)
        if path in vehicle.assumed:
            document.setdefault("assumed", tomlkit.table())[path] = vehicle.assumed[path]
        elif path in document.get("assumed", {}):
            del document["assumed"][path]
    return tomlkit.dumps(document)


def _comment_behind(array: Any, key: str | int) -> Any:
    """The comment behind an inline table in an array; None where there is none."""
    from tomlkit.items import InlineTable

    groups = getattr(array, "_value", ()) if isinstance(key, int) else ()  # tomlkit has no public access to it
    tables = [group for group in groups if isinstance(group.value, InlineTable)]
    return tables[int(key)].comment if tables else None


def _replace_number(table: Any, key: str, text: str, behind: Any = None) -> None:
    """Give a key another text; its comment, or that `behind` an inline table, keeps the former number as a source."""
    import tomlkit
    from tomlkit.items import Comment, InlineTable

    item = tomlkit.string(text)
    if key in table:
        former = table.item(key)
        comment = (behind or former).trivia.comment.removeprefix("#").strip()
        was = f"was {former.as_string()}" + (f": {comment}" if comment else "")
        if behind:
            behind.trivia.comment = f"# {was}"
        elif not isinstance(table, InlineTable):
            item.comment(was)
        table[key] = item
        return
    for name, assumed in getattr(getattr(table, "value", table), "body", ()):
        words = assumed.trivia.comment.removeprefix("#").strip() if isinstance(assumed, Comment) else ""
        if name is None and (found := re.fullmatch(rf"{key} = (\"[^\"]*\")\s*(?:#\s*(.*))?", words)):
            assumed.trivia.indent = assumed.trivia.comment = assumed.trivia.trail = ""
            item.comment(f"was {found[1]}, assumed" + (f": {found[2]}" if found[2] else ""))
            break
    table[key] = item
