"""Numerical properties of the chain: matrices, modes, critical speed, steady state."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np

from fifthwheel.base.errors import VehicleError
from fifthwheel.base.native import Scan, compiled
from fifthwheel.base.types import Array
from fifthwheel.model.dynamics import chain
from fifthwheel.model.dynamics.model import ChainModel, model
from fifthwheel.truck import Vehicle


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
    """sample = speed; constant = parameters of the vehicle; output = [E, F, G, A, B], by columns. There is no carry."""
    vehicle, roll, bank = structure.vehicle, structure.roll, structure.bank
    names = tuple(vehicle.parameters())
    nothing, u, p = ca.SX.sym("nothing", 0), ca.SX.sym("u"), ca.SX.sym("p", len(names))
    equations = chain.equations(dict(zip(names, ca.vertsplit(p), strict=True)), vehicle, roll=roll, bank=bank)
    outputs = [ca.vec(ca.densify(m)) for m in (equations.E(), *equations.implicit(u), *equations.state_space(u))]
    return ca.Function("matrices", [nothing, u, p], [nothing, ca.vertcat(*outputs)])


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
    m = matrices_of_variants(vehicle, speed, np.array([list(values.values())]), roll=roll, bank=bank)
    return Matrices(states=m.states, E=m.E[0], F=m.F[0], G=m.G[0], A=m.A[0], B=m.B[0])


def matrices_of_variants(
    vehicle: Vehicle, speed: float, parameters: Array, *, roll: bool, bank: bool = False
) -> Matrices:
    """Matrices of N vehicles with the parameters (N, n_p), in the order of those of `vehicle`; else as `matrices`."""
    if not speed > 0:
        raise VehicleError(f"speed: expected above 0 m/s, got {speed:g}; the slip angle needs a rolling wheel")
    states, k = chain.state_names(vehicle, roll=roll, bank=bank), len(vehicle.steer_signals())
    n, scan = len(states), _function(model(vehicle, (), roll=roll, bank=bank))
    nothing, sample = np.zeros(0), np.array([[speed]])
    output = np.concatenate([scan(nothing, sample, p)[1] for p in parameters])
    parts = np.split(output, np.cumsum([n * n, n * n, n * k, n * n]), axis=1)
    E, F, G, A, B = (part.reshape(len(parameters), -1, n).transpose(0, 2, 1) for part in parts)
    return Matrices(states=states, E=E, F=F, G=G, A=A, B=B)


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


def slowest_decay(vehicle: Vehicle, speed: float, *, roll: bool = True) -> float:
    """Rate at which the slowest mode decays at a speed, m/s, with fixed straight wheels, 1/s; negative if it grows."""
    return -float(np.linalg.eigvals(matrices(vehicle, speed, roll=roll).A).real.max())


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
