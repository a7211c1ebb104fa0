"""What an FMU contains, its variables and the C of its model: the observer of a vehicle, or its linear model."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import casadi as ca

from fifthwheel.base.arguments import expect
from fifthwheel.base.errors import FifthwheelError, SignalError
from fifthwheel.base.native import c_code
from fifthwheel.data.channels import LATERAL_VELOCITY, MODELLED, WHEEL_SPEED_DIFFERENCE, SignalName, si_unit
from fifthwheel.estimate.identify import OneStage
from fifthwheel.estimate.identify.unknowns.parameters import estimated_parameters
from fifthwheel.estimate.identify.unknowns.unknown import BOUND_FACTOR
from fifthwheel.estimate.observe import Observer, Status
from fifthwheel.estimate.stream import magnitude
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics import ChainModel
from fifthwheel.model.dynamics.chain import equations
from fifthwheel.model.dynamics.simulation import SPEEDS, step_limit
from fifthwheel.model.dynamics.state_space import MAX_SPEED
from fifthwheel.model.dynamics.unit_equations import BANK
from fifthwheel.results.export import project
from fifthwheel.results.export.c_text import table
from fifthwheel.truck import Vehicle, unit_of
from fifthwheel.truck.quantities import quantity_of

MEASURED = "measured."
"""Prefix of the inputs that are also estimated, such as yaw rates."""
SAMPLE_TIME = 0.01
"""s; default of the parameter."""
SAMPLE_TIMES = (0.0, 10.0)
"""Limits of the parameter, s."""
SPEED_LIMITS = (0.1, MAX_SPEED)
"""Of the input, m/s."""
START_SPEED = 20.0
"""m/s."""
BANK_LIMIT = 0.5
"""Of the magnitude of the input, rad."""
STEP = 0.01
"""Recommended communication step, s."""


class Role(StrEnum):
    """Role of a variable; the value is its name in C."""

    TIME = "FMU_TIME"
    INPUT = "FMU_INPUT"
    FIXED = "FMU_FIXED"
    TUNABLE = "FMU_TUNABLE"
    OUTPUT = "FMU_OUTPUT"
    INTEGER_OUTPUT = "FMU_INTEGER_OUTPUT"


@dataclass(frozen=True, kw_only=True)
class Variable:
    """A variable; its value reference is its place among the variables of the FMU."""

    name: str
    role: Role
    unit: str | None  # SI; None for an integer
    description: str
    start: float = 0.0  # of inputs and parameters
    limits: tuple[float, float] | None = None  # of inputs and parameters; None if every value is accepted


@dataclass(frozen=True, kw_only=True)
class FmuModel:
    """What an FMU contains: its variables and the C of its model."""

    name: str  # of the vehicle and of what the FMU computes
    description: str
    variables: tuple[Variable, ...]
    interpolates: bool  # whether it uses the derivatives of its inputs
    step: float  # recommended communication step, s
    header: str  # C: macros and the type fmu_model
    sources: dict[str, str]  # C files by name, besides those of every FMU
    notes: tuple[str, ...]  # for its documentation

    @property
    def identifier(self) -> str:
        """Name of its shared library, an identifier of C."""
        text = "".join(c if c.isascii() and c.isalnum() else "_" for c in self.name)
        return text if text[:1].isalpha() else f"model_{text}"


def of_signal(signal: str, role: Role, words: str = "", name: str = "", **limits: Any) -> Variable:
    """The variable of a signal, by default under its own name, described by the words and what the signal is."""
    description = f"{words} {described(signal)}".strip()
    return Variable(name=name or signal, role=role, unit=si_unit(signal), description=description, **limits)


TIME = Variable(name="time", role=Role.TIME, unit="s", description="time")


def described(name: str) -> str:
    """Description of a signal: "yaw_rate.tractor" -> "yaw rate of tractor"."""
    signal = SignalName.of(name)
    quantity = signal.quantity.replace("_", " ")
    return f"{quantity} of {signal.place}" if signal.place else f"{quantity} of the vehicle"


def variable_table(variables: Sequence[Variable]) -> str:
    """C of the table of the variables."""
    rows = [f"    {{{_row(variable)}}}, /* {variable.name} */" for variable in variables]
    return "\n".join(['#include "fmu.h"', "", "const fmu_variable fmu_variables[FMU_COUNT] = {", *rows, "};", ""])


def _row(variable: Variable) -> str:
    least, most = variable.limits or (0.0, 0.0)
    cure = "connect it, in SI units" if variable.role is Role.INPUT else "set it in SI units"
    expected = f'"{variable.name}: expected {least:.6g} to {most:.6g} {variable.unit}; {cure}"'
    return f"{variable.role}, {variable.start!r}, {least!r}, {most!r}, {expected if variable.limits else 'NULL'}"


def observer_model(observer: Observer) -> FmuModel:
    """Inputs are the signals of the observer, outputs its states, each with its sigma, nis and status."""
    inputs = [of_signal(name, Role.INPUT, "measured") for name in observer.inputs]
    inputs += [of_signal(name, Role.INPUT, "measured", f"{MEASURED}{name}") for name in observer.outputs]
    words = "least time from one sample to the next; 0: each step is a sample"
    sample_time = Variable(
        name="sample_time", role=Role.FIXED, unit="s", start=SAMPLE_TIME, limits=SAMPLE_TIMES, description=words
    )
    outputs = []
    for name in observer.reported:
        outputs.append(of_signal(name, Role.OUTPUT, "estimated"))
        outputs.append(of_signal(name, Role.OUTPUT, "standard deviation of the estimated", f"{name}.sigma"))
    nis = Variable(
        name="nis", role=Role.OUTPUT, unit="1", description="mean normalised innovation squared; 1 is expected"
    )
    words = ", ".join(f"{status.value} {status.name.lower().replace('_', ' ')}" for status in Status)
    status = Variable(name="status", role=Role.INTEGER_OUTPUT, unit=None, description=f"status: {words}")
    variables = (TIME, *inputs, sample_time, *outputs, nis, status)
    place = {variable.name: i for i, variable in enumerate(variables)}
    numbers = {
        "FMU_FIRST_INPUT": 1,
        "FMU_SAMPLE_TIME": place["sample_time"],
        "FMU_FIRST_OUTPUT": place[outputs[0].name],
        "FMU_NIS": place["nis"],
        "FMU_STATUS": place["status"],
    }
    library = project.observer_texts(observer)
    return FmuModel(
        name=f"{observer.vehicle.name} observer",
        description=f"State observer of {observer.vehicle.name}",
        variables=variables,
        interpolates=False,
        step=SAMPLE_TIME,
        header="\n".join(
            [
                '#include "fw_observer.h"',
                "",
                *(f"#define {name} {value}" for name, value in numbers.items()),
                "",
                "typedef struct {",
                "    fw_observer observer;",
                "    double sampled; /* s, time of the last sample */",
                "} fmu_model;",
            ]
        ),
        sources={name: library[name] for name in library if name.startswith("fw_")},
        notes=(
            "A step takes the inputs at its start as one sample, if sample_time has passed since the last one, and "
            "gives the states of that sample. Set sample_time to the sampling period of the sensors; steps may have "
            "any length.",
            "An input that is not a number, or that no heavy vehicle reaches, such as 1e9, is missing in this sample.",
            "Before the first sample, and if status is 2 or 3, the states are not numbers (NaN).",
        ),
    )


def default_outputs(vehicle: Vehicle) -> tuple[str, ...]:
    """Every quantity of every unit that a sensor could measure."""
    units = [unit.name for unit in vehicle.units]
    return tuple(
        f"{channel.quantity}.{unit}"
        for channel in MODELLED
        for unit in (units[1:] if channel.model and channel.model.behind_coupling else units)
        if channel not in (LATERAL_VELOCITY, WHEEL_SPEED_DIFFERENCE)  # speed times sideslip; of single axles
    )


def truck_model(
    vehicle: Vehicle, *, outputs: Sequence[str] | None = None, tunable: Sequence[str] | None = None
) -> FmuModel:
    """Inputs are the speed, the steer angles and the bank of the road; arguments and errors as in `export_fmu`."""
    expect("vehicle", vehicle, Vehicle)
    vehicle = vehicle.with_logged_steering(vehicle.steer_signals(), vehicle.name)
    free = estimated_parameters(vehicle, OneStage()) if tunable is None else vehicle.paths(tunable)
    names = tuple(dict.fromkeys(default_outputs(vehicle) if outputs is None else outputs))
    if BANK in names:
        raise SignalError(f"{BANK}: an input of the truck; leave it out of the outputs")
    model = dynamics.model(vehicle, names, roll=True, free=free, bank=True)
    bank = "bank of the road, positive with the left edge higher"
    inputs = [
        Variable(
            name="speed",
            role=Role.INPUT,
            unit="m/s",
            description="forward speed",
            start=START_SPEED,
            limits=SPEED_LIMITS,
        ),
        *(
            Variable(
                name=name,
                role=Role.INPUT,
                unit="rad",
                description=f"road-wheel angle of {name.removeprefix('steer.')}",
                limits=(-magnitude(name), magnitude(name)),
            )
            for name in vehicle.steer_signals()
        ),
        Variable(name=BANK, role=Role.INPUT, unit="rad", description=bank, limits=(-BANK_LIMIT, BANK_LIMIT)),
    ]
    parameters = [_parameter(path, vehicle.parameters()[path]) for path in free]
    reported = [of_signal(name, Role.OUTPUT) for name in names]
    places = {
        "FMU_FIRST_INPUT": 1,
        "FMU_FIRST_PARAMETER": 1 + len(inputs),
        "FMU_FIRST_OUTPUT": 1 + len(inputs) + len(parameters),
    }
    sizes = {"FW_STATES": len(model.states) - 1, "FW_INPUTS": len(inputs), "FW_PARAMETERS": len(parameters)}
    return FmuModel(
        name=f"{vehicle.name} truck",
        description=f"Linear yaw-roll model of {vehicle.name}",
        variables=(TIME, *inputs, *parameters, *reported),
        interpolates=True,
        step=STEP,
        header="\n".join(
            [
                *(f"#define {name} {value}" for name, value in {**places, **sizes}.items()),
                "",
                "typedef struct {",
                "    double x[FW_STATES];",
                "} fmu_model;",
            ]
        ),
        sources={"fw_truck.h": _equations(model, vehicle)}
        | {name: project.source(name) for name in ("fw_math.h", "fw_step_length.h")},
        notes=(
            "All states are 0 at the start: the truck drives straight ahead.",
            "Inputs are constant during a step, or, with FMI 2.0, change linearly by their derivatives. The model "
            "divides a step into as many steps as it needs.",
            "An input that is not a number or beyond its limits is an error.",
        ),
    )


def _parameter(path: str, value: float) -> Variable:
    if not value > 0:
        raise FifthwheelError(f"{path}: expected above 0 to be tunable, got {value:g}; leave it out of the parameters")
    limits = quantity_of(path).bounds or (value / BOUND_FACTOR, value * BOUND_FACTOR)
    words = " ".join(path.replace("_", " ").split("."))
    return Variable(name=path, role=Role.TUNABLE, unit=unit_of(path), description=words, start=value, limits=limits)


def _equations(model: ChainModel, vehicle: Vehicle) -> str:
    """C of the step of the model, its outputs, its matrix A, and its longest steps."""
    limits = {"step_speed": SPEEDS, "step_limit": step_limit(vehicle, model.roll).longest}
    functions = (
        (_step(model, vehicle), ("x", "row", "parameters"), "next"),
        (_outputs(model, vehicle), ("x", "inputs", "parameters"), "outputs"),
        (_matrix(model, vehicle), ("speed", "parameters"), "a"),
    )
    return "\n".join(
        [
            "/* The equations of this truck, generated; included by fmu_truck.c only. */",
            "",
            f"#define FW_SPEED_COUNT {len(SPEEDS)}",
            *(table(name, values) for name, values in limits.items()),
            "",
            *(c_code.function(f, f"fw_{f.name()}", arguments, (result,)) for f, arguments, result in functions),
        ]
    )


def _constants(model: ChainModel, vehicle: Vehicle) -> ca.DM:
    return ca.DM(model.known_values(dynamics.all_parameters(vehicle, model.outputs)))


def _step(model: ChainModel, vehicle: Vehicle) -> ca.Function:
    """(x, [dt, inputs before, inputs after], parameters) -> x+. The bank is constant at its mean, like the speed."""
    n, k = len(model.states) - 1, len(model.inputs) + 1
    x, row, p = ca.SX.sym("x", n), ca.SX.sym("row", 1 + 2 * k), ca.SX.sym("p", len(model.free))
    before, after = row[1 : 1 + k], row[1 + k :]
    state = ca.vertcat(x, (before[-1] + after[-1]) / 2)
    d = ca.vertcat(before[:-1], after[:-1])
    later = model.transition(state, row[0], d, p, _constants(model, vehicle))
    return c_code.step("step", [x, row, p], [later[:n]])


def _outputs(model: ChainModel, vehicle: Vehicle) -> ca.Function:
    """(x, inputs, parameters) -> outputs."""
    n, k = len(model.states) - 1, len(model.inputs) + 1
    x, inputs, p = ca.SX.sym("x", n), ca.SX.sym("inputs", k), ca.SX.sym("p", len(model.free))
    d = ca.vertcat(inputs[:-1], inputs[:-1])
    y = model.observation(ca.vertcat(x, inputs[-1]), d, p, _constants(model, vehicle))
    return c_code.step("outputs", [x, inputs, p], [y])


def _matrix(model: ChainModel, vehicle: Vehicle) -> ca.Function:
    """(speed, parameters) -> A of x' = A x + B d, by rows."""
    speed, p = ca.SX.sym("speed"), ca.SX.sym("p", len(model.free))
    values = {name: ca.SX(value) for name, value in vehicle.parameters().items()}
    values |= dict(zip(model.free, ca.vertsplit(p), strict=True)) if model.free else {}
    A, _ = equations(values, vehicle, roll=model.roll).state_space(speed)
    return c_code.step("matrix", [speed, p], [c_code.by_rows(A)])
