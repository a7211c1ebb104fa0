"""Gyros of two units that are exchanged: each follows the prediction of the other one."""

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from fifthwheel._types import Array
from fifthwheel.channels import channel_of
from fifthwheel.time_bases.lags import RATE, LagCurve, lag_curve
from fifthwheel.time_bases.predictions import Prediction

_COMMON_LAG = 0.12
"""s; lag of all channels behind a steer angle that is not quite on time."""


def exchanged_pairs(prediction: Prediction) -> Iterator[tuple[str, str]]:
    """Pairs of yaw rates or roll rates that are better explained by the prediction of the other one.

    Exchanged channels have one common lag of up to 0.12 s. They must be explained better than by a free lag of each
    channel, so that a time offset is not taken for an exchange.
    """
    for first, second in combinations(range(len(prediction.names)), 2):
        channel = channel_of(prediction.names[first])
        exchange = channel.exchange if channel else None
        if exchange is None or channel_of(prediction.names[second]) is not channel:
            continue
        straight, crossed = np.inf, np.inf
        for predicted, curves in zip(prediction.predicted, prediction.curves, strict=True):
            own = [curves[first], curves[second]]
            other = [
                lag_curve(prediction.measured[:, measured], predicted[:, by])
                for measured, by in ((first, second), (second, first))
            ]
            if all(curve is not None for curve in (*own, *other)):
                straight = min(straight, sum(float(_residual(curve).min()) for curve in own if curve))
                both = np.array([_residual(curve) for curve in other if curve])
                middle, steps = both.shape[1] // 2, round(_COMMON_LAG * RATE)
                both = both[:, middle - steps : middle + steps + 1]
                both[:, both.max(axis=0) > np.log(1 - exchange.least_explained)] = np.inf
                crossed = min(crossed, float(both.sum(axis=0).min()))
        if crossed < straight - exchange.margin:
            yield prediction.names[first], prediction.names[second]


def _residual(curve: LagCurve) -> Array:
    """Logarithm of the unexplained fraction of the variance (k,) by lag."""
    return np.asarray(np.log(np.maximum(1 - curve.explained, 1e-4)))
