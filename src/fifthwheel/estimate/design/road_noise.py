"""Noise that an uneven road adds to yaw rates, articulation angles and roll rates.

The left and the right track of a road have different heights, so the road rolls under the wheels. With the spectral
density of the height, G(n) = G_0 (n / n_0)^-2 (ISO 8608), and the coherence of two tracks at the distance b on an
isotropic surface (Dodds and Robson 1973), the roll angle of the road has the density

    S(n) = 2 G(n) (1 - x K_1(x)) / b^2,    x = 2 pi n b,    K_1: modified Bessel function,

at n cycles per metre, and S(f) = S(n) / u at the frequency f = n u and the speed u. The axles of a group average it.

Roll rates: each body on its suspension follows the road as a system of one degree of freedom, with K*, C*, roll inertia
and gravity of the linear model; the coupling of the bodies is left out. Yaw rates and articulation angles: the linear
model with the roll angle of the road as its bank.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from fifthwheel.base.types import Array
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.data.channels import ARTICULATION, ROLL_RATE, YAW_RATE, SignalName, is_of
from fifthwheel.estimate.filters.noise_model import NoiseModel, fit_spectrum
from fifthwheel.model import dynamics
from fifthwheel.truck import Unit, Vehicle, laden

ROUGHNESS = 16e-6
"""G_0 of a good road, class A of ISO 8608, at the spatial frequency n_0, m^3."""
REFERENCE_FREQUENCY = 0.1
"""n_0, cycles per metre."""
TRACK = 1.9
"""Distance b of the tracks, m."""
DURATION = 60.0
"""Length of a record whose periodogram counts in the fit of the noise model, s."""


def road_noise(
    vehicle: Vehicle, speed: float, rate: float, sensor: Mapping[str, float], roughness: float = ROUGHNESS
) -> dict[str, NoiseModel]:
    """Noise model of each channel at a speed, m/s: white noise of its sensor, and that of the road.

    `rate` is the sampling rate, Hz, `sensor` the noise variance of each channel, SI squared, `roughness` G_0, m^3.
    """
    frequency = np.arange(1, round(DURATION * rate) // 2 + 1) / DURATION
    models = {}
    for name, variance in sensor.items():
        density = 2 * variance / rate + road_density(vehicle, name, speed, frequency, roughness)
        models[name] = fit_spectrum(frequency, density, 1 / rate, DURATION)
    return models


def road_density(vehicle: Vehicle, channel: str, speed: float, frequency: Array, roughness: float = ROUGHNESS) -> Array:
    """One-sided spectral density (N,), SI squared per Hz, that the road adds to a channel; 0 for an accelerometer.

    At frequencies (N,) above 0, Hz; the others as in `road_noise`.
    """
    signal, omega = SignalName.of(channel), 2 * np.pi * frequency
    road = road_roll_density(frequency, speed, roughness)
    if is_of(channel, ROLL_RATE):
        unit = vehicle.unit(signal.unit)
        return np.asarray(
            road * np.abs(omega * _roll_response(vehicle, unit, omega) * _average(unit, omega / speed)) ** 2
        )
    if is_of(channel, YAW_RATE, ARTICULATION):
        return np.asarray(road * np.abs(_yaw_response(vehicle, channel, speed, omega)) ** 2)
    return np.zeros_like(frequency)


def road_roll_density(frequency: Array, speed: float, roughness: float = ROUGHNESS) -> Array:
    """One-sided density (N,) of the roll angle of the road under a moving axle, rad^2 per Hz; frequency in Hz."""
    from scipy.special import kv  # slow to import

    n = frequency / speed
    x = 2 * np.pi * n * TRACK
    heights = roughness * (n / REFERENCE_FREQUENCY) ** -2.0
    return np.asarray(2 * heights * (1 - x * kv(1, x)) / TRACK**2 / speed)


def _roll_response(vehicle: Vehicle, unit: Unit, omega: Array) -> NDArray[np.complex128]:
    """Roll angle of a body over that of the road."""
    p = vehicle.parameters()
    body = laden(p, unit)
    stiffness = sum(group.total_roll_stiffness for group in unit.axle_groups)
    damping = sum(g.roll_damping * (g.total_roll_stiffness / g.roll_stiffness) ** 2 for g in unit.axle_groups)
    gravity = body.mass * STANDARD_GRAVITY * (body.cog_height - unit.roll_axis_height)
    spring = stiffness + 1j * omega * damping
    return np.asarray(spring / (spring - gravity - omega**2 * body.roll_inertia))


def _average(unit: Unit, wave_number: Array) -> NDArray[np.complex128]:
    """Average of a wave of the road over the axles of a unit, by their roll stiffness; wave number in rad/m."""
    stiffness = sum(group.total_roll_stiffness for group in unit.axle_groups)
    waves = [
        group.total_roll_stiffness
        / stiffness
        * np.mean([np.exp(1j * wave_number * a.position) for a in group.on_road], axis=0)
        for group in unit.axle_groups
    ]
    return np.asarray(sum(waves))


def _yaw_response(vehicle: Vehicle, channel: str, speed: float, omega: Array) -> NDArray[np.complex128]:
    """Response of a yaw rate or an articulation angle to the bank of the road."""
    m = dynamics.matrices(vehicle, speed, roll=True, bank=True)
    A, b, names = m.A[:-1, :-1], m.A[:-1, -1], list(m.states[:-1])
    x = np.linalg.solve(
        1j * omega[:, None, None] * np.eye(len(A)) - A, np.broadcast_to(b, (len(omega), len(b)))[..., None]
    )
    state = {name: x[:, i, 0] for i, name in enumerate(names)}
    signal, units = SignalName.of(channel), [unit.name for unit in vehicle.units]
    if is_of(channel, ARTICULATION):
        return np.asarray(state[f"articulation.{signal.unit}"])
    behind: Sequence[str] = units[1 : units.index(signal.unit) + 1]
    return np.asarray(state[f"yaw_rate.{units[0]}"] + sum(1j * omega * state[f"articulation.{u}"] for u in behind))
