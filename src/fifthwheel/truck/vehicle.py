"""A vehicle: a chain of units, with one coupling between each unit and the next."""

import functools
import math
from collections.abc import Callable, Container, Iterable, Mapping
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from pydantic import Field, model_validator

from fifthwheel.base.atomic import write_text
from fifthwheel.base.errors import SignalError, VehicleError, suggestion
from fifthwheel.base.names import ends_with
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.truck import toml_format
from fifthwheel.truck.classes import complete
from fifthwheel.truck.component import Component, NonNegatives, Texts
from fifthwheel.truck.driveline import Driveline
from fifthwheel.truck.loads import axle_loads, laden, lumped_sigmas, unit_cog_height
from fifthwheel.truck.quantities import unit_of
from fifthwheel.truck.steering import STEERING, Steering, stated_steering
from fifthwheel.truck.unit import AxleGroup, Coupling, SprungMass, Unit, require_unique

if TYPE_CHECKING:
    from fifthwheel.base.plots import Plot

MAX_UNITS = 8
"""The time to compile the model of more would be hours."""
MAX_COUPLING_OVERHANG = 10.0
"""Largest distance of a coupling behind the last axle of the unit in front, m."""
MAX_COUPLING_LEAD = 25.0
"""Largest distance of a coupling ahead of the last axle of the unit behind, m."""
LIFTING = 0.1
"""Largest distance of a CoG behind the last axle of a unit that thus lifts its front coupling, as the engine of a bus
does, as a fraction of the distance of the two."""

FieldLocation = tuple[str | int, ...]
"""Keys from the vehicle's fields to a scalar: ('units', 0, 'sprung', 'mass')."""


class Vehicle(Component):
    """Units from front to rear, and the couplings between them. Every scalar has a path; see `parameters`.

    Example:
        >>> import fifthwheel as fw
        >>> truck = fw.vehicle("cheng_cebon_2011")
        >>> truck
        Vehicle('cheng_cebon_2011', tractor + semitrailer, 40.6 t)
        >>> soft = truck.replace({"tractor.front.cornering_stiffness": 4.0e5})
        >>> soft.parameters()["tractor.front.cornering_stiffness"]
        400000.0
    """

    name: str
    source: str = Field(default="", description="Origin of the numbers.")
    units: tuple[Unit, ...] = Field(min_length=1, max_length=MAX_UNITS)
    couplings: tuple[Coupling, ...] = ()
    driveline: Driveline | None = None
    steering: Steering | None = None
    stated: NonNegatives = Field(
        default={}, description="Stated standard deviation of parameters by path, SI; 0 for an exact number."
    )
    assumed: Texts = Field(
        default={}, description="Source of each parameter that the file leaves to `classes`, by path."
    )

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a vehicle from a TOML file (`toml_format`).

        Raises:
            VehicleError: the file is not readable, not TOML, or not a valid vehicle; the message begins with the path.
        """
        text = toml_format.read(Path(path))
        try:
            return cls.loads(text)
        except VehicleError as error:
            raise VehicleError(f"{path}: {error}") from None

    @classmethod
    def loads(cls, text: str) -> Self:
        """Read a vehicle from a TOML text; errors as in `load`.

        Numbers that are missing are those of the class of their unit, if it has one.
        """
        fields, exact = toml_format.parse(text, cls)
        vehicle = cls(**complete(fields))
        if exact and vehicle.assumed:
            raise VehicleError(
                f"exact: expected every number where exact = true, {next(iter(vehicle.assumed))} is missing; give it,"
                " or remove exact = true"
            )
        return vehicle.with_stated(dict.fromkeys(vehicle.parameters(), 0.0)) if exact else vehicle

    def save(self, path: str | Path) -> None:
        """Write the vehicle to a TOML file, from which `load` reads an equal vehicle; an OSError if it cannot be
        written.
        """
        write_text(path, self.to_toml())

    def to_toml(self) -> str:
        """The vehicle as a TOML text with SI units, from which `loads` reads an equal vehicle."""
        stated = {} if self.is_exact else self.stated
        texts = {path: toml_format.text(v, unit_of(path), stated.get(path)) for path, v in self.parameters().items()}
        extra: dict[str, Any] = {"stated": self.is_exact or None, "assumed": dict(self.assumed) or None}
        fields = self.fields_with(texts)
        if self.steering is not None:
            extra[STEERING] = {**fields[STEERING], "equations": self.steering.name, "units": None}
        return toml_format.dump(fields | extra)

    def plot(self) -> "Plot":
        """A drawing to scale, from the side and from above: axles, couplings, payload and CoG.

        Wheels and bodies are symbols: a vehicle file has neither their diameters nor the length of a body.
        """
        from fifthwheel.truck.drawing import drawing  # only a plot needs NumPy

        return drawing(self.name, self.units, self.couplings, self.derived())

    def __repr__(self) -> str:
        names = " + ".join(unit.name for unit in self.units)
        return f"Vehicle({self.name!r}, {names}, {sum(unit.mass for unit in self.units) / 1000:.1f} t)"

    def __str__(self) -> str:
        return repr(self)

    @classmethod
    def _prefix(cls, data: dict[str, Any]) -> str:
        return ""  # a path begins with the unit, not with the name of the vehicle

    @model_validator(mode="after")
    def _check(self) -> Self:
        if len(self.couplings) != len(self.units) - 1:
            raise VehicleError(
                f"couplings: expected {len(self.units) - 1} between {len(self.units)} units,"
                f" got {len(self.couplings)}; give one for each pair of neighbours"
            )
        require_unique(
            "names of units and couplings",
            [
                *(u.name for u in self.units),
                *(c.name for c in self.couplings),
                *(["driveline"] if self.driveline else []),
                *([STEERING] if self.steering else []),
            ],
        )
        if self.steering is not None:
            self.steering.require_fits(self.units, self.steer_signals())
        for coupling, (front, rear) in zip(self.couplings, pairwise(self.units), strict=True):
            x, supports = coupling.leading_position, self._supports(front)
            _require_within(
                f"{coupling.name}.leading_position", x, min(supports) - MAX_COUPLING_OVERHANG, max(supports)
            )
            x, last = coupling.trailing_position, min(axle.position for axle in rear.axles)
            _require_within(f"{coupling.name}.trailing_position", x, last, last + MAX_COUPLING_LEAD)
        for i, coupling in enumerate(self.couplings):
            if not coupling.pitches and (i == 0 or self.couplings[i - 1].kind != "drawbar_eye"):
                raise VehicleError(
                    f"{coupling.name}.kind: expected a drawbar_eye in front of the unit before a turntable, which is"
                    " the dolly of a full trailer; correct the kind of one of the two couplings"
                )
        for unit in self.units:
            supports = self._supports(unit)
            low, high = min(supports), max(supports)
            least = low if unit is self.units[0] else low - LIFTING * (high - low)
            if not least <= unit.cog <= high:
                raise VehicleError(
                    f"{unit.name}.cog: expected between {low:g} and {high:g} m, where the unit is"
                    f" supported, got {unit.cog:g} m; x is positive forward from the unit's own origin"
                )
        for axle in self.units[0].axles:
            if axle.command_steering:
                raise VehicleError(
                    f"{self.units[0].name}.{axle.name}.command_steering: expected a unit behind a coupling, whose"
                    " articulation angle turns the wheels; remove it, or set steerable = true"
                )
        if self.stated or self.assumed:
            self._require({**self.stated, **self.assumed}, self._parameters)
        return self

    def _supports(self, unit: Unit) -> list[float]:
        """x of the axles of a unit on the road and of its front coupling, m."""
        i = self.units.index(unit)
        front_coupling = [self.couplings[i - 1].trailing_position] if i else []
        return [axle.position for axle in unit.on_road] + front_coupling

    def unit(self, name: str) -> Unit:
        """The unit of that name; a VehicleError if there is none."""
        for unit in self.units:
            if unit.name == name:
                return unit
        raise VehicleError(f"{name}: no such unit in {self.name}; {suggestion(name, [u.name for u in self.units])}")

    def group_paths(self) -> list[str]:
        """Beginnings of the paths of all axle groups, front to rear; see `Unit.group_path`."""
        return [unit.group_path(group) for unit in self.units for group in unit.axle_groups]

    def parameters(self) -> dict[str, float]:
        """Every scalar by its path, SI, in the order of the vehicle: 'tractor.front.cornering_stiffness': 4.75e5."""
        return dict(self._parameters)

    @functools.cached_property
    def _parameters(self) -> dict[str, float]:
        fields = self.model_dump()
        values = {path: _owner(fields, location)[location[-1]] for path, location in self.locations().items()}
        return {path: value for path, value in values.items() if value is not None}

    def locations(self) -> dict[str, FieldLocation]:
        """Keys of every scalar in the fields of the vehicle, by its path, in the order of the vehicle; also of those
        that have no value."""
        return {path: (*location, key) for path, (_, location, key) in self._numbers().items()}

    def paths(self, names: Iterable[str]) -> list[str]:
        """Paths of the parameters that are named by their path or by the end of it, each once; a VehicleError for
        another name.
        """
        known, paths = self.parameters(), list[str]()
        for name in names:
            matching = [path for path in known if ends_with(path, name)]
            if not matching:
                raise VehicleError(f"{name}: no such parameter in {self.name}; {suggestion(name, known)}")
            paths += matching
        return list(dict.fromkeys(paths))

    def parameter_ranges(self) -> dict[str, tuple[float, float]]:
        """Lowest and highest value of every scalar that a vehicle file may have, SI, by its path."""
        return {path: kind.ranges.get(key, (-math.inf, math.inf)) for path, (kind, _, key) in self._numbers().items()}

    def _numbers(self) -> dict[str, tuple[type[Component], FieldLocation, str]]:
        """Component, its place in the fields of the vehicle, and key of every scalar, by its path."""
        numbers: dict[str, tuple[type[Component], FieldLocation, str]] = {}

        def add(prefix: str, kind: type[Component], location: FieldLocation) -> None:
            numbers.update({f"{prefix}.{key}": (kind, location, key) for key in kind.si_units})

        for i, unit in enumerate(self.units):
            of_unit: FieldLocation = ("units", i)
            add(unit.name, Unit, of_unit)
            add(f"{unit.name}.sprung", SprungMass, (*of_unit, "sprung"))
            if unit.payload is not None:
                add(f"{unit.name}.payload", type(unit.payload), (*of_unit, "payload"))
            if unit.accelerometer is not None:
                add(f"{unit.name}.accelerometer", type(unit.accelerometer), (*of_unit, "accelerometer"))
            for name, place in unit.accelerometers.items():
                add(unit.accelerometer_path(name), type(place), (*of_unit, "accelerometers", name))
            for j, group in enumerate(unit.axle_groups):
                add(unit.group_path(group), AxleGroup, (*of_unit, "axle_groups", j))
                for k, axle in enumerate(group.axles):
                    add(f"{unit.name}.{axle.name}", type(axle), (*of_unit, "axle_groups", j, "axles", k))
        for i, coupling in enumerate(self.couplings):
            add(coupling.name, Coupling, ("couplings", i))
        if self.driveline is not None:
            add("driveline", Driveline, ("driveline",))
        for key in self.steering.parameters if self.steering else ():
            numbers[f"{STEERING}.{key}"] = (Steering, (STEERING, "parameters"), key)
        return numbers

    def replace(self, values: Mapping[str, float]) -> Self:
        """The same vehicle with other values of some parameters by path, SI, validated again. Stated standard
        deviations stay, but an assumed parameter with another value is no longer assumed and has no stated standard
        deviation.

        Raises:
            VehicleError: a path does not exist, or a value is not valid.
        """
        fields, before = self.fields_with(values), self._parameters
        known = {path for path in self.assumed if values.get(path, before[path]) != before[path]}
        for key in ("assumed", "stated"):
            fields[key] = {path: entry for path, entry in fields[key].items() if path not in known}
        return type(self)(**fields)

    def restated(self, values: Mapping[str, float]) -> Self:
        """The same vehicle with other values of some parameters by path, SI, as if its file had them: the numbers that
        classes give follow from them. Stated standard deviations stay.

        Raises:
            VehicleError: a path does not exist, a value is not valid, or no class gives a number that follows.
        """
        fields, locations = self.fields_with(values), self.locations()
        for path in self.assumed.keys() - values.keys():
            del _owner(fields, locations[path])[locations[path][-1]]
        stated = {path: sigma for path, sigma in self.stated.items() if path not in self.assumed}
        return type(self)(**complete(fields | {"stated": stated, "assumed": {}}))

    def with_stated(self, sigmas: Mapping[str, float]) -> Self:
        """The same vehicle with other stated standard deviations of some parameters by path, SI, 0 for an exact number;
        these parameters are then not assumed.

        Raises:
            VehicleError: a path does not exist, or a standard deviation is negative or not finite.
        """
        assumed = {path: source for path, source in self.assumed.items() if path not in sigmas}
        return type(self)(**self.model_dump() | {"stated": {**self.stated, **sigmas}, "assumed": assumed})

    @property
    def is_exact(self) -> bool:
        """Whether every parameter is stated to be exact."""
        return all(self.stated.get(path) == 0 for path in self._parameters)

    def fields_with(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """All fields as nested dictionaries and lists, with other values of some scalars by path; a VehicleError for no
        path.
        """
        fields, locations = self.model_dump(), self.locations()
        self._require(values, locations)
        for path, value in values.items():
            _owner(fields, locations[path])[locations[path][-1]] = value
        return fields

    def _require(self, paths: Iterable[str], known: Mapping[str, object]) -> None:
        for path in paths:
            if path not in known:
                raise VehicleError(f"{path}: no such parameter in {self.name}; {suggestion(path, known)}")

    def lumped(self) -> Self:
        """The same vehicle with each payload lumped into its sprung body.

        The load may then have any shape: CoG height and roll inertia of the body are two independent parameters.
        They are stated to be exact if all numbers of body and payload are; otherwise nothing is stated on them. The
        stated standard deviation of the body's mass is that of the sum if both masses have one.
        """
        p, fields = self.parameters(), self.model_dump()
        for unit in fields["units"]:
            if unit["payload"] is not None:
                body = laden(p, self.unit(unit["name"]))
                lever = body.cog_height - unit["roll_axis_height"]
                about_cog = body.roll_inertia - body.mass * lever**2
                unit["sprung"] |= {"mass": body.mass, "cog_height": body.cog_height, "roll_inertia": about_cog}
                unit["payload"] = None
                fields["stated"] = lumped_sigmas(fields["stated"], unit["name"], p)
                replaced = (f"{unit['name']}.payload.", f"{unit['name']}.sprung.")
                fields["assumed"] = {k: v for k, v in fields["assumed"].items() if not k.startswith(replaced)}
        return type(self)(**fields)

    def with_logged_steering(self, signals: Container[str], source: str) -> Self:
        """The same vehicle with every axle locked whose steer angle is not among the signals of a source, named in the
        message.

        Raises:
            VehicleError: no axle is steerable.
            SignalError: the signals contain no steer angle of the vehicle.
        """
        inputs = self.steer_signals()
        if not inputs:
            raise VehicleError(f"{self.name}: no axle is steerable; set steerable = true on the front axle")
        if not any(name in signals for name in inputs):
            raise SignalError(f"{inputs[0]}: not in {source}; map the road-wheel angle of a steered axle to it")
        fields = self.model_dump()
        for unit in fields["units"]:
            for axle in (axle for group in unit["axle_groups"] for axle in group["axles"]):
                axle["steerable"] &= f"steer.{unit['name']}.{axle['name']}" in signals
        return type(self)(**fields)

    def with_steering(
        self,
        equations: Callable[..., Any],
        *,
        states: Mapping[str, str] | None = None,
        parameters: Mapping[str, str] | None = None,
    ) -> Self:
        """The same vehicle with equations of a user's own between measured steer angles and wheels.

        docs/howto/extend.md has examples.

        Everything that models this vehicle has them: states, identification, learner, linear system, simulation and C.
        The nonlinear truck, two stages and `assess` refuse such a vehicle.

        Args:
            equations: function of a module; `truck.steering` says what it gets and returns.
            states: its own states, quantity.unit, each with the standard deviation about its steady value at the first
                sample, such as {"actuator.semitrailer": "0.01 rad"}.
            parameters: its own parameters, such as {"lag": "0.15 s +- 0.05 s"}, with the path "steering.lag". One
                stage estimates those with a standard deviation.

        Raises:
            VehicleError: the equations lack a property, such as 0 where all is 0, the vehicle has no such signal or
                axle, or a state or parameter no unit or the name of another quantity.
        """
        given = {"equations": equations, "states": states or {}, "parameters": parameters or {}}
        steering, stated = stated_steering(given)
        before = {path: sigma for path, sigma in self.stated.items() if not path.startswith(f"{STEERING}.")}
        return type(self)(**self.model_dump() | {STEERING: steering, "stated": before | stated})

    def axle_loads(self, acceleration: float = 0.0, forces: Mapping[str, float] | None = None) -> dict[str, float]:
        """Vertical load of each axle group by its path, N, static or at a longitudinal acceleration.

        The units are in equilibrium in pitch. From the last unit to the first, the coupling pulls the units behind it
        with F_c = sum (m a - F_x) over these units; m a at the height of the CoG and F_c at the heights of the
        couplings turn each unit, as if its CoG were displaced by their moment over its weight.

        Args:
            acceleration: a over g, to the front; a rise over run acts like one.
            forces: longitudinal force F_x of axle groups by path, N, to the front; by default those of brakes in
                proportion to the static loads. Without the sum m a, the first unit supplies the rest.

        Raises:
            VehicleError: the loads are not determined; see `loads.static_axle_loads`.
        """
        p = dict(self._parameters)
        if not acceleration and not forces:
            return axle_loads(p, self.units, self.couplings)
        if forces is None:
            forces = {path: acceleration * load for path, load in self.axle_loads().items()}
        displaced, pull = dict(p), 0.0  # pull: force of the coupling on the units behind it, N
        for i, unit in reversed(list(enumerate(self.units))):
            weight = unit.mass * STANDARD_GRAVITY
            moment = -acceleration * weight * unit_cog_height(p, unit)
            if i < len(self.couplings):
                moment -= pull * self.couplings[i].height
            pull += acceleration * weight - sum(forces.get(unit.group_path(group), 0.0) for group in unit.axle_groups)
            if i:
                moment += pull * self.couplings[i - 1].height
            displaced[f"{unit.name}.cog"] += moment / weight
        return axle_loads(displaced, self.units, self.couplings)

    def couplings_with_damper(self) -> list[Coupling]:
        """The couplings that usually have a damper in yaw, as the vehicle would sway without: behind the last axle of
        the unit in front, those that carry roll moment, of articulated buses, and the eye of a centre-axle trailer."""
        found = []
        for coupling, (front, rear) in zip(self.couplings, pairwise(self.units), strict=True):
            is_eye = coupling.kind == "drawbar_eye" and rear is self.units[-1] and len(rear.axle_groups) == 1
            if (is_eye or coupling.kind == "fifth_wheel") and coupling.leading_position < front.axles[-1].position:
                found.append(coupling)
        return found

    def tyres(self) -> dict[str, int]:
        """Number of tyres of each axle group by its path.

        By default 4 on each axle of the groups of the first unit behind its first one, else 2.
        """
        return {
            unit.group_path(group): group.tyres or len(group.on_road) * (4 if i == 0 and k > 0 else 2)
            for i, unit in enumerate(self.units)
            for k, group in enumerate(unit.axle_groups)
        }

    def driven_groups(self) -> tuple[str, ...]:
        """Paths of the axle groups that the engine drives.

        Where no group is stated as driven, those of the first unit without a steerable axle, else its last one.
        """
        groups = [(unit, group) for unit in self.units for group in unit.axle_groups]
        first = [(unit, group) for unit, group in groups if unit is self.units[0]]
        fixed = [(unit, group) for unit, group in first if not any(axle.steerable for axle in group.axles)]
        chosen = [each for each in groups if each[1].driven] or fixed or first[-1:]
        return tuple(unit.group_path(group) for unit, group in chosen)

    @property
    def wheelbase(self) -> float:
        """Distance of the first axle of the first unit and the mean position of its other groups' axles, m."""
        front, *others = self.units[0].axle_groups
        rear = [axle.position for group in others for axle in group.on_road] or [self.units[0].axles[-1].position]
        return front.axles[0].position - sum(rear) / len(rear)

    def steer_signals(self) -> tuple[str, ...]:
        """Names of the steer angles that are inputs of the vehicle, front to rear: 'steer.tractor.front'."""
        return tuple(f"steer.{unit.name}.{axle.name}" for unit in self.units for axle in unit.axles if axle.steerable)

    def derived(self) -> dict[str, float]:
        """<unit>.cog_height above the ground, m, and <unit>.roll_inertia about the roll axis, kg m^2, of each laden
        sprung body, equations (8) and (9) of Cheng and Cebon (2011); <unit>.wheelbase from the front coupling to the
        mean axle, m, of each unit behind the first.
        """
        p, values = self.parameters(), {}
        for unit in self.units:
            body = laden(p, unit)
            values[f"{unit.name}.cog_height"] = body.cog_height
            values[f"{unit.name}.roll_inertia"] = body.roll_inertia
        for unit, coupling in zip(self.units[1:], self.couplings, strict=True):
            axles = [axle.position for axle in unit.on_road]
            values[f"{unit.name}.wheelbase"] = coupling.trailing_position - sum(axles) / len(axles)
        return values

    def moved_by_wheelbase(self) -> dict[str, tuple[str, ...]]:
        """Paths of the positions of all axles by <unit>.wheelbase, of the units behind a coupling with one axle group:
        of these the wheelbase says where the axles are."""
        return {
            f"{unit.name}.wheelbase": tuple(f"{unit.name}.{axle.name}.position" for axle in unit.axles)
            for unit in self.units[1:]
            if len(unit.axle_groups) == 1
        }


def _require_within(path: str, position: float, low: float, high: float) -> None:
    """Raise a VehicleError where a coupling is not between low and high on a unit, m."""
    if not low <= position <= high:
        raise VehicleError(
            f"{path}: expected between {low:g} and {high:g} m, given the unit's axles, got {position:g} m;"
            " x is positive forward, from the origin of that unit"
        )


def _owner(fields: Any, location: FieldLocation) -> Any:
    """The innermost mapping that contains the scalar at a location."""
    for key in location[:-1]:
        fields = fields[key]
    return fields
