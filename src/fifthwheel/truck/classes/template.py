"""Vehicle files to fill in: a vehicle as a TOML text with the source of each number.

Assumed numbers are comments, so that the classes give them. A line that is removed from its comment replaces the number
of the class. The other assumed numbers continue to follow from what the file states.
"""

from collections.abc import Iterator, Mapping
from typing import Any

from fifthwheel.base.errors import VehicleError, suggestion
from fifthwheel.base.formatting import digits, plain_ascii, shown, value_and_sigma
from fifthwheel.truck.catalogue import get
from fifthwheel.truck.classes.completion import complete
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
COLUMN = 60
"""Where comments begin."""


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


def _fields(unit: Unit, kind: str, sources: dict[str, str], name: str) -> dict[str, Any]:
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
        lines += ["", "[[unit]]", *_unit(unit, numbers)]
    for coupling in vehicle.couplings:
        lines += ["", "[[coupling]]", f'name = "{coupling.name}"', f'kind = "{coupling.kind}"']
        lines += numbers.lines(coupling.name, type(coupling))
    return "\n".join([*lines, ""])


def _unit(unit: Unit, numbers: "_Numbers") -> Iterator[str]:
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
        return f"{line:{COLUMN}s} # {comment}" if comment else line
