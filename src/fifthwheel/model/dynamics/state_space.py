"""Numerical properties of the chain at one speed: matrices, modes, critical speed, and a system with named outputs.

    x' = A x + B d,    y = C x + D d

d are the steer angles, x the states of `chain`. Range: as the equations of motion, with constant speed.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from fifthwheel.base.arguments import expect, expect_number
from fifthwheel.base.errors import SignalError, VehicleError, suggestion
from fifthwheel.base.lazy import require
from fifthwheel.base.native import Scan, compiled
from fifthwheel.base.types import Array
from fifthwheel.data.channels import MODELLED, SignalName, si_unit
from fifthwheel.model.dynamics import chain, sensors
from fifthwheel.model.dynamics.model import ChainModel, all_parameters, model
from fifthwheel.model.dynamics.symbolic import Expressions, Stages
from fifthwheel.model.dynamics.unit_equations import load_transfer_moment, slip_angles
from fifthwheel.truck import Vehicle
from fifthwheel.truck.steering import require_roll

if TYPE_CHECKING:
    from scipy import signal

COG_ACCELERATION = "cog_acceleration"
MAX_SPEED = 60.0
"""m/s; a larger number is a speed in km/h."""
STEER_SPEEDS = (10.0, 20.0)
"""m/s; any two give the same L and K of `steady_steer`."""
GROUP_QUANTITIES = {"slip_angle": "rad", "lateral_force": "N", "load_transfer_moment": "N m"}
"""Outputs of an axle group, with their SI units."""


@dataclass(frozen=True, kw_only=True)
class Matrices:
    """E x' = F x + G d and x' = A x + B d at one speed, for n states and k steered axles, SI.

    Those of several vehicles have one more axis, the first one.
    """

    states: tuple[str, ...]  # (n,) names of x
    E: Array  # (n, n) symmetric positive definite
    F: Array  # (n, n)
    G: Array  # (n, k)
    A: Array  # (n, n)
    B: Array  # (n, k)


@compiled(Scan)
def _function(structure: ChainModel) -> ca.Function:
    """sample = [speed, parameters of the vehicle]; output = [E, F, G, A, B], by columns. There is no carry."""
    vehicle, roll, bank = structure.vehicle, structure.roll, structure.bank
    names = tuple(vehicle.parameters())
    nothing, u, p = ca.SX(0, 1), ca.SX.sym("u"), ca.SX.sym("p", len(names))
    equations = chain.equations(dict(zip(names, ca.vertsplit(p), strict=True)), vehicle, roll=roll, bank=bank)
    outputs = [ca.vec(ca.densify(m)) for m in (equations.E(), *equations.implicit(u), *equations.state_space(u))]
    return ca.Function("matrices", [nothing, ca.vertcat(u, p), nothing], [nothing, ca.vertcat(*outputs)])


def matrices(
    vehicle: Vehicle, speed: float, *, roll: bool, bank: bool = False, changed: Mapping[str, float] | None = None
) -> Matrices:
    """Matrices of the equations of motion at one speed, m/s.

    Args:
        vehicle: with its numbers.
        speed: m/s.
        roll: yaw and roll, or yaw only.
        bank: whether the bank of the road is a state, the last one.
        changed: values of parameters, by path, that replace those of the vehicle. They are not validated.

    Raises:
        VehicleError: the speed is not positive.
    """
    values = vehicle.parameters() | dict(changed or {})
    m = matrices_of_variants(vehicle, [speed], [list(values.values())], roll=roll, bank=bank)
    return Matrices(states=m.states, E=m.E[0], F=m.F[0], G=m.G[0], A=m.A[0], B=m.B[0])


def matrices_of_variants(
    vehicle: Vehicle, speeds: ArrayLike, parameters: ArrayLike, *, roll: bool, bank: bool = False
) -> Matrices:
    """Matrices at N speeds, m/s, of vehicles with the parameters (N, n_p) or (n_p,), in the order of those of
    `vehicle`; else as `matrices`."""
    u, p = np.reshape(speeds, (-1, 1)), np.asarray(parameters)
    if not (u > 0).all():
        raise VehicleError(f"speed: expected above 0 m/s, got {u.min():g}; the slip angle needs a rolling wheel")
    structure = model(vehicle, (), roll=roll, bank=bank)
    sample = np.hstack([u, np.broadcast_to(p, (len(u), p.shape[-1]))])
    _, output = _function(structure)(np.zeros(0), sample, np.zeros(0))
    n, k = len(structure.states), len(vehicle.steer_signals())
    parts = np.split(output, np.cumsum([n * n, n * n, n * k, n * n]), axis=1)
    E, F, G, A, B = (part.reshape(len(output), -1, n).transpose(0, 2, 1) for part in parts)
    return Matrices(states=structure.states, E=E, F=F, G=G, A=A, B=B)


@dataclass(frozen=True, kw_only=True)
class Mode:
    """A real eigenvalue, or a pair of conjugate eigenvalues, with its eigenvector."""

    eigenvalue: complex  # 1/s; of a pair, the one with positive imaginary part
    shape: Array  # eigenvector, complex (n,), with the largest element 1

    @property
    def frequency(self) -> float:
        """Undamped natural frequency, Hz."""
        return float(abs(self.eigenvalue) / (2 * np.pi))

    @property
    def damping(self) -> float:
        """Damping ratio: 1 for a real stable eigenvalue, negative for an unstable one."""
        return float(-self.eigenvalue.real / abs(self.eigenvalue))


def modes(vehicle: Vehicle, speed: float, *, roll: bool = True) -> tuple[Mode, ...]:
    """Modes at a speed, m/s, in the order of their natural frequencies; `roll` as in `matrices`."""
    values, vectors = np.linalg.eig(matrices(vehicle, speed, roll=roll).A)
    result = [
        Mode(eigenvalue=complex(value), shape=vector / vector[np.argmax(np.abs(vector))])
        for value, vector in zip(values, vectors.T, strict=True)
        if value.imag >= 0
    ]
    return tuple(sorted(result, key=lambda mode: abs(mode.eigenvalue)))


def is_stable(vehicle: Vehicle, speed: float, *, roll: bool = True) -> bool:
    """Whether all modes decay at a speed, m/s, with fixed straight wheels; `roll` as in `matrices`."""
    return slowest_decay(vehicle, speed, roll=roll) > 0


def slowest_decay(
    vehicle: Vehicle, *speeds: float, roll: bool = True, changed: Mapping[str, float] | None = None
) -> float:
    """Rate at which the slowest mode decays at any of the speeds, m/s, with fixed straight wheels, 1/s; negative if it
    grows. `roll` and `changed` as in `matrices`."""
    values = vehicle.parameters() | dict(changed or {})
    m = matrices_of_variants(vehicle, speeds, list(values.values()), roll=roll)
    return -float(np.linalg.eigvals(m.A).real.max())


def critical_speed(vehicle: Vehicle, *, roll: bool = True, highest: float = 80.0) -> float | None:
    """Lowest speed at which the vehicle is unstable with fixed straight wheels, m/s, to 1e-6 m/s; `roll` as in
    `matrices`.

    The search is from 2 m/s to `highest`. None if the vehicle is stable in this range; 2 if it is unstable at 2 m/s.
    """
    speeds = np.arange(2.0, highest + 0.5, 0.5)
    i = next((i for i, speed in enumerate(speeds) if not is_stable(vehicle, speed, roll=roll)), None)
    if i is None:
        return None
    if i == 0:
        return float(speeds[0])
    low, high = float(speeds[i - 1]), float(speeds[i])
    while high - low > 1e-6:
        middle = (low + high) / 2
        low, high = (middle, high) if is_stable(vehicle, middle, roll=roll) else (low, middle)
    return high


def steady_state(vehicle: Vehicle, speed: float, steer: Iterable[float], *, roll: bool = True) -> dict[str, float]:
    """Steady state, by name, SI, of a stable vehicle at a constant speed, m/s, and one steer angle, rad, for each
    steered axle.
    """
    m = matrices(vehicle, speed, roll=roll)
    return dict(zip(m.states, -np.linalg.solve(m.A, m.B @ np.array(list(steer))), strict=True))


@dataclass(frozen=True, kw_only=True)
class LinearSystem:
    """A linear time-invariant system with k inputs, n states and m outputs; all names are those of signals, all SI.

    Example:
        >>> import fifthwheel as fw
        >>> system = fw.linear_system(fw.vehicle("cheng_cebon_2011"), 25.0, ["yaw_rate.tractor", "roll.semitrailer"])
        >>> system.A.shape, system.C.shape
        ((11, 11), (2, 11))
        >>> system.units["roll.semitrailer"]
        'rad'
    """

    vehicle: str
    speed: float  # m/s
    inputs: tuple[str, ...]  # (k,)
    states: tuple[str, ...]  # (n,)
    outputs: tuple[str, ...]  # (m,)
    A: Array  # (n, n)
    B: Array  # (n, k)
    C: Array  # (m, n)
    D: Array  # (m, k)

    def __repr__(self) -> str:
        sizes = f"{len(self.inputs)} inputs, {len(self.states)} states, {len(self.outputs)} outputs"
        return f"LinearSystem({self.vehicle!r} at {self.speed:g} m/s: {sizes})"

    @property
    def units(self) -> dict[str, str]:
        """SI unit of every input, state and output, by name."""
        return {name: _unit(name) for name in (*self.inputs, *self.states, *self.outputs)}

    @property
    def eigenvalues(self) -> NDArray[np.complex128]:
        """Eigenvalues of A (n,), 1/s."""
        return np.asarray(np.linalg.eigvals(self.A), dtype=np.complex128)

    def frequency_response(self, frequency: ArrayLike) -> NDArray[np.complex128]:
        """Complex gains from the k inputs to the m outputs at each of f frequencies, Hz: (f, m, k)."""
        s = 2j * np.pi * np.atleast_1d(frequency)[:, None, None]
        x = np.linalg.solve(s * np.eye(len(self.A)) - self.A, np.broadcast_to(self.B, (len(s), *self.B.shape)))
        return np.asarray(self.C @ x + self.D)

    def gain(self) -> Array:
        """Gains of the steady state (m, k), if the system is stable."""
        return np.asarray(self.frequency_response([0.0])[0].real)

    def response(self, time: Array, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Outputs over time by name, (N,) each, from rest; exact for inputs that change linearly between the samples.

        The time (N,) is in equal steps, s; inputs are steer angles by name, (N,) each, rad, 0 by default. A SignalError
        if an input does not exist or has another length, or the steps are not equal.
        """
        from scipy import signal

        time = np.asarray(time, np.float64)
        steps = np.diff(time)
        if steps.size and not (steps[0] > 0 and np.allclose(steps, steps[0], rtol=1e-3)):
            raise SignalError("time: expected equal steps above 0 s; interpolate the inputs to such a time")
        for name, values in inputs.items():
            self.input_index(name)
            if np.shape(values) != time.shape:
                raise SignalError(f"{name}: expected {time.shape}, as the time, got {np.shape(values)}; give one each")
        d = np.column_stack([inputs.get(name, np.zeros_like(time)) for name in self.inputs])
        _, y, _ = signal.lsim(self.to_scipy(), d, time)
        return dict(zip(self.outputs, np.reshape(y, (len(time), -1)).T, strict=True))

    def step(self, dt: float) -> tuple[Array, Array, Array]:
        """F (n, n), G (n, k) and H (n, k) of an exact step of dt seconds, x+ = F x + G d + H d+, with inputs that
        change linearly.

        Van Loan (1978), Computing integrals involving the matrix exponential. A SignalError if dt is below 0.
        """
        from scipy.linalg import expm

        expect_number("dt", dt, ge=0, unit="s")
        n, k = self.B.shape
        M = np.zeros((n + 2 * k, n + 2 * k))
        M[:n, :n], M[:n, n : n + k], M[n : n + k, n + k :] = self.A * dt, self.B * dt, np.eye(k)
        E = expm(M)
        H = E[:n, n + k :]
        return E[:n, :n], E[:n, n : n + k] - H, H

    def input_index(self, name: str) -> int:
        """Index of an input; a SignalError where there is none."""
        return _index(name, self.inputs, f"an input of {self.vehicle}")

    def output_index(self, name: str) -> int:
        """Index of an output; a SignalError where there is none."""
        return _index(name, self.outputs, "an output of this system")

    def to_scipy(self) -> "signal.StateSpace":
        """The system for scipy.signal, without names."""
        from scipy import signal

        return signal.StateSpace(self.A, self.B, self.C, self.D)

    def to_control(self) -> Any:
        """The system for python-control. Its names contain "_" in place of ".", which python-control reserves.

        Raises:
            FifthwheelError: python-control is not installed.
        """
        control = require("control", "control")
        names = {
            key: [name.replace(".", "_") for name in getattr(self, key)] for key in ("inputs", "states", "outputs")
        }
        return control.ss(self.A, self.B, self.C, self.D, name=self.vehicle.replace(".", "_"), **names)


def linear_system(
    vehicle: Vehicle, speed: float, outputs: Iterable[str] | None = None, *, roll: bool = True
) -> LinearSystem:
    """The linear model of a vehicle at one speed.

    An output is a state, a signal that `dynamics.model` has (an accelerometer's `lateral_acceleration.<unit>` contains
    g times the roll angle), or one of

        cog_acceleration.<unit>        m/s^2; v' + u r on the roll axis under the CoG, without gravity
        slip_angle.<group>             rad; with a relaxation length, the lagged one
        lateral_force.<group>          N; side force of all tyres of the group
        load_transfer_moment.<group>   N m; half the track times the load of the right wheels less that of the left
                                       ones; see `unit_equations.load_transfer_moment`, with the unsprung mass on the
                                       roll axis, as in the equations of motion

    <group> is the path of the axle group: tractor.drive, or semitrailer if the unit has one group.

    Args:
        vehicle: with its numbers.
        speed: constant, m/s.
        outputs: names, or one name; by default `default_outputs`.
        roll: use the yaw-roll model, or the yaw model.

    Raises:
        SignalError: the model does not have an output.
        VehicleError: `vehicle` is not one, or the speed is not above 0 and at most `MAX_SPEED`.

    Example:
        >>> import fifthwheel as fw
        >>> truck = fw.vehicle("cheng_cebon_2011")
        >>> fw.linear_system(truck, 25.0, ["lateral_force.tractor.drive"]).inputs[0]
        'steer.tractor.front'
    """
    expect("vehicle", vehicle, Vehicle)
    require_roll(vehicle.steering, roll)
    if not isinstance(speed, int | float | np.number) or not 0 < speed <= MAX_SPEED:
        raise VehicleError(
            f"speed: expected a number of m/s above 0, up to {MAX_SPEED:g}, got {speed!r}; convert km/h to m/s"
        )
    if isinstance(outputs, str):
        outputs = [outputs]
    names = default_outputs(vehicle, roll=roll) if outputs is None else tuple(outputs)
    m = matrices(vehicle, speed, roll=roll)
    values = all_parameters(vehicle, [name for name in names if _is_sensor(name, m.states)])
    scan = _output_function(model(vehicle, (), roll=roll), names)
    _, both = scan(np.zeros(0), np.array([[speed]]), np.array(list(values.values())))
    inputs = vehicle.steer_signals()
    C, D = np.split(both.reshape(len(names), len(m.states) + len(inputs), order="F"), [len(m.states)], axis=1)
    return LinearSystem(
        vehicle=vehicle.name,
        speed=speed,
        inputs=inputs,
        states=m.states,
        outputs=names,
        A=m.A,
        B=m.B.reshape(len(m.states), len(inputs)),
        C=C,
        D=D,
    )


def default_outputs(vehicle: Vehicle, *, roll: bool) -> tuple[str, ...]:
    """Sideslip, yaw rate, acceleration of the CoG and, with roll, the roll of every unit; all articulation angles."""
    quantities = ("sideslip", "yaw_rate", COG_ACCELERATION, *(["roll"] if roll else []))
    names = [unit.name for unit in vehicle.units]
    return (*(f"{q}.{name}" for q in quantities for name in names), *(f"articulation.{name}" for name in names[1:]))


def _is_sensor(name: str, states: tuple[str, ...]) -> bool:
    """Whether an output comes from `sensors`."""
    return name not in states and SignalName.of(name).quantity not in {COG_ACCELERATION, *GROUP_QUANTITIES}


def _unit(name: str) -> str:
    quantity = SignalName.of(name).quantity
    if quantity in GROUP_QUANTITIES:
        return GROUP_QUANTITIES[quantity]
    return "m/s^2" if quantity == COG_ACCELERATION else si_unit(name) or "1"


def steady_steer(vehicle: Vehicle, *, roll: bool = True) -> tuple[float, float]:
    """L, m, and K, rad s^2/m, of the steer angle (L + K u^2) / R of a steady turn with radius R at speed u.

    L is the wheelbase with the effect of axles that scrub in a bend, K the understeer gradient of the first unit
    (ISO 4138). The first steered axle steers. `roll`: yaw and roll, or yaw only.

    Raises:
        VehicleError: no axle is steerable.
    """
    steered = vehicle.with_logged_steering(vehicle.steer_signals(), vehicle.name)
    output = f"yaw_rate.{vehicle.units[0].name}"
    low, high = (speed / linear_system(steered, speed, [output], roll=roll).gain()[0, 0] for speed in STEER_SPEEDS)
    gradient = (high - low) / (STEER_SPEEDS[1] ** 2 - STEER_SPEEDS[0] ** 2)
    return float(low - gradient * STEER_SPEEDS[0] ** 2), float(gradient)


def understeer_gradient(vehicle: Vehicle, *, roll: bool = True) -> float:
    """Understeer gradient K of the first unit, rad s^2/m; positive for understeer. See `steady_steer`."""
    return steady_steer(vehicle, roll=roll)[1]


def frequency_response(
    vehicle: Vehicle, speed: float, frequency: ArrayLike, *, roll: bool = True
) -> NDArray[np.complex128]:
    """Complex gains from the k steer angles to the n states at each of f frequencies, Hz: (f, n, k)."""
    states = chain.state_names(vehicle, roll=roll)
    return linear_system(vehicle, speed, states, roll=roll).frequency_response(frequency)


def rearward_amplification(
    vehicle: Vehicle, speed: float, frequency: Array | None = None, *, roll: bool = True
) -> tuple[float, float]:
    """Rearward amplification and its frequency, Hz: ISO 14791, section 7.6, in the frequency domain.

    It is the largest gain from the lateral acceleration of the first unit's CoG to that of the last unit's CoG, with
    steering at the first steered axle, at a speed, m/s, and frequencies (f,), Hz, 0.05 to 1.5 Hz by default. `roll`:
    yaw and roll, or yaw only.
    """
    frequency = np.linspace(0.05, 1.5, 291) if frequency is None else np.asarray(frequency)
    ends = [f"{COG_ACCELERATION}.{unit.name}" for unit in (vehicle.units[0], vehicle.units[-1])]
    system = linear_system(vehicle, speed, ends, roll=roll)
    first, last = np.abs(system.frequency_response(frequency)[:, :, 0]).T
    gain = last / first
    best = int(np.argmax(gain))
    return float(gain[best]), float(frequency[best])


@compiled(Scan)
def _output_function(structure: ChainModel, outputs: tuple[str, ...]) -> ca.Function:
    """sample = speed; constant = parameters; output = [C, D], by columns. There is no carry."""
    vehicle, roll, states = structure.vehicle, structure.roll, structure.states
    names = tuple(all_parameters(vehicle, [name for name in outputs if _is_sensor(name, states)]))
    symbols, u, nothing = ca.SX.sym("p", len(names)), ca.SX.sym("u"), ca.SX.sym("nothing", 0)
    p = dict(zip(names, ca.vertsplit(symbols), strict=True))
    x, d = ca.SX.sym("x", len(states)), ca.SX.sym("d", len(vehicle.steer_signals()))
    equations = chain.equations(p, vehicle, roll=roll)
    stages = Stages()
    sensed = sensors.sensor_inputs(p, vehicle, equations, x, u, d, roll=roll, stages=stages)
    slip = slip_angles(p, vehicle, sensed.motion, sensed.steer)
    y = [x[states.index(name)] if name in states else _output(name, sensed, slip) for name in outputs]
    stacked = stages.expanded(ca.vertcat(*y)) if y else ca.SX(0, 1)
    xd = ca.vertcat(x, d)
    slopes = ca.substitute(ca.jacobian(stacked, xd), xd, 0)  # an own sensor need not be linear
    both = ca.vec(ca.densify(slopes))
    return ca.Function("outputs", [nothing, u, symbols], [nothing, both], {"cse": True})


def _output(name: str, sensed: sensors.SensorInputs, slip: Expressions) -> ca.SX:
    """An output that is not a state."""
    parsed = SignalName.of(name)
    if parsed.quantity == COG_ACCELERATION:
        return sensed.acceleration[_index(parsed.unit, [u.name for u in sensed.vehicle.units], f"a unit ({name})")][0]
    if parsed.quantity in GROUP_QUANTITIES:
        i, group = sensors.axle_group(sensed.vehicle, name)
        path = sensed.vehicle.units[i].group_path(group)
        if parsed.quantity == "slip_angle":
            return slip[path]
        if parsed.quantity == "lateral_force":
            return sensed.side_force[path]
        if not sensed.roll:
            raise SignalError(f"{name}: the yaw-only model has no roll; set roll=True or omit the output")
        height = sensed.p[f"{sensed.vehicle.units[i].name}.roll_axis_height"]  # where the model has all masses
        motion, force = sensed.motion, sensed.side_force[path]
        return load_transfer_moment(sensed.p, path, motion.roll[i], motion.roll_rate[i], force, height)
    known = sorted({*[channel.quantity for channel in MODELLED], COG_ACCELERATION, *GROUP_QUANTITIES})
    if parsed.quantity not in known:
        raise SignalError(f"{name}: no such quantity in the linear model; {suggestion(parsed.quantity, known)}")
    sensors.require_available(sensed.vehicle, name, roll=sensed.roll)
    return sensors.sensor_output(sensed, name)


def _index(name: str, known: Iterable[str], kind: str) -> int:
    known = list(known)
    if name not in known:
        raise SignalError(f"{name}: not {kind}; {suggestion(name, known)}")
    return known.index(name)
