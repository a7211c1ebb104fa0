"""Yaw damping: how fast the swaying of the last unit decays, by eigenvalues and by a pulse of the steer angle.

An oscillation is one of yaw if at least half of its participation factors belong to yaw-plane states: those other than
roll angles and roll rates (G. Verghese, I. Perez-Arriaga, F. Schweppe, IEEE Trans. PAS-101, 1982). The measure is the
lowest damping ratio among them. After the pulse (ISO 14791, pulse input), the logarithmic decrement d of successive
peaks of the last articulation angle, half a period apart, gives the damping ratio d / sqrt(pi^2 + d^2). The decay
begins at the largest peak: in a long combination smaller ones precede it, until the motion reaches the last unit. The
largest peak is left out if three or more exist: it contains the fast response to the pulse itself.

The zero-damping speed (ISO 14791) is the lowest speed at which that lowest damping ratio is 0.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from fifthwheel.base.errors import VehicleError
from fifthwheel.base.types import Array
from fifthwheel.data.channels import SignalName
from fifthwheel.model.dynamics import linear_system, state_names
from fifthwheel.results.assess.truck import Truck, Values

PULSE = 0.2
"""Duration of the half sine of the steer angle, s."""
DURATION, STEP = 10.0, 0.02
"""Of the response, s."""
SMALLEST_PEAK = 0.01
"""Peaks below this fraction of the largest are not used."""
LOWEST_SPEED, HIGHEST_SPEED = 20 / 3.6, 200 / 3.6
"""Between which a zero-damping speed is searched for, m/s."""
ROLL = ("roll", "roll_rate")


def measure(truck: Truck) -> Values:
    """The damping ratio by eigenvalues; negative for an oscillation that grows."""
    return {"yaw_damping": eigenvalue_damping(truck)}


def measure_pulse(truck: Truck) -> Values:
    """The damping ratio by the decay after a pulse."""
    truck.require_stable()
    return {"yaw_damping_pulse": pulse_damping(*pulse_response(truck))}


def measure_zero_damping_speed(truck: Truck) -> Values:
    """The zero-damping speed, m/s.

    Raises:
        VehicleError: there is none up to `HIGHEST_SPEED`, or the truck becomes unstable without oscillation before.
    """
    from scipy.optimize import brentq  # slow to import

    def damping(speed: float) -> float:
        try:
            return eigenvalue_damping(replace(truck, speed=speed))
        except VehicleError:
            raise VehicleError(
                f"zero-damping speed: none, the truck does not sway when it becomes unstable: at"
                f" {3.6 * speed:.0f} km/h it spins or jackknifes after a small disturbance"
            ) from None

    for low, high in pairwise(np.linspace(LOWEST_SPEED, HIGHEST_SPEED, 10).tolist()):
        if damping(high) < 0:
            return {"zero_damping_speed": float(brentq(damping, low, high, xtol=1e-6))}
    raise VehicleError(f"zero-damping speed: none up to {3.6 * HIGHEST_SPEED:.0f} km/h")


def eigenvalue_damping(truck: Truck) -> float:
    """Lowest damping ratio of the oscillations in the yaw plane; 1 if nothing oscillates."""
    values, right, states = truck.modes
    participation = np.abs(right * np.linalg.inv(right).T)
    in_yaw = np.array([SignalName.of(name).quantity not in ROLL for name in states])
    fraction = participation[in_yaw].sum(axis=0) / participation.sum(axis=0)
    oscillates = np.abs(values.imag) > 1e-9
    if values[~oscillates].real.max(initial=-1.0) >= 0:
        truck.require_stable()
    chosen = values[oscillates & (fraction >= 0.5)]
    return float(np.min(-chosen.real / np.abs(chosen), initial=1.0))


def pulse_response(truck: Truck) -> tuple[Array, Array]:
    """Time and last articulation angle, rad, (yaw rate of a single unit, rad/s) after a pulse of 1 deg, (N,).

    After the pulse the response is the sum of the modes.
    """
    units = truck.vehicle.units
    output = f"articulation.{units[-1].name}" if len(units) > 1 else f"yaw_rate.{units[0].name}"
    time = np.arange(0.0, DURATION, STEP)
    pulsed = time <= PULSE + STEP / 2
    system = linear_system(truck.vehicle, truck.speed, state_names(truck.vehicle, roll=True))
    if not system.inputs:
        raise VehicleError(f"{truck.vehicle.name}: no axle is steerable; set steerable = true on the front axle")
    pulse = {system.inputs[0]: np.radians(1.0) * np.sin(np.pi * np.minimum(time[pulsed] / PULSE, 1.0))}
    forced = system.response(time[pulsed], pulse)
    values, vectors, _ = truck.modes
    end = np.array([forced[name][-1] for name in system.states])
    modes = vectors[system.states.index(output)] * np.linalg.solve(vectors, end)
    free = np.exp(np.outer(time[~pulsed] - time[pulsed][-1], values)) @ modes
    return time, np.concatenate([forced[output], free.real])


def pulse_damping(time: Array, response: Array) -> float:
    """Damping ratio by the peaks of a response (N,) after the pulse; 1 if it has fewer than two."""
    damping = decay(response[time >= PULSE], SMALLEST_PEAK * float(np.max(np.abs(response))))
    return 1.0 if damping is None else damping


def decay(free: Array, smallest: float) -> float | None:
    """Damping ratio by the peaks of a free response (N,) above the smallest one; None if it has fewer than two.

    A peak is the largest magnitude from one change of sign to the next, after at least one turning point.
    """
    turning = free[np.flatnonzero(np.diff(np.sign(np.diff(free)))) + 1]
    half_waves = np.split(np.abs(turning), np.flatnonzero(np.diff(np.sign(turning))) + 1)
    peaks = np.array([np.max(half_wave, initial=0.0) for half_wave in half_waves])
    peaks = peaks[np.argmax(peaks) :] if len(peaks) else peaks
    peaks = peaks[peaks > smallest]
    if len(peaks) < 2:
        return None
    peaks = peaks[1:] if len(peaks) > 2 else peaks
    decrement = float(np.log(peaks[0] / peaks[-1])) / (len(peaks) - 1)
    return decrement / float(np.hypot(np.pi, decrement))
