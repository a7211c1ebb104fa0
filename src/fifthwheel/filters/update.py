"""The measurement update, one scalar channel after another (Bierman 1977; Simon 2006, section 6.1).

With a diagonal R the result equals the update with all channels at once. No matrix is inverted, a missing channel is a
weight of zero, and Joseph's form keeps the covariance positive.
"""

from typing import NamedTuple

import casadi as ca


class Channel(NamedTuple):
    """What one channel of one sample leaves behind, all scalars."""

    innovation: ca.SX
    variance: ca.SX
    accepted: ca.SX


def joseph(covariance: ca.SX, cross: ca.SX, gain: ca.SX, row: ca.SX, noise: ca.SX) -> ca.SX:
    """(I - K h) P (I - K h)' + K r K' for a scalar channel y = h x + noise of variance r; cross = P h'."""
    left = covariance - gain @ cross.T
    return left - (left @ row.T - noise * gain) @ gain.T


def gate(innovation: ca.SX, variance: ca.SX, weight: ca.SX, limit_squared: ca.SX) -> ca.SX:
    """1 where the channel is there and its innovation within the gate, else 0."""
    return weight * (innovation * innovation <= limit_squared * variance)
