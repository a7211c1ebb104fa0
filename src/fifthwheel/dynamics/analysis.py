"""The chain in numbers: matrices at a speed, modes, critical speed, steady state, rearward amplification."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from fifthwheel.dynamics import chain
from fifthwheel.dynamics.model import topology
from fifthwheel.errors import VehicleError
from fifthwheel.vehicle import Vehicle

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Matrices:
    """E x' = F x + G d and x' = A x + B d at one speed, for n states and k steered axles."""

    states: tuple[str, ...]
    E: Array  # (n, n) symmetric positive definite
    F: Array  # (n, n)
    G: Array  # (n, k)
    A: Array  # (n, n)
    B: Array  # (n, k)


_functions: dict[tuple[object, ...], ca.Function] = {}


def _function(vehicle: Vehicle, roll: bool) -> ca.Function:
    """(parameters, speed) -> (E, F, G, A, B), one for every vehicle of the same make-up."""
    key = (topology(vehicle), roll)
    if key not in _functions:
        names = tuple(vehicle.parameters())
        p, u = ca.SX.sym("p", len(names)), ca.SX.sym("u")
        equations = chain.equations(dict(zip(names, ca.vertsplit(p), strict=True)), vehicle, roll=roll)
        A, B = equations.state_space(u)
        F = equations.A0 + equations.A1 / u + equations.A2 * u
        outputs = [ca.densify(m) for m in (equations.E(), F, equations.B0 + equations.B2 * u, A, B)]
        _functions[key] = ca.Function("matrices", [p, u], outputs)
    return _functions[key]


def matrices(vehicle: Vehicle, speed: float, *, roll: bool, changed: Mapping[str, float] | None = None) -> Matrices:
    """The equations of motion in numbers, at `speed` m/s; `changed` puts other values in the place of the vehicle's."""
    if not speed > 0:
        raise VehicleError(f"speed: expected above 0 m/s, got {speed:g}; tyre forces need a rolling wheel")
    values = vehicle.parameters() | dict(changed or {})
    found = _function(vehicle, roll)(list(values.values()), speed)
    E, F, G, A, B = (np.array(m) for m in found)
    return Matrices(states=chain.state_names(vehicle, roll=roll), E=E, F=F, G=G, A=A, B=B)


@dataclass(frozen=True, kw_only=True)
class Mode:
    """One eigenvalue, or one pair of them."""

    eigenvalue: complex  # 1/s, of a pair the one with positive imaginary part
    shape: Array  # complex (n,), the largest element 1

    @property
    def frequency(self) -> float:
        """Undamped natural frequency, Hz."""
        return float(abs(self.eigenvalue) / (2 * np.pi))

    @property
    def damping(self) -> float:
        """Damping ratio; 1 for a real stable eigenvalue, negative where unstable."""
        return float(-self.eigenvalue.real / abs(self.eigenvalue))


def modes(vehicle: Vehicle, speed: float, *, roll: bool = True) -> tuple[Mode, ...]:
    """Modes at `speed` m/s, slowest first."""
    values, vectors = np.linalg.eig(matrices(vehicle, speed, roll=roll).A)
    found = [
        Mode(eigenvalue=complex(value), shape=vector / vector[np.argmax(np.abs(vector))])
        for value, vector in zip(values, vectors.T, strict=True)
        if value.imag >= 0
    ]
    return tuple(sorted(found, key=lambda mode: abs(mode.eigenvalue)))


def critical_speed(vehicle: Vehicle, *, roll: bool = True, highest: float = 80.0) -> float | None:
    """The lowest speed at which the vehicle, wheels fixed straight, is unstable, m/s to 1e-6.

    None if there is none from 2 m/s up to `highest`; 2 if it is unstable there already.
    """

    def unstable(speed: float) -> bool:
        return bool(np.linalg.eigvals(matrices(vehicle, speed, roll=roll).A).real.max() > 0)

    speeds = np.arange(2.0, highest + 0.5, 0.5)
    above = next((i for i, speed in enumerate(speeds) if unstable(speed)), None)
    if above is None:
        return None
    if above == 0:
        return float(speeds[0])
    low, high = float(speeds[above - 1]), float(speeds[above])
    while high - low > 1e-6:
        middle = (low + high) / 2
        low, high = (low, middle) if unstable(middle) else (middle, high)
    return high


def steady_state(vehicle: Vehicle, speed: float, steer: Iterable[float], *, roll: bool = True) -> dict[str, float]:
    """The state that constant steer angles (rad, one a steered axle) lead to, by name; a stable vehicle only."""
    m = matrices(vehicle, speed, roll=roll)
    return dict(zip(m.states, -np.linalg.solve(m.A, m.B @ np.array(list(steer))), strict=True))


def frequency_response(
    vehicle: Vehicle, speed: float, frequency: ArrayLike, *, roll: bool = True
) -> NDArray[np.complex128]:
    """x / d at each frequency (Hz): (len(frequency), n, k)."""
    m = matrices(vehicle, speed, roll=roll)
    s = 2j * np.pi * np.asarray(frequency)[:, None, None]
    return np.asarray(np.linalg.solve(s * np.eye(len(m.A)) - m.A, np.broadcast_to(m.B, (len(s), *m.B.shape))))


def rearward_amplification(
    vehicle: Vehicle, speed: float, frequency: Array | None = None, *, roll: bool = True
) -> tuple[float, float]:
    """Largest gain from the lateral acceleration of the first unit's CoG to the last unit's, and its frequency in Hz.

    ISO 14791, section 7.6, in the frequency domain, for steering at the first steered axle.
    """
    frequency = np.linspace(0.05, 1.5, 291) if frequency is None else np.asarray(frequency)
    m = matrices(vehicle, speed, roll=roll)
    x = frequency_response(vehicle, speed, frequency, roll=roll)[:, :, 0]
    rates = 2j * np.pi * frequency[:, None] * x
    J = _jacobians(vehicle, roll)
    places = chain.velocity_places(vehicle, roll=roll)
    turning = speed * x[:, m.states.index(f"yaw_rate.{vehicle.units[0].name}")]
    first, last = (rates[:, places] @ row + turning for row in (J[0], J[-1]))
    gain = np.abs(last) / np.abs(first)
    best = int(np.argmax(gain))
    return float(gain[best]), float(frequency[best])


def _jacobians(vehicle: Vehicle, roll: bool) -> Array:
    """Rows of lateral velocity per generalised velocity, one a unit."""
    p = {name: ca.SX(value) for name, value in vehicle.parameters().items()}
    x = ca.SX.sym("x", len(chain.state_names(vehicle, roll=roll)))
    moving = chain.motion(p, vehicle, x, ca.SX(1), roll=roll)
    return np.array([np.array(ca.DM(J[0, :])).ravel() for J in moving.jacobian])
