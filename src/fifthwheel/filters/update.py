"""The measurement update, channel by channel (Bierman 1977; Simon 2006, section 6.1).

With a diagonal R the result equals the update with all channels together. No matrix is inverted, a missing channel has
the weight 0, and Joseph's form keeps the covariance positive.
"""

from typing import NamedTuple

import casadi as ca
import numpy as np


class ChannelUpdate(NamedTuple):
    """Result of one channel at one sample; scalars."""

    innovation: ca.SX  # 0 if missing
    variance: ca.SX  # of the innovation
    accepted: ca.SX  # 1 if used, else 0


def joseph(covariance: ca.SX, cross: ca.SX, gain: ca.SX, row: ca.SX, noise: ca.SX) -> ca.SX:
    """Joseph's form (I - K h) P (I - K h)' + K r K' for a scalar channel y = h x + v.

    Args:
        covariance: P (n, n).
        cross: P h' (n, 1).
        gain: K (n, 1).
        row: h (1, n).
        noise: r, variance of v.
    """
    left = covariance - gain @ cross.T
    return left - (left @ row.T - noise * gain) @ gain.T


def positive_semidefinite(covariance: ca.SX) -> ca.SX:
    """A covariance (n, n) unchanged, or, if rounding made it indefinite, rebuilt from its factors U D U' with D >= 0.

    A pivot below the rounding error of its diagonal element is set to zero together with its column. Without this, a
    negative pivot inverts the sign of a gain, and the filter diverges where sensitivities grow without bound.
    """
    n = covariance.shape[0]
    U, D, valid = ca.SX.eye(n), ca.SX.zeros(n), ca.SX(1)
    for j in reversed(range(n)):
        pivot = covariance[j, j] - sum(D[k] * U[j, k] ** 2 for k in range(j + 1, n))
        positive = pivot > n * np.finfo(float).eps * covariance[j, j]
        valid *= positive
        D[j] = ca.if_else(positive, pivot, 0)
        for i in range(j):
            remainder = covariance[i, j] - sum(D[k] * U[i, k] * U[j, k] for k in range(j + 1, n))
            U[i, j] = ca.if_else(positive, remainder / ca.if_else(positive, pivot, 1), 0)
    return ca.if_else(valid, covariance, U @ ca.diag(D) @ U.T)


def gate(innovation: ca.SX, variance: ca.SX, weight: ca.SX, limit_squared: ca.SX) -> ca.SX:
    """1 if the channel is measured and its innovation is within the gate, else 0.

    Args:
        innovation, variance: of the channel.
        weight: 1 if measured, else 0.
        limit_squared: squared gate, in variances.
    """
    return weight * (innovation * innovation <= limit_squared * variance)
