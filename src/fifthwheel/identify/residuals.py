"""Autocorrelated residuals: their long-run covariance, and the autocorrelation factor of a channel.

A model error leaves residuals that are autocorrelated. N such residuals contain less information than N independent
ones. Sigma and noise variances allow for that by the long-run covariance (Newey and West 1987).
"""

import numpy as np

from fifthwheel._types import Array


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
