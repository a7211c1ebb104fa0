"""Lag of a measured channel behind its prediction, with sigma."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fifthwheel.base.types import Array

RATE = 25.0
"""Hz, rate of the comparison; a truck yaws and rolls below 3 Hz."""
MAX_LAG = 2.2
"""s, largest lag that is searched; beyond 2 s only to find the maximum at 2 s."""
_BLOCK = 4.0
"""s; residuals of different blocks count as independent."""
_MIN_SAMPLES = 100
_INVERTED_LAG = 0.3
"""s; an inverted signal lags its prediction by less."""
_AMBIGUITY = 1.05
"""Of several maxima, the smallest lag is used that leaves at most this multiple of the smallest residual variance."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LagCurve:
    """How well a channel is explained by its prediction, delayed by each lag, with free gain and bias.

    For each lag k the model is m(t) = g p(t - k) + b, with g > 0. All lags are compared on the same samples.
    """

    measured: Array
    """(N,) SI, NaN where missing."""
    predicted: Array
    """(N,) SI, NaN where unknown."""
    rows: NDArray[np.intp]
    """(n,) rows that are compared: measured, and predicted at all lags."""
    inverted: float
    """Largest fraction of the variance that is explained with a negative gain, at lags up to 0.3 s."""
    explained: Array
    """(k,) fraction of the variance that is explained, by lag in steps of 1 / RATE, 0 in the middle; 0 for a negative
    gain."""

    @property
    def lags(self) -> Array:
        """(k,) s."""
        steps = self.explained.size // 2
        return np.arange(-steps, steps + 1) / RATE

    def explained_at(self, lag: float) -> float:
        """Explained fraction of the variance at a lag, s."""
        return float(np.interp(lag, self.lags, self.explained))

    def best(self) -> tuple[float, float] | None:
        """Lag of the best explanation and its sigma, s; None without a maximum within the searched range,
        and where the inverted signal is explained better.

        The lag is refined by a parabola. Sigma is that of least squares with the scores summed over blocks of 4 s, so
        that autocorrelated residuals do not make it too small:

            sigma^2 = sum_b (sum_{i in b} s_i)^2 / (sum_i (g p'_i)^2)^2,   s_i = g p'_i e_i,

        with p' the slope of the prediction less what gain and bias explain, and e the residual.
        """
        value, steps = self.explained, self.explained.size // 2
        maxima = np.flatnonzero((value[1:-1] >= value[:-2]) & (value[1:-1] > value[2:])) + 1
        if not maxima.size or self.inverted > value[maxima].max():
            return None
        near = maxima[1 - value[maxima] <= _AMBIGUITY * (1 - value[maxima].max())]
        k = int(near[np.argmin(np.abs(near - steps))])
        before, at, after = value[k - 1 : k + 2]
        lag = (k - steps + 0.5 * (before - after) / (before - 2 * at + after)) / RATE
        gain, slope, residual = self._least_squares(k - steps)
        scores = self._block_sums(gain * slope * residual)
        return float(lag), float(np.sqrt(scores @ scores) / (gain**2 * (slope @ slope)))

    def gain(self) -> tuple[float, float, float] | None:
        """Gain at the best lag, its sigma from the same sums, and the explained fraction of the variance."""
        k = int(self.explained.argmax())
        if not 0 < k < self.explained.size - 1:
            return None
        rows = self.rows - (k - self.explained.size // 2)
        p = self.predicted[rows] - self.predicted[rows].mean()
        gain, _, residual = self._least_squares(k - self.explained.size // 2)
        scores = self._block_sums(p * residual)
        return gain, float(np.sqrt(scores @ scores) / (p @ p)), float(self.explained[k])

    def _least_squares(self, lag: int) -> tuple[float, Array, Array]:
        """Gain, slope p' less what gain and bias explain (n,), and residual (n,) at a lag in steps."""
        rows = self.rows - lag
        m, p = (x - x.mean() for x in (self.measured[self.rows], self.predicted[rows]))
        slope = (self.predicted[rows + 1] - self.predicted[rows - 1]) * RATE / 2
        slope -= slope.mean()
        slope -= p * (p @ slope) / (p @ p)
        gain = float(p @ m / (p @ p))
        residual = m - gain * p
        return gain, slope, residual - slope * (slope @ residual) / (slope @ slope)

    def _block_sums(self, scores: Array) -> Array:
        """Sums (b,) of the scores (n,) over blocks, with a factor for few of them."""
        blocks = np.flatnonzero(np.diff((self.rows / (_BLOCK * RATE)).astype(int), prepend=-1))
        return np.asarray(np.add.reduceat(scores, blocks) * np.sqrt(blocks.size / max(blocks.size - 3, 1)))


def lag_curve(measured: Array, predicted: Array) -> LagCurve | None:
    """The curve of a channel (N,) at RATE, in SI, and its prediction (N,); None for too few samples or no variance."""
    steps = round(MAX_LAG * RATE)
    if measured.size <= 2 * steps + 2:
        return None
    count = np.concatenate([[0], np.cumsum(np.isfinite(predicted))])
    whole = count[2 * steps + 3 :] - count[: -2 * steps - 3] == 2 * steps + 3  # one more row on each side for slopes
    rows = np.flatnonzero(np.pad(whole, steps + 1) & np.isfinite(measured))
    if rows.size < _MIN_SAMPLES:
        return None
    m = measured[rows] - measured[rows].mean()
    correlation = _correlation(m, np.nan_to_num(predicted - np.nanmean(predicted)), rows, steps)
    near = round(_INVERTED_LAG * RATE)
    inverted = -float(correlation[steps - near : steps + near + 1].min())
    return LagCurve(
        measured=measured,
        predicted=predicted,
        rows=rows,
        inverted=max(inverted, 0.0) ** 2,
        explained=np.clip(correlation, 0.0, 1.0) ** 2,  # rounding may give more than 1
    )


def _correlation(m: Array, p: Array, rows: NDArray[np.int64], steps: int) -> Array:
    """Correlation (2 steps + 1,) of m (n,), at `rows`, with p (N,) at row - k, |k| <= steps; by Fourier transforms."""
    size = 1 << (p.size + steps).bit_length()
    at_rows = np.zeros((2, p.size))
    at_rows[0, rows], at_rows[1, rows] = m, 1.0
    transforms = np.fft.rfft(np.stack([*at_rows, p, p**2]), size)
    products = transforms[[0, 1, 1]] * transforms[[2, 2, 3]].conj()
    covariance, total, squares = np.fft.irfft(products, size)[:, np.arange(-steps, steps + 1)]
    variances = (squares - total**2 / rows.size) * (m @ m)
    usable = variances > 1e-12 * squares.max() * (m @ m)
    return np.where(usable, covariance / np.sqrt(np.where(usable, variances, 1.0)), 0.0)
