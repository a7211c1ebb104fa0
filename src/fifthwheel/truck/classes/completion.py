"""The numbers that a vehicle file leaves to the class of a unit.

Masses follow from each other, inertias from masses and lengths, cornering stiffness from static axle loads.
"""

import copy
import math
from collections.abc import Mapping
from typing import Any

from fifthwheel.base.errors import VehicleError, suggestion
from fifthwheel.truck.axle_loads import Joint, SupportedBody, static_axle_loads
from fifthwheel.truck.classes.table import (
    CLASSES,
    DAMPING_TIME,
    LOAD_EXPONENT,
    RELAXATION_LENGTH,
    Figure,
    VehicleClass,
)

Table = dict[str, Any]

PAYLOAD_WIDTH = Figure(2.4, 0.15, "article 2.11 and 2.2 m, Auburn 2.4 m; inner width of a body up to 2.48 m")
PAYLOAD_HEIGHT = Figure(1.3, 0.5, "article 1.15 and 1.23, Auburn 1.5 m")
FLOOR_HEIGHT = Figure(1.22, 0.1, "article 1.2, Auburn 1.25 m")


def complete(fields: Mapping[str, Any]) -> Table:
    """Fields of a vehicle, as from `toml_format.parse`, with the missing numbers of each unit that has a class, and of
    the coupling in front of it; `stated` has the standard deviation of each filled number, and `assumed` its source.

    A relaxation length needs no class: all truck tyres have nearly the same. A file for tyres without lag says 0. A
    VehicleError if a class does not exist or has other axle groups, or a number is missing that no class can give.
    """
    completed = copy.deepcopy(dict(fields))
    units, couplings = completed["units"], completed["couplings"]
    completion = _Completion(completed["stated"], completed.setdefault("assumed", {}))
    for unit in units:
        for group in unit["axle_groups"] if "name" in unit else ():
            completion.figure(group, _group_path(unit, group), "relaxation_length", RELAXATION_LENGTH)
    if not any(_class_name(unit) for unit in units):
        return completed
    for i, unit in enumerate(units):
        name = _class_name(unit)
        if name:
            coupling = couplings[i - 1] if 0 < i <= len(couplings) else None
            _require(unit, ("name",), f"unit[{i}]")
            _complete_coupling(completion, coupling, CLASSES[name])
            _complete_unit(completion, unit, coupling)
    loads = _axle_loads(units, couplings)
    for unit in units:
        if name := _class_name(unit):
            _complete_groups(completion, unit, CLASSES[name], loads)
    return completed


class _Completion:
    """Fills numbers in, with standard deviation and source."""

    def __init__(self, stated: dict[str, float], assumed: dict[str, str]) -> None:
        self.stated, self.assumed = stated, assumed

    def fill(self, table: Table, path: str, key: str, value: float, sigma: float | None, source: str) -> None:
        """Give a key a value if it has none; without a standard deviation the defaults for the key hold."""
        if key in table:
            return
        table[key] = value
        self.assumed[f"{path}.{key}"] = source
        if sigma is not None:
            self.stated[f"{path}.{key}"] = sigma

    def figure(self, table: Table, path: str, key: str, figure: Figure, factor: float = 1.0) -> None:
        """The same with a figure times a factor."""
        self.fill(table, path, key, factor * figure.value, abs(factor) * figure.sigma, figure.source)

    def inertia(self, table: Table, path: str, key: str, gyration: Figure, mass: float, length: float = 1.0) -> None:
        """The same with the inertia of a mass, kg, whose radius of gyration is a figure times a length, m."""
        inertia = mass * (gyration.value * length) ** 2
        source = f"radius of gyration: {gyration.source}"
        self.fill(table, path, key, inertia, 2 * gyration.relative * inertia, source)


def _class_name(unit: Table) -> str:
    name = unit.get("vehicle_class")
    if name is not None and name not in CLASSES:
        raise VehicleError(f"{unit.get('name', 'unit')}.class: no class {name!r}; {suggestion(str(name), CLASSES)}")
    return name or ""


def _complete_coupling(completion: _Completion, coupling: Table | None, kind: VehicleClass) -> None:
    """Height and roll stiffness of the coupling in front of a unit. The coupling is the usual origin of such a unit."""
    if coupling is None or kind.coupling is None:
        return
    path = coupling.setdefault("name", "fifth_wheel")
    coupling.setdefault("kind", kind.coupling.kind)
    coupling.setdefault("trailing_position", 0.0)
    completion.figure(coupling, path, "height", kind.coupling.height)
    completion.figure(coupling, path, "roll_stiffness", kind.coupling.roll_stiffness)


def _complete_unit(completion: _Completion, unit: Table, coupling: Table | None) -> None:
    """Masses, CoG, inertias and heights of a unit and of its payload."""
    name, kind = unit["name"], CLASSES[unit["vehicle_class"]]
    groups = unit["axle_groups"]
    if len(groups) != len(kind.groups):
        raise VehicleError(
            f"{name}.axle_group: expected {len(kind.groups)} for the class {unit['vehicle_class']}"
            f" ({', '.join(kind.groups)}), got {len(groups)}; put the axles of a tandem or tridem in one group, or give"
            " another class"
        )
    for group in groups:
        for axle in group["axles"] or [{}]:
            _require(axle, ("position",), f"{name}.{axle.get('name', group.get('name', 'axles'))}")
    axles = [axle for group in groups for axle in group["axles"]]
    if kind.coupling is None or kind.steers_last:
        axles[-1 if kind.steers_last else 0].setdefault("steerable", True)
    reference = coupling["trailing_position"] if coupling else axles[0]["position"]
    others = axles if coupling else axles[len(groups[0]["axles"]) :]
    wheelbase = reference - sum(axle["position"] for axle in others) / len(others)
    _complete_masses(completion, unit, kind)
    cog = reference - kind.cog.value * wheelbase
    completion.fill(unit, name, "cog", cog, kind.cog.sigma * abs(wheelbase), kind.cog.source)
    completion.inertia(unit, name, "yaw_inertia", kind.body.yaw_gyration, unit["mass"], wheelbase)
    completion.figure(unit, name, "roll_axis_height", kind.body.roll_axis_height)
    sprung, body = unit["sprung"], f"{name}.sprung"
    completion.figure(sprung, body, "cog_height", kind.body.cog_height)
    completion.inertia(sprung, body, "roll_inertia", kind.body.roll_gyration, sprung["mass"])
    if payload := unit.get("payload"):
        path = f"{name}.payload"
        for key, figure in (("width", PAYLOAD_WIDTH), ("height", PAYLOAD_HEIGHT), ("floor_height", FLOOR_HEIGHT)):
            completion.figure(payload, path, key, figure)


def _complete_masses(completion: _Completion, unit: Table, kind: VehicleClass) -> None:
    """Mass of the unit, of its payload and of its sprung body: what is given gives the others."""
    name, payload, sprung = unit["name"], unit.get("payload"), unit.setdefault("sprung", {})
    unsprung, sigma_unsprung = kind.unsprung_mass(len(group["axles"]) for group in unit["axle_groups"])
    tare, sigma_tare, source = kind.tare
    if "mass" in sprung:
        tare, sigma_tare, source = sprung["mass"] + unsprung, sigma_unsprung, "sprung body and axles"
    if payload is None:
        completion.fill(unit, name, "mass", tare, sigma_tare, f"unladen: {source}")
    elif "mass" in unit:
        path, mass = f"{name}.payload", unit["mass"] - tare
        if "mass" not in payload and mass <= 0:
            raise VehicleError(
                f"{path}.mass: expected a value, because {name}.mass is {unit['mass']:g} kg and a unit of this class"
                f" has {tare:g} kg unladen; give it, or remove the payload"
            )
        completion.fill(payload, path, "mass", mass, sigma_tare, f"mass of the unit less its unladen mass: {source}")
    else:
        _require(payload, ("mass",), f"{name}.payload", "give it, or the mass of the laden unit")
        sigma = math.hypot(sigma_tare, completion.stated.get(f"{name}.payload.mass", 0.0))
        completion.fill(unit, name, "mass", tare + payload["mass"], sigma, f"payload and unladen mass: {source}")
    body = unit["mass"] - unsprung - (payload["mass"] if payload else 0.0)
    if "mass" not in sprung and body <= 0:
        raise VehicleError(
            f"{name}.mass: expected more than payload and axles, which have about {unit['mass'] - body:g} kg, got"
            f" {unit['mass']:g} kg; correct {name}.mass or {name}.payload.mass"
        )
    completion.fill(sprung, f"{name}.sprung", "mass", body, None, f"mass of the unit less {unsprung:g} kg of axles")


def _complete_groups(completion: _Completion, unit: Table, kind: VehicleClass, loads: Mapping[str, float]) -> None:
    """Stiffness and damping of the axle groups."""
    for group, (figures, _) in zip(unit["axle_groups"], kind.groups.values(), strict=True):
        path, count = _group_path(unit, group), len(_on_road(group))
        if loads[path] <= 0:
            raise VehicleError(
                f"{path}: expected a static load above 0, got {loads[path]:.0f} N; check the CoG of the units, and the"
                " positions of axles and couplings"
            )
        coefficient = figures.cornering_coefficient
        spread = LOAD_EXPONENT * math.log(loads[path] / (count * figures.nominal_load))
        stiffness = coefficient.value * loads[path]
        sigma = stiffness * math.hypot(coefficient.relative, spread)
        completion.fill(group, path, "cornering_stiffness", stiffness, sigma, coefficient.source)
        completion.figure(group, path, "roll_stiffness", figures.roll_stiffness, count)
        completion.figure(group, path, "tyre_roll_stiffness", figures.tyre_roll_stiffness, count)
        completion.figure(group, path, "roll_damping", DAMPING_TIME, group["roll_stiffness"])


def _axle_loads(units: list[Table], couplings: list[Table]) -> dict[str, float]:
    """Static axle loads from the fields; errors for numbers that they need."""
    bodies = []
    for unit in units:
        _require(unit, ("mass", "cog"), unit["name"], "give it, or give the unit a class")
        groups = {
            _group_path(unit, group): sum(axle["position"] for axle in _on_road(group)) / len(_on_road(group))
            for group in unit["axle_groups"]
        }
        bodies.append(SupportedBody(unit["name"], unit["mass"], unit["cog"], groups))
    if len(couplings) != len(units) - 1:
        raise VehicleError(
            f"coupling: expected {len(units) - 1} between {len(units)} units, got {len(couplings)}; give one for each"
            " pair of neighbours"
        )
    for coupling in couplings:
        _require(coupling, ("leading_position", "trailing_position"), coupling.get("name", "fifth_wheel"))
    joints = [Joint(c["leading_position"], c["trailing_position"], c.get("kind") != "turntable") for c in couplings]
    return static_axle_loads(bodies, joints)


def _on_road(group: Table) -> list[Table]:
    """The axles of a group that are not lifted; all of them where the group is refused, because none is on the road."""
    return [axle for axle in group["axles"] if axle.get("lifted") is not True] or group["axles"]


def _group_path(unit: Table, group: Table) -> str:
    return unit["name"] if len(unit["axle_groups"]) == 1 else f"{unit['name']}.{group.get('name', 'axles')}"


def _require(table: Table, keys: tuple[str, ...], path: str, cure: str = "give it") -> None:
    for key in keys:
        if key not in table:
            raise VehicleError(f"{path}.{key}: expected a value, got none; {cure}")
