"""Lateral acceleration of the first unit's CoG over time, m/s^2: manoeuvres for the linear model."""

import numpy as np

from fifthwheel._types import Array
from fifthwheel.manoeuvres.waveforms import multisine, noise_spectrum, swept_sine, trapezoid


def straight(time: Array) -> Array:
    """Straight ahead: zero (N,)."""
    return np.zeros_like(time)


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


def short_sweep(time: Array) -> Array:
    """Swept sine of 1 m/s^2 from 0.2 to 1.2 Hz, from 1 to 17 s, (N,); it needs the width of about one lane."""
    return swept_sine(time - 1.0, 0.2, 1.2, 16.0) * trapezoid(time - 1.0, 0.0, 16.0, 1.0)


def short_random(time: Array) -> Array:
    """Sines from 2/16 to 1 Hz with random phases, always the same, from 1 to 17 s, (N,); largest value 1 m/s^2."""
    wave = multisine(time - 1.0, np.arange(2, 17) / 16.0, seed=0) * trapezoid(time - 1.0, 0.0, 16.0, 1.0)
    return np.asarray(wave / np.abs(wave).max())
