"""The residuals of a channel as white noise plus a discrepancy: their spectrum, their fit, and their whitening.

A free-running model does not describe a real vehicle exactly, so its residuals are autocorrelated. They are modelled as
the sum of white sensor noise and a stationary first-order process, the discrepancy (Kennedy and O'Hagan 2001):

    e_k = d_k + v_k,    v_k ~ N(0, r),    d_k = phi d_k-1 + w_k,    var d = q,    phi = exp(-dt / tau).

The innovations of its Kalman filter, divided by their standard deviation, are white with variance 1. The same filter
applied to the derivatives of the residuals turns generalised into ordinary least squares.
r, q and tau maximise the likelihood of Whittle (1953) of the residuals' periodogram.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from fifthwheel._types import Array

LONGEST_TIME_CONSTANT = 10.0
"""Of the discrepancy, s; a slower one is not separable from a sensor's offset."""
BINS = 60
"""Number of frequency bins of the periodogram, equally spaced in ln(frequency)."""
EVIDENCE = 6.0
"""A discrepancy is taken up if it raises the log-likelihood by more than this."""
STATIONARY = 1e-6
"""The filter is stationary when the variance of its innovation is within this fraction of the stationary one."""
FEWEST_SAMPLES = 64
"""A segment with fewer residuals does not contribute to the fit of the noise model."""


@dataclass(frozen=True, kw_only=True)
class NoiseModel:
    """White noise and discrepancy of one channel."""

    white: float
    """Variance r of the white noise, SI squared."""
    discrepancy: float = 0.0
    """Variance q of the discrepancy, SI squared."""
    time_constant: float = 1.0
    """tau of the discrepancy, s."""

    @property
    def variance(self) -> float:
        """Variance of a residual, r + q."""
        return self.white + self.discrepancy

    def filter(self, dt: float) -> tuple[float, float, float]:
        """phi, the stationary Kalman gain K, and the standard deviation of an innovation, at a sample interval in s."""
        phi, r, q = math.exp(-dt / self.time_constant), self.white, self.discrepancy
        b = r * (1 - phi**2) - (1 - phi**2) * q
        P = (-b + math.sqrt(b * b + 4 * r * (1 - phi**2) * q)) / 2  # stationary variance of the prediction of d
        return phi, P / (P + r), math.sqrt(P + r)

    def first_gains(self, dt: float) -> Iterator[tuple[float, float]]:
        """Gain and standard deviation of the innovation at the first samples of a segment, until both are stationary.

        The variance P of the prediction of d starts at q.
        """
        phi, _, stationary = self.filter(dt)
        r, P = self.white, self.discrepancy
        while P + r > stationary**2 * (1 + STATIONARY):
            yield P / (P + r), math.sqrt(P + r)
            P = phi**2 * P * r / (P + r) + (1 - phi**2) * self.discrepancy

    def spectrum(self, frequency: Array, dt: float) -> Array:
        """One-sided spectral density at frequencies in Hz, SI squared per Hz."""
        phi = math.exp(-dt / self.time_constant)
        shape = (1 - phi**2) / (1 - 2 * phi * np.cos(2 * np.pi * frequency * dt) + phi**2)
        return np.asarray(2 * dt * (self.white + self.discrepancy * shape))


class Whitener:
    """Whitens the residuals of one channel, and their derivatives, piece by piece along a segment.

    Before the first sample nothing is known of the discrepancy but its variance q. The gain of the Kalman filter falls
    from there to the stationary one within the first samples; from then on it is a recursive filter.

    Args:
        model: of the channel.
        dt: sample interval, s.
    """

    def __init__(self, model: NoiseModel, dt: float) -> None:
        self.phi, self.gain, self.deviation = model.filter(dt)
        self._first = list(model.first_gains(dt))
        self._prediction: Array | None = None  # of the discrepancy at the next sample

    def __call__(self, rows: Array) -> Array:
        """Rows (..., N) of consecutive samples, whitened, with variance 1; the next call continues from here."""
        if self.gain == 0.0:
            return rows / self.deviation
        from scipy.signal import lfilter  # slow to import

        prediction = np.zeros(rows.shape[:-1]) if self._prediction is None else self._prediction
        n = min(len(self._first), rows.shape[-1])
        first, self._first = self._first[:n], self._first[n:]
        whitened = np.empty(rows.shape)
        for k, (gain, deviation) in enumerate(first):
            innovation = rows[..., k] - prediction
            prediction = self.phi * (prediction + gain * innovation)
            whitened[..., k] = innovation / deviation
        if n < rows.shape[-1]:
            numerator, denominator = [1.0, -self.phi], [1.0, -self.phi * (1 - self.gain)]
            innovations, state = lfilter(numerator, denominator, rows[..., n:], zi=-prediction[..., None])
            whitened[..., n:] = innovations / self.deviation
            prediction = -state[..., 0]
        self._prediction = prediction
        return whitened


def fit_noise_model(segments: Sequence[Array], dt: float) -> NoiseModel:
    """The noise model of the residuals of one channel by maximum likelihood.

    Args:
        segments: residuals of each segment (N_i,), without missing samples.
        dt: sample interval, s.
    """
    from scipy.optimize import minimize  # slow to import

    frequency, density, count = _binned_periodogram([s for s in segments if len(s) >= FEWEST_SAMPLES], dt)
    everything = np.concatenate(list(segments))
    total = max(float(np.mean(everything**2)), np.finfo(float).tiny)
    if len(frequency) < 4:
        return NoiseModel(white=total)
    high = max(float(np.median(density[-max(len(density) // 6, 1) :])) / (2 * dt), 1e-4 * total)
    shortest, longest = 2 * dt, min(LONGEST_TIME_CONSTANT, max(len(s) for s in segments) * dt / 4)

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
    simplex = np.vstack([start, start + np.log(2) * np.eye(3)])  # the default one depends on the unit of the residuals
    options = {"xatol": 1e-2, "fatol": 1e-2, "maxiter": 400, "initial_simplex": simplex}
    best = minimize(cost, start, method="Nelder-Mead", options=options)
    fitted = model(np.asarray(best.x))
    white = np.log([total, 1e-12 * total, 1.0])
    if cost(white) <= best.fun + EVIDENCE:
        return NoiseModel(white=total)
    return fitted


def _binned_periodogram(segments: Sequence[Array], dt: float) -> tuple[Array, Array, Array]:
    """Frequency, Hz, mean density, SI squared per Hz, and number of values of each bin of the periodograms."""
    from scipy.signal import periodogram  # slow to import

    if not segments:
        return np.zeros(0), np.zeros(0), np.zeros(0)
    pairs = [periodogram(s, 1 / dt, window="boxcar", detrend=False) for s in segments]
    frequency, density = (np.concatenate([pair[i][1:] for pair in pairs]) for i in (0, 1))
    edges = np.geomspace(frequency.min(), frequency.max() * (1 + 1e-9), BINS + 1)
    bins = np.clip(np.searchsorted(edges, frequency, side="right") - 1, 0, BINS - 1)
    count = np.bincount(bins, minlength=BINS).astype(float)
    used = count > 0
    sums = (np.bincount(bins, weights=values, minlength=BINS)[used] for values in (frequency, density))
    mean_frequency, mean_density = (values / count[used] for values in sums)
    return mean_frequency, mean_density, count[used]
