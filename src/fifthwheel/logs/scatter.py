"""How much a channel scatters by itself, told from what changes faster than a truck can move."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SLOWEST, FASTEST = 3.0, 10.0
"""Hz. Below, a truck yaws and rolls; above, many sensors filter."""

SEGMENT = 2.0
"""s, the length of the stretches whose spectra are taken."""


def scatter(time: Array, values: Array) -> float | None:
    """Variance of white noise that has a channel's spectral density between 3 and 10 Hz, SI squared.

    The median over Hann-windowed stretches of 2 s and over frequencies, so that a bump or a kerb in less than half of
    them does not count. What a low-pass filter took from the samples' variance it hardly took from this: such samples
    hang together, and are worth no more than fewer of white noise. So do those of a channel that repeats each sample
    until the next comes. Under 20 Hz the upper third of the spectrum is taken, which holds some of the motion; and
    a filter under 5 Hz takes most of the band, so that the variance is then too low by several times.

    Args:
        time: (N,) s, not necessarily regular; a step three times the median one ends a stretch.
        values: (N,), NaN where missing.

    Returns:
        The variance of each sample; None when there are not even four stretches.
    """
    there = np.isfinite(values)
    time, values = time[there], values[there]
    first, held = _held(values)
    time, values = time[first], values[first]
    if time.size < 8:
        return None
    steps = np.diff(time)
    step = float(np.median(steps))
    size = max(round(SEGMENT / step), 12)
    frequency = np.fft.rfftfreq(size, step)
    band = (frequency >= SLOWEST) & (frequency <= FASTEST)
    if frequency[-1] < FASTEST:
        band = frequency >= 2 / 3 * frequency[-1]
    window, ramp = np.hanning(size + 1)[:-1], np.linspace(-1.0, 1.0, size)
    powers = []
    for piece in np.split(values, np.flatnonzero(steps > 3 * step) + 1):
        if piece.size < size:
            continue
        stretches = np.lib.stride_tricks.sliding_window_view(piece, size)[:: size // 2]
        level = stretches - stretches.mean(axis=1, keepdims=True)
        level = level - np.outer(level @ ramp / (ramp @ ramp), ramp)
        powers.append(np.abs(np.fft.rfft(level * window, axis=1)[:, band]) ** 2 / (window @ window))
    if sum(len(power) for power in powers) < 4:
        return None
    # a periodogram's ordinates are exponentially distributed: their median is ln 2 of their mean
    return held * float(np.median(np.concatenate(powers)) / np.log(2))


def _held(values: Array) -> tuple[NDArray[np.int64], int]:
    """Where new samples begin, and how often each is repeated; 1 where values are not repeated at a regular pace."""
    begins = np.flatnonzero(np.diff(values, prepend=np.nan) != 0)
    runs = np.diff(begins, append=values.size)
    usual = int(np.median(runs)) if runs.size else 1
    if usual > 1 and runs.size > 8 and np.mean(np.abs(runs - usual) <= 1) > 0.8:
        return begins, usual
    return np.arange(values.size), 1
