"""Lateral acceleration of the first unit's CoG over time, m/s^2, for the linear model; waveforms for all courses."""

import numpy as np
from numpy.typing import NDArray

from fifthwheel.base.types import Array


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
