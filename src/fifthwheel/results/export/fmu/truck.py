"""The linear model of a truck as the model of an FMU."""

from collections.abc import Sequence

import casadi as ca

from fifthwheel.base.arguments import expect
from fifthwheel.base.errors import FifthwheelError, SignalError
from fifthwheel.base.native import c_code
from fifthwheel.data.channels import LATERAL_VELOCITY, MODELLED, WHEEL_SPEED_DIFFERENCE
from fifthwheel.estimate.identify import OneStage
from fifthwheel.estimate.identify.unknowns.parameters import estimated_parameters
from fifthwheel.estimate.identify.unknowns.unknown import BOUND_FACTOR
from fifthwheel.estimate.stream import magnitude
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics import ChainModel
from fifthwheel.model.dynamics.chain import equations
from fifthwheel.model.dynamics.simulation import SPEEDS, step_limit
from fifthwheel.model.dynamics.state_space import MAX_SPEED
from fifthwheel.model.dynamics.unit_equations import BANK
from fifthwheel.results.export import project
from fifthwheel.results.export.c_text import table
from fifthwheel.results.export.fmu.variables import TIME, FmuModel, Role, Variable, of_signal
from fifthwheel.truck import Vehicle, unit_of
from fifthwheel.truck.quantities import quantity_of

SPEED_LIMITS = (0.1, MAX_SPEED)
"""Of the input, m/s."""
START_SPEED = 20.0
"""m/s."""
BANK_LIMIT = 0.5
"""Of the magnitude of the input, rad."""
STEP = 0.01
"""Recommended communication step, s."""


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
