"""Own equations of the steering: between measured steer angles and wheels, with own states and parameters.

The equations are a function at the top level of a module of yours, for `Vehicle.with_steering`:

    def lag(steer, states, motion, p):
        '''An actuator turns the wheels of the trailer: z' = (command - z) / T.'''
        z = states["actuator.semitrailer"]
        command = steer["steer.semitrailer.rear"]
        return {"steer.semitrailer.rear": z}, {"actuator.semitrailer": (command - z) / p["lag"]}

It gets four mappings from names to expressions of CasADi:

    steer    the measured steer angles, rad, corrected by the errors of their sensors
    states   its own states, SI
    motion   "speed", m/s, and the states of the model, SI: lateral_velocity of the first unit, yaw_rate, articulation,
             roll and roll_rate of a unit, such as "roll.semitrailer"
    p        its own parameters, SI

It returns the steer angles of wheels, rad, of any axle of the vehicle, and the derivatives of all its states, SI/s.
Axles that it does not name are steered as measured. Its results are 0 where steer angles, states and motion are 0, and
smooth there. A model with linear tyres linearises it there.
"""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, Self

from pydantic import AfterValidator, Field, PlainSerializer, model_validator

from fifthwheel.base.errors import SignalError, UnitError, VehicleError, suggestion
from fifthwheel.base.names import begins_with
from fifthwheel.base.units import own_quantity
from fifthwheel.truck.component import Component, HashableDict, Number, Texts
from fifthwheel.truck.quantities import register_unit
from fifthwheel.truck.unit import Unit

if TYPE_CHECKING:
    from fifthwheel.truck.steering_equations import Trace

STEERING = "steering"
"""First word of the paths of its parameters."""
ROLL = ("roll", "roll_rate")
"""Quantities of the motion that only a model with roll has."""


def _stored(equations: Any) -> dict[str, Any]:
    from fifthwheel.truck.steering_equations import stored

    return stored(equations)


Equations = Annotated[Any, PlainSerializer(_stored, when_used="json")]
Numbers = Annotated[Mapping[str, Number], AfterValidator(HashableDict)]


class Steering(Component):
    """Own equations of the steering of a vehicle; see `Vehicle.with_steering`."""

    equations: Equations = Field(description="Function of a module, or its name, module:function.")
    states: Texts = Field(
        default={}, description="Standard deviation of each own state about its steady value at the first sample."
    )
    parameters: Numbers = Field(default={}, description="Own parameters.")
    units: Texts = Field(default={}, description="Their SI units.")

    def __reduce__(self) -> tuple[Any, ...]:
        """Another process registers states and units, too."""
        return partial(Steering, **dict(self)), ()

    @model_validator(mode="before")
    @classmethod
    def _restore(cls, fields: Any) -> Any:
        from fifthwheel.truck.steering_equations import found  # only own equations need CasADi

        return {**fields, "equations": found(fields.get("equations"))}

    @model_validator(mode="after")
    def _check(self) -> Self:
        from fifthwheel.data.channels import register_state

        self._refuse(self._faults())
        for name, text in self.states.items():
            unit, sigma, _ = quantity_of(f"states, {name}", text)
            if len(text.split()) < 2:
                raise VehicleError(
                    f"states, {name}: expected a unit, such as '{text} rad', got {text!r}; write '{text} 1' for none"
                )
            if not sigma > 0:
                raise VehicleError(f"states, {name}: expected a standard deviation above 0, got {text}; correct it")
            try:
                register_state(name, unit, sigma)
            except SignalError as error:
                raise VehicleError(f"states, {error}") from None
        for name in self.parameters:
            if name not in self.units:
                raise VehicleError(f"parameters, {name}: expected a text with a unit, got a number; write '0.1 s'")
            register_unit(f"{STEERING}.{name}", self.units[name])
        self._refuse(self._unused())
        return self

    def _refuse(self, faults: Iterator[tuple[str, str, str]], prefix: str = "") -> None:
        from fifthwheel.truck.steering_equations import message

        for fault in faults:
            raise VehicleError(prefix + message(self.equations, fault))

    def _unused(self) -> Iterator[tuple[str, str, str]]:
        for name in self.parameters:
            if name not in self.trace.used["p"]:
                yield "parameters that the equations use", name, "remove it, or use it"

    def _faults(self) -> Iterator[tuple[str, str, str]]:
        used, rates = self.trace.used, self.trace.rates
        for kind, argument, given in (("states", "states", self.states), ("parameters", "p", self.parameters)):
            for name in used[argument]:
                if name not in given:
                    yield f"{kind} that are stated", name, f"state it; {suggestion(name, given)}"
        if set(rates) != set(self.states):
            stated, got = (", ".join(names) or "none" for names in (self.states, rates))
            yield f"the rates of its states, {stated}", got, "return the rate of each state that is stated"
        yield from self.trace.faults_at_zero(self.parameters)
        yield from self.trace.code_faults

    @property
    def name(self) -> str:
        """module:function"""
        return str(_stored(self.equations)["function"])

    @property
    def trace(self) -> "Trace":
        """What the equations use and return."""
        from fifthwheel.truck.steering_equations import trace

        return trace(self.equations)

    @property
    def uses_roll(self) -> bool:
        """Whether the equations depend on the roll of a unit."""
        return any(begins_with(name, key) for key in ROLL for name in self.trace.used["motion"])

    def require_fits(self, units: Sequence[Unit], steers: Sequence[str]) -> None:
        """A VehicleError for equations that do not fit a vehicle with these units and steer angles."""
        self._refuse(self._misfits(units, steers), f"{STEERING}.")

    def _misfits(self, units: Sequence[Unit], steers: Sequence[str]) -> Iterator[tuple[str, str, str]]:
        from fifthwheel.data.channels import SignalName

        used, names = self.trace.used, [unit.name for unit in units]
        axles = {f"steer.{unit.name}.{axle.name}": axle for unit in units for axle in unit.axles}
        for name in used["steer"]:
            if name not in steers:
                yield f"steer angles among {', '.join(steers)}", name, "log it, and set steerable = true at its axle"
        for name in used["motion"]:
            if name not in motion_signals(names):
                yield f"motion among {', '.join(motion_signals(names))}", name, "correct the name"
        for name in self.trace.wheels:
            if name not in axles:
                yield f"wheels among {', '.join(axles)}", name, "correct the name"
            elif axles[name].self_steering or axles[name].command_steering:
                yield "wheels without self_steering and command_steering", name, "remove these there"
        for name in self.states:
            if SignalName.of(name).unit not in names:
                yield f"states quantity.unit of {', '.join(names)}", name, "correct the name"


def motion_signals(units: Sequence[str]) -> tuple[str, ...]:
    """Names of the motion that own equations may use, of a vehicle with these units."""
    names = ["speed", f"lateral_velocity.{units[0]}", *[f"articulation.{unit}" for unit in units[1:]]]
    return (*names, *[f"{quantity}.{unit}" for quantity in ("yaw_rate", *ROLL) for unit in units])


def own_parameters(steering: Steering | None) -> tuple[str, ...]:
    """Paths of the own parameters."""
    return tuple(f"{STEERING}.{name}" for name in (steering.parameters if steering else ()))


def require_no_steering(steering: Steering | None, place: str) -> None:
    """A VehicleError where something cannot model own equations."""
    if steering is not None:
        raise VehicleError(f"steering: {place} cannot model own equations; use a vehicle without them")


def require_roll(steering: Steering | None, roll: bool) -> None:
    """A VehicleError where own equations use roll and a model has none."""
    if steering is not None and steering.uses_roll and not roll:
        raise VehicleError("steering: its equations use roll; use roll=True, or a vehicle without them")


def quantity_of(path: str, text: Any) -> tuple[str, float, float | None]:
    """`units.own_quantity`; a VehicleError names the path."""
    try:
        return own_quantity(text)
    except UnitError as error:
        cure = "" if "; " in str(error) else "; correct it"
        raise VehicleError(f"{path}: {error}{cure}") from None


def stated_steering(fields: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, float]]:
    """Fields of a `Steering` whose parameters are texts with units, and the standard deviations that these state."""
    parameters, units, stated = dict[str, float](), dict[str, str](), dict[str, float]()
    for name, text in dict(fields.get("parameters", {})).items():
        units[name], parameters[name], sigma = quantity_of(f"{STEERING}.{name}", text)
        if sigma is not None:
            stated[f"{STEERING}.{name}"] = sigma
    for name, text in dict(fields.get("states", {})).items():
        quantity_of(f"{STEERING}.states, {name}", text)
    return {**fields, "parameters": parameters, "units": units}, stated
