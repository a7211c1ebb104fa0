"""Numerical properties of the chain: modes, critical speed, steady state, rearward amplification."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fifthwheel._types import Array
from fifthwheel.dynamics.chain import state_names
from fifthwheel.dynamics.matrices import matrices
from fifthwheel.dynamics.state_space import COG_ACCELERATION, linear_system
from fifthwheel.vehicle import Vehicle


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


def critical_speed(vehicle: Vehicle, *, roll: bool = True, highest: float = 80.0) -> float | None:
    """Lowest speed at which the vehicle is unstable with fixed straight wheels, m/s, to 1e-6 m/s.

    Args:
        vehicle: with its numbers.
        roll: yaw and roll, or yaw only.
        highest: upper limit of the search, m/s; the lower limit is 2 m/s.

    Returns:
        None if the vehicle is stable in the whole range; 2 if it is unstable at 2 m/s.
    """

    def unstable(speed: float) -> bool:
        return bool(np.linalg.eigvals(matrices(vehicle, speed, roll=roll).A).real.max() > 0)

    speeds = np.arange(2.0, highest + 0.5, 0.5)
    i = next((i for i, speed in enumerate(speeds) if unstable(speed)), None)
    if i is None:
        return None
    if i == 0:
        return float(speeds[0])
    low, high = float(speeds[i - 1]), float(speeds[i])
    while high - low > 1e-6:
        middle = (low + high) / 2
        low, high = (low, middle) if unstable(middle) else (middle, high)
    return high


def steady_state(vehicle: Vehicle, speed: float, steer: Iterable[float], *, roll: bool = True) -> dict[str, float]:
    """Steady state of a stable vehicle at constant speed and steer angles, by name, SI.

    Args:
        vehicle: with its numbers.
        speed: m/s.
        steer: one angle for each steered axle, rad.
        roll: yaw and roll, or yaw only.
    """
    m = matrices(vehicle, speed, roll=roll)
    return dict(zip(m.states, -np.linalg.solve(m.A, m.B @ np.array(list(steer))), strict=True))


def understeer_gradient(vehicle: Vehicle, speed: float, *, roll: bool = True) -> float:
    """Understeer gradient K of the first unit, rad s^2/m: the steer angle of a steady turn is L/R + K u^2/R.

    L is `Vehicle.wheelbase`, and the first steered axle steers. With several axle groups on the first unit, or with
    units behind it, K changes with the speed.

    Args:
        vehicle: with its numbers.
        speed: m/s.
        roll: yaw and roll, or yaw only.
    """
    first = f"{COG_ACCELERATION}.{vehicle.units[0].name}"
    gain = linear_system(vehicle, speed, [first], roll=roll).gain()[0, 0]
    return float(1 / gain - vehicle.wheelbase / speed**2)


def frequency_response(
    vehicle: Vehicle, speed: float, frequency: ArrayLike, *, roll: bool = True
) -> NDArray[np.complex128]:
    """Complex gains from the k steer angles to the n states at each of f frequencies, Hz: (f, n, k)."""
    states = state_names(vehicle, roll=roll)
    return linear_system(vehicle, speed, states, roll=roll).frequency_response(frequency)


def rearward_amplification(
    vehicle: Vehicle, speed: float, frequency: Array | None = None, *, roll: bool = True
) -> tuple[float, float]:
    """Rearward amplification and its frequency, Hz: ISO 14791, section 7.6, in the frequency domain.

    It is the largest gain from the lateral acceleration of the first unit's CoG to that of the last unit's CoG, with
    steering at the first steered axle.

    Args:
        vehicle: with its numbers.
        speed: m/s.
        frequency: (f,) Hz; 0.05 to 1.5 Hz by default.
        roll: yaw and roll, or yaw only.
    """
    frequency = np.linspace(0.05, 1.5, 291) if frequency is None else np.asarray(frequency)
    ends = [f"{COG_ACCELERATION}.{unit.name}" for unit in (vehicle.units[0], vehicle.units[-1])]
    system = linear_system(vehicle, speed, ends, roll=roll)
    first, last = np.abs(system.frequency_response(frequency)[:, :, 0]).T
    gain = last / first
    best = int(np.argmax(gain))
    return float(gain[best]), float(frequency[best])
