"""Lateral acceleration of the first unit's CoG over time, m/s^2, for the linear model; waveforms for all courses.

The linear model gives the steer angle for an acceleration (`inverse_steer`), and the reverse.
"""

import numpy as np
from numpy.typing import NDArray

from fifthwheel.base.types import Array
from fifthwheel.data.record import Record
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.simulation import free_response
from fifthwheel.truck import Vehicle

DECAY_TIME = 20.0
"""Time without lateral acceleration after a manoeuvre, s, in which the steer angle decays."""
CUTOFF = 10.0
"""Highest frequency of a driver's steer angle, Hz."""


def trapezoid(x: Array, start: float, end: float, ramp: float) -> Array:
    """Rise from 0 to 1 within `ramp` after `start`, and fall to 0 within `ramp` before `end`, (N,)."""
    result: Array = np.clip(np.minimum(x - start, end - x) / ramp, 0, 1)
    return result


def swept_frequency(time: Array, low: float, high: float, duration: float) -> Array:
    """Frequency of the swept sine, (N,): rises linearly from `low` to `high`, Hz, within `duration` s."""
    return low + (high - low) * time / duration


def swept_sine(time: Array, low: float, high: float, duration: float) -> Array:
    """Sine of amplitude 1 whose frequency rises linearly from `low` to `high`, Hz, within `duration` s, (N,)."""
    phase = 2 * np.pi * (low * time + (high - low) * time**2 / (2 * duration))
    return np.sin(phase)


def noise_spectrum(size: int, frequency: Array, low: float, high: float, seed: int) -> NDArray[np.complex128]:
    """Discrete Fourier transform (K,) of `size` samples of white Gaussian noise in a band, Hz, limits included."""
    band = (frequency >= low) & (frequency <= high)
    return np.asarray(band * np.fft.rfft(np.random.default_rng(seed).normal(size=size)))


def sweep(time: Array) -> Array:
    """Swept sine of 1.2 m/s^2 from 0.1 to 1.5 Hz over the whole time (N,), with soft ends."""
    window: Array = np.sqrt(np.maximum(np.sin(np.pi * time / time[-1]), 0.0))
    return 1.2 * swept_sine(time, 0.1, 1.5, time[-1]) * window


def random(time: Array, *, seed: int) -> Array:
    """Gaussian noise (N,) with a flat spectrum between 0.05 and 1 Hz, both excluded, of 0.7 m/s^2 rms.

    The seed itself draws the noise of the sensors, so this noise takes the next one.
    """
    frequency: Array = np.fft.rfftfreq(len(time), time[1] - time[0])
    low, high = np.nextafter(0.05, 1), np.nextafter(1.0, 0)
    result = np.fft.irfft(noise_spectrum(len(time), frequency, low, high, seed + 1), len(time))
    return np.asarray(result * (0.7 / result.std()))


def bend(time: Array) -> Array:
    """A bend of 1 m/s^2 to the left from 1 to 9 s, (N,): entry 1 s, constant 6 s, exit 1 s."""
    return trapezoid(time, 1.0, 9.0, 1.0)


def inverse_steer(vehicle: Vehicle, speed: float, time: Array, acceleration: Array, *, roll: bool = True) -> Array:
    """Steer angle (N,), rad, of the first steered axle for a lateral acceleration (N,) of the first unit's CoG, m/s^2.

    Inverts the linear model, with or without roll, in the frequency domain, up to `CUTOFF`. The inverse is periodic, so
    `DECAY_TIME` without acceleration is appended and removed again: otherwise the decay after the end would appear at
    the start. The vehicle is stable at the constant speed, m/s; the time (N,) is in equal steps, s.
    """
    if not acceleration.any():
        return np.zeros_like(time)
    step = float(time[1] - time[0])
    size = len(time) + round(DECAY_TIME / step)
    spectrum = np.fft.rfft(acceleration, size)
    frequency = np.fft.rfftfreq(size, step)
    m = dynamics.matrices(vehicle, speed, roll=roll)
    response = dynamics.frequency_response(vehicle, speed, frequency, roll=roll)[:, :, 0]
    lateral = m.states.index(f"lateral_velocity.{vehicle.units[0].name}")
    yaw = m.states.index(f"yaw_rate.{vehicle.units[0].name}")
    gain = 2j * np.pi * frequency * response[:, lateral] + speed * response[:, yaw]
    low_pass = 1 / (1 + (frequency / CUTOFF) ** 4)
    return np.fft.irfft(spectrum / gain * low_pass, size)[: len(time)]


def lateral_acceleration(vehicle: Vehicle, speed: float, steer: Array, rate: float) -> Array:
    """Lateral acceleration (N, units), m/s^2, of every unit's CoG by a steer angle (N,), rad.

    The truck is stable at the constant speed, m/s; the sampling rate is in Hz.
    """
    names = [unit.name for unit in vehicle.units]
    outputs = [f"{quantity}.{name}" for quantity in ("lateral_velocity", "yaw_rate") for name in names]
    model = dynamics.model(vehicle, outputs, roll=True)
    record = steer_record(vehicle, speed, steer, rate, "response")
    values = dynamics.all_parameters(vehicle, outputs)
    _, response = free_response(model, values, record.time, {name: record.signals[name] for name in model.inputs})
    velocity, yaw_rate = response[:, : len(names)], response[:, len(names) :]
    return np.asarray(np.gradient(velocity, 1 / rate, axis=0) + speed * yaw_rate)


def steer_record(vehicle: Vehicle, speed: float, steer: Array, rate: float, name: str) -> Record:
    """Record of time, speed and steer angles: the first steered axle has the angle (N,), all others have 0."""
    first, *others = vehicle.steer_signals()
    straight = {other: np.zeros_like(steer) for other in others}
    signals = {"speed": np.full_like(steer, speed), first: steer, **straight}
    return Record(time=np.arange(len(steer)) / rate, signals=signals, name=name)
