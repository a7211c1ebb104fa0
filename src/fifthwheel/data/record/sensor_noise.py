"""Noise of sensors: that of the article, and the estimate of a channel's own noise."""

from collections.abc import Sequence

import numpy as np

from fifthwheel.base.types import Array
from fifthwheel.data.channels import ROLL_RATE, YAW_RATE
from fifthwheel.data.record.held import held_samples

NOISE_BAND = (3.0, 10.0)
"""Hz. Below this band a truck yaws and rolls; above it many sensors filter."""
SEGMENT = 2.0
"""s, length of the segments whose spectra are computed."""


def article_gyro_variance(units: Sequence[str]) -> dict[str, float]:
    """The article's sensors: yaw and roll rate of every unit, front to rear, with their variances, (rad/s)^2."""
    return {
        f"{gyro.quantity}.{unit}": gyro.noise[min(i, 1)]
        for gyro in (ROLL_RATE, YAW_RATE)
        for i, unit in enumerate(units)
        if gyro.noise
    }


def estimate_noise_variance(time: Array, values: Array) -> float | None:
    """Variance of the white noise whose spectral density is that of a channel between 3 and 10 Hz, SI squared.

    The estimate is the median over Hann-windowed segments of 2 s and over frequencies, so that disturbances in less
    than half of the segments, such as bumps, do not change it. It holds for low-pass filtered channels too: their
    samples have a smaller variance, but they are autocorrelated and count as fewer white samples. The same applies to a
    channel that repeats each sample until the next one. Below a sampling rate of 20 Hz the upper third of the spectrum
    is used, which contains some vehicle motion. A sensor filter below 5 Hz attenuates most of the band: the estimate is
    then too small by a factor of several. The time (N,), s, need not be regular; a step above three median steps ends a
    segment. None for fewer than four segments.
    """
    present = np.isfinite(values)
    time, values = time[present], values[present]
    held = held_samples(time, values)
    repetitions = held.repetitions if held else 1.0
    time, values = (held.time, held.values) if held else (time, values)
    if time.size < 8:
        return None
    steps = np.diff(time)
    step = float(np.median(steps))
    size = max(round(SEGMENT / step), 12)
    frequency = np.fft.rfftfreq(size, step)
    low, high = NOISE_BAND
    band = (frequency >= low) & (frequency <= high)
    if frequency[-1] < high:
        band = frequency >= 2 / 3 * frequency[-1]
    window, ramp = np.hanning(size + 1)[:-1], np.linspace(-1.0, 1.0, size)
    densities = []
    for part in np.split(values, np.flatnonzero(steps > 3 * step) + 1):
        if part.size < size:
            continue
        segments = np.lib.stride_tricks.sliding_window_view(part, size)[:: size // 2]
        detrended = segments - segments.mean(axis=1, keepdims=True)
        detrended = detrended - np.outer(detrended @ ramp / (ramp @ ramp), ramp)
        densities.append(np.abs(np.fft.rfft(detrended * window, axis=1)[:, band]) ** 2 / (window @ window))
    if sum(len(density) for density in densities) < 4:
        return None
    # ordinates of a periodogram are exponentially distributed: their median is ln 2 times their mean
    return repetitions * float(np.median(np.concatenate(densities)) / np.log(2))
