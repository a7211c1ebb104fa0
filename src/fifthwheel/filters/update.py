"""The measurement update, one scalar channel after another (Bierman 1977; Simon 2006, section 6.1).

With a diagonal R the result equals the update with all channels at once. No matrix is inverted, a missing channel is a
weight of zero, and Joseph's form keeps the covariance positive.
"""

from typing import NamedTuple

import casadi as ca
import numpy as np


class Channel(NamedTuple):
    """What one channel of one sample leaves behind, all scalars."""

    innovation: ca.SX
    variance: ca.SX
    accepted: ca.SX


def joseph(covariance: ca.SX, cross: ca.SX, gain: ca.SX, row: ca.SX, noise: ca.SX) -> ca.SX:
    """(I - K h) P (I - K h)' + K r K' for a scalar channel y = h x + noise of variance r; cross = P h'."""
    left = covariance - gain @ cross.T
    return left - (left @ row.T - noise * gain) @ gain.T


def positive(covariance: ca.SX) -> ca.SX:
    """The same covariance (n, n); where rounding has made it indefinite, made again from its factors U D U', D >= 0.

    A pivot below rounding's share of its diagonal counts as zero, and its column with it, as it must in what is
    positive. Where a gradient runs away, one negative pivot would turn a gain round and blow up.
    """
    n = covariance.shape[0]
    U, D, sound = ca.SX.eye(n), ca.SX.zeros(n), ca.SX(1)
    for j in reversed(range(n)):
        pivot = covariance[j, j] - sum(D[k] * U[j, k] ** 2 for k in range(j + 1, n))
        good = pivot > n * np.finfo(float).eps * covariance[j, j]
        sound *= good
        D[j] = ca.if_else(good, pivot, 0)
        for i in range(j):
            rest = covariance[i, j] - sum(D[k] * U[i, k] * U[j, k] for k in range(j + 1, n))
            U[i, j] = ca.if_else(good, rest / ca.if_else(good, pivot, 1), 0)
    return ca.if_else(sound, covariance, U @ ca.diag(D) @ U.T)


def gate(innovation: ca.SX, variance: ca.SX, weight: ca.SX, limit_squared: ca.SX) -> ca.SX:
    """1 where the channel is there and its innovation within the gate, else 0."""
    return weight * (innovation * innovation <= limit_squared * variance)
