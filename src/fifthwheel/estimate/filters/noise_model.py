"""The residuals of a channel as white noise plus a discrepancy: their spectrum, their fit, their autocorrelation.

A free-running model does not describe a real vehicle exactly, so its residuals are autocorrelated. They are modelled as
the sum of white sensor noise and a stationary first-order process, the discrepancy (Kennedy and O'Hagan 2001):

    e_k = d_k + v_k,    v_k ~ N(0, r),    d_k = phi d_k-1 + w_k,    var d = q,    phi = exp(-dt / tau).

The innovations of its Kalman filter are white (`filters.tangent`), which turns generalised into ordinary least squares.
r, q and tau maximise the likelihood of Whittle (1953) of the residuals' periodogram.

N autocorrelated residuals contain less information than N independent ones. Sigma and noise variances allow for that by
the long-run covariance (Newey and West 1987).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fifthwheel.base.types import Array

CORRELATION_TIME = 3.0
"""Longest time over which residuals may be autocorrelated, s; used for sigma."""
LONGEST_TIME_CONSTANT = 10.0
"""Of the discrepancy, s; a slower one is not separable from a sensor's offset."""
BINS = 60
"""Number of frequency bins of the periodogram, equally spaced in ln(frequency)."""
EVIDENCE = 6.0
"""A discrepancy is taken up if it raises the log-likelihood by more than this."""
FEWEST_SAMPLES = 64
"""A segment with fewer residuals does not contribute to the fit of the noise model."""


@dataclass(frozen=True, kw_only=True)
class NoiseModel:
    """White noise and discrepancy of one channel."""

    white: float  # variance r of the white noise, SI squared
    discrepancy: float = 0.0  # variance q of the discrepancy, SI squared
    time_constant: float = 1.0  # tau of the discrepancy, s

    def whitened(self, values: Array, dt: float) -> Array:
        """Values (..., N) through the filter that makes noise of this model white with variance 1, once it has settled.

        The spectral density factorises to s^2 |1 - theta z^-1|^2 / |1 - phi z^-1|^2, with s^2 (1 + theta^2) =
        r (1 + phi^2) + q (1 - phi^2) and s^2 theta = r phi. Values before the first are 0.
        """
        from scipy.signal import lfilter  # slow to import

        phi = math.exp(-dt / self.time_constant)
        half = (self.white * (1 + phi**2) + self.discrepancy * (1 - phi**2)) / 2
        variance = half + math.sqrt(max(half**2 - (self.white * phi) ** 2, 0.0))
        theta = self.white * phi / variance
        return np.asarray(lfilter([1.0, -phi], [1.0, -theta], values) / math.sqrt(variance))

    def spectrum(self, frequency: Array, dt: float) -> Array:
        """One-sided spectral density at frequencies in Hz, SI squared per Hz."""
        phi = math.exp(-dt / self.time_constant)
        shape = (1 - phi**2) / (1 - 2 * phi * np.cos(2 * np.pi * frequency * dt) + phi**2)
        return np.asarray(2 * dt * (self.white + self.discrepancy * shape))


def fit_noise_model(segments: Sequence[Array], dt: float) -> NoiseModel:
    """The noise model of the residuals of one channel by maximum likelihood.

    Each segment has residuals (N_i,) without missing samples, at intervals of dt, s.
    """
    long = [s for s in segments if len(s) >= FEWEST_SAMPLES]
    total = max(float(np.mean(np.concatenate(list(segments)) ** 2)), np.finfo(float).tiny)
    if not long:
        return NoiseModel(white=total)
    frequency, density = (np.concatenate(parts) for parts in zip(*(_periodogram(s, dt) for s in long), strict=True))
    return _fit(*_binned(frequency, density), dt, max(len(s) for s in segments) * dt, total)


def fit_spectrum(frequency: Array, density: Array, dt: float, duration: float) -> NoiseModel:
    """The noise model that residuals at intervals of dt, s, over a duration, s, would have with a given spectrum.

    Frequencies (N,), Hz, as those of a periodogram; the density (N,) is one-sided, SI squared per Hz.
    """
    total = max(float(density.sum() / (len(frequency) * 2 * dt)), np.finfo(float).tiny)
    return _fit(*_binned(frequency, density), dt, duration, total)


def _fit(frequency: Array, density: Array, count: Array, dt: float, duration: float, total: float) -> NoiseModel:
    """The noise model of a periodogram in bins (`_binned`), with the total variance of the residuals, SI squared."""
    if len(frequency) < 4:
        return NoiseModel(white=total)
    high = max(float(np.median(density[-max(len(density) // 6, 1) :])) / (2 * dt), 1e-4 * total)
    shortest, longest = 2 * dt, min(LONGEST_TIME_CONSTANT, duration / 4)

    def model(theta: Array) -> NoiseModel:
        r, q, tau = np.exp(np.clip(theta, -80.0, 80.0))
        return NoiseModel(
            white=max(float(r), 1e-6 * total),
            discrepancy=float(q),
            time_constant=float(np.clip(tau, shortest, longest)),
        )

    def cost(theta: Array) -> float:
        expected = model(theta).spectrum(frequency, dt)
        return float(count @ (np.log(expected) + density / expected))

    starts = [
        np.log([high, max(total - high, 1e-3 * total), np.clip(tau, shortest, longest)])
        for tau in (0.05, 0.2, 1.0, 4.0)
    ]
    start = min(starts, key=cost)
    simplex = np.vstack([start, start + np.log(2) * np.eye(3)])
    best = nelder_mead(cost, simplex, tolerance=1e-2, iterations=400)
    fitted = model(best.x)
    white = np.log([total, 1e-12 * total, 1.0])
    if cost(white) <= best.value + EVIDENCE:
        return NoiseModel(white=total)
    return fitted


def _binned(frequency: Array, density: Array) -> tuple[Array, Array, Array]:
    """Frequency, Hz, mean density, SI squared per Hz, and number of values of each bin of periodograms."""
    edges = np.geomspace(frequency.min(), frequency.max() * (1 + 1e-9), BINS + 1)
    bins = np.clip(np.searchsorted(edges, frequency, side="right") - 1, 0, BINS - 1)
    count = np.bincount(bins, minlength=BINS).astype(float)
    used = count > 0
    sums = (np.bincount(bins, weights=values, minlength=BINS)[used] for values in (frequency, density))
    mean_frequency, mean_density = (values / count[used] for values in sums)
    return mean_frequency, mean_density, count[used]


def _periodogram(values: Array, dt: float) -> tuple[Array, Array]:
    """Frequency, Hz, and one-sided density, SI squared per Hz, of a segment (N,), without the mean."""
    density = 2 * dt / len(values) * np.abs(np.fft.rfft(values)[1:]) ** 2
    if len(values) % 2 == 0:
        density[-1] /= 2  # the Nyquist frequency has no negative counterpart
    return np.asarray(np.fft.rfftfreq(len(values), dt)[1:]), np.asarray(density)


def autocorrelation_factor(residuals: Array, lags: int) -> float:
    """How many of the residuals (N,) contain the information of one independent residual, at least 1.

    The factor is their long-run variance over their variance. `lags` is limited to N / 20.
    """
    variance = float(np.mean(residuals**2))
    lags = max(min(lags, len(residuals) // 20), 1)
    long_run = long_run_covariance(residuals[:, None], lags)[0, 0] / len(residuals)
    return max(1.0, float(long_run) / variance)


def long_run_covariance(scores: Array, lags: int) -> Array:
    """Covariance (n, n) of the sum of scores (N, n) that are autocorrelated over up to `lags` samples.

    The estimate of Newey and West (1987) with Bartlett weights. It is positive semi-definite, because it is computed
    as the sum over all windows of `lags` samples: sum_k w_k w_k' / lags, with w_k the sum of the scores in window k.
    """
    edge = np.zeros((lags, scores.shape[1]))
    total = np.cumsum(np.vstack([edge, scores, edge]), axis=0)
    windows = total[lags:] - total[:-lags]
    return np.asarray(np.einsum("ki,kj->ij", windows, windows) / lags)


class Point(NamedTuple):
    """A point and the value of the function there."""

    x: Array  # (n,)
    value: float


def nelder_mead(function: Callable[[Array], float], simplex: Array, *, tolerance: float, iterations: int) -> Point:
    """The best vertex of the simplex of Nelder and Mead (1965, The Computer Journal 7, 308-313), from (n + 1, n).

    The search ends when all vertices are within the tolerance of the best one, in each element of x (n,) and in the
    value of the function, or after so many iterations.
    """
    points = _sorted([Point(x, function(x)) for x in simplex])
    for _ in range(1, iterations):
        best, *others = points
        spread = max(np.abs(point.x - best.x).max() for point in others)
        if spread <= tolerance and points[-1].value - best.value <= tolerance:
            break
        worst, second = points[-1], points[-2]
        centre = np.sum([point.x for point in points[:-1]], axis=0) / len(worst.x)

        new = _beyond(function, centre, worst, 1.0)
        if new.value < best.value:
            further = _beyond(function, centre, worst, 2.0)
            new = further if further.value < new.value else new
        elif new.value >= second.value:
            outside = new.value < worst.value
            contracted = _beyond(function, centre, worst, 0.5 if outside else -0.5)
            if contracted.value > new.value if outside else contracted.value >= worst.value:
                shrunk = [best.x + 0.5 * (point.x - best.x) for point in others]
                points = _sorted([best, *[Point(x, function(x)) for x in shrunk]])
                continue
            new = contracted
        points = _sorted([*points[:-1], new])
    return points[0]


def _sorted(points: list[Point]) -> list[Point]:
    return sorted(points, key=lambda point: point.value)


def _beyond(function: Callable[[Array], float], centre: Array, worst: Point, factor: float) -> Point:
    """The point on the line from the worst vertex through the centre, `factor` times as far on the other side."""
    x = (1 + factor) * centre - factor * worst.x
    return Point(x, function(x))
