"""Waveforms that several manoeuvres share: trapezoid, swept sine, band-limited noise, multisine."""

import numpy as np
from numpy.typing import NDArray

from fifthwheel._types import Array


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
    """Discrete Fourier transform (K,) of white Gaussian noise, limited to a frequency band.

    Args:
        size: number of samples over time.
        frequency: (K,), of the transform, Hz.
        low, high: limits of the band, Hz, inclusive.
        seed: seed of the noise.
    """
    band = (frequency >= low) & (frequency <= high)
    return np.asarray(band * np.fft.rfft(np.random.default_rng(seed).normal(size=size)))


def multisine(time: Array, frequency: Array, seed: int) -> Array:
    """Sum (N,) of sines of amplitude 1 with random phases; frequencies (K,) in Hz."""
    phase = np.random.default_rng(seed).uniform(0, 2 * np.pi, len(frequency))
    return np.asarray(np.sin(2 * np.pi * np.outer(time, frequency) + phase).sum(axis=1))
