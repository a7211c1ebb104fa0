"""Responses of the linear system: understeer gradient, frequency response, rearward amplification."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fifthwheel._types import Array
from fifthwheel.dynamics.chain import state_names
from fifthwheel.dynamics.state_space import COG_ACCELERATION, linear_system
from fifthwheel.vehicle import Vehicle

SPEEDS = (10.0, 20.0)
"""m/s; any two give the same L and K."""


def steady_steer(vehicle: Vehicle, *, roll: bool = True) -> tuple[float, float]:
    """L, m, and K, rad s^2/m, of the steer angle (L + K u^2) / R of a steady turn with radius R at speed u.

    L is the wheelbase with the effect of axles that scrub in a bend, K the understeer gradient of the first unit
    (ISO 4138). The first steered axle steers.

    Args:
        vehicle: with its numbers.
        roll: yaw and roll, or yaw only.

    Raises:
        VehicleError: no axle is steerable.
    """
    steered = vehicle.with_logged_steering(vehicle.steer_signals(), vehicle.name)
    output = f"yaw_rate.{vehicle.units[0].name}"
    low, high = (speed / linear_system(steered, speed, [output], roll=roll).gain()[0, 0] for speed in SPEEDS)
    gradient = (high - low) / (SPEEDS[1] ** 2 - SPEEDS[0] ** 2)
    return float(low - gradient * SPEEDS[0] ** 2), float(gradient)


def understeer_gradient(vehicle: Vehicle, *, roll: bool = True) -> float:
    """Understeer gradient K of the first unit, rad s^2/m; positive for understeer. See `steady_steer`."""
    return steady_steer(vehicle, roll=roll)[1]


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
