"""Left and right turns of a steady-state test apart.

Each direction has its own fit of equation (1) of `steady_state`, with its own steer_0. The offset of the sensor and a
constant bank are in both steer_0 alike; play of the steering and bends that are banked inwards are their difference.
Neither changes the gradient of one direction. So a difference of the gradients is a property of the truck or of the
sensor of its steer angle.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fifthwheel.base.formatting import with_sigma
from fifthwheel.base.types import Array
from fifthwheel.results.evaluate.evaluation import EvaluatedMeasure
from fifthwheel.results.evaluate.jackknife import jackknife, suffices

TURNING = 0.3
"""Least lateral acceleration of a turn to one side, m/s^2: about straight ahead, play hides the direction."""
LEAST_PLAY = math.radians(0.02)
"""A smaller difference of the offsets is no play: the curve of the tyre forces makes one of 0.01 degrees."""
SIGNIFICANT = 3.0
"""Standard deviations by which left and right differ significantly: with 9 degrees of freedom 1.5 % by chance."""
GRADIENT = "rad s^2/m"


@dataclass(frozen=True, kw_only=True)
class Direction:
    """The turns to one side; value and sigma without the uncertainty of the wheelbase."""

    gradient: tuple[float, float]
    offset: tuple[float, float]
    """Steer angle at no lateral acceleration, rad."""
    by_wheelbase: float
    """Change of the gradient by the wheelbase, rad s^2/m per m."""


def directions(X: Array, steer: Array, curvature: Array) -> dict[str, Direction]:
    """Left and right turns; none if the log does not suffice for both.

    Args:
        X: columns of equation (1), (n, 3): lateral acceleration, its rate, offset.
        steer: steer angle less L times the curvature, (n,), rad.
        curvature: (n,), 1/m.
    """
    found = dict[str, Direction]()
    for name, sign in (("left", 1.0), ("right", -1.0)):
        rows = sign * X[:, 0] > TURNING
        if not suffices(X[rows, 0]):
            return {}
        found[name] = Direction(
            gradient=jackknife(X[rows], steer[rows]),
            offset=jackknife(X[rows][:, ::-1], steer[rows]),
            by_wheelbase=-jackknife(X[rows], curvature[rows])[0],
        )
    return found


def gradients(apart: dict[str, Direction], wheelbase_sigma: float, yaw_rate: str) -> Iterator[EvaluatedMeasure]:
    """The understeer gradients to the left and to the right, and their difference; the sigma of the wheelbase in m."""
    for name, found in apart.items():
        value, sigma = found.gradient
        total = float(np.hypot(sigma, found.by_wheelbase * wheelbase_sigma))
        yield gradient_measure(f"understeer_gradient.{name}", f"understeer gradient, {name}", value, total, yaw_rate)
    if apart:
        (left, sigma_left), (right, sigma_right) = (found.gradient for found in apart.values())
        change = apart["left"].by_wheelbase - apart["right"].by_wheelbase
        sigma = float(np.linalg.norm([sigma_left, sigma_right, change * wheelbase_sigma]))
        differs = abs(left - right) > SIGNIFICANT * sigma
        reason = "significant: uneven steering, load to one side, or the steer angle of one wheel" if differs else ""
        title = "understeer gradient, left less right"
        yield gradient_measure("understeer_gradient.difference", title, left - right, sigma, yaw_rate, reason)


def offset_notes(apart: dict[str, Direction]) -> Iterator[str]:
    """Causes of a steer angle at no lateral acceleration, if it is significant."""
    if not apart:
        return
    (left, sigma_left), (right, sigma_right) = (found.offset for found in apart.values())
    sigma = float(np.hypot(sigma_left, sigma_right))
    if abs(left + right) > SIGNIFICANT * sigma:
        yield (
            f"At no lateral acceleration the steer angle is {with_sigma((left + right) / 2, sigma / 2, 'rad')}: the "
            "offset of its sensor, or the bank of the road. No gradient contains it."
        )
    if left - right > max(SIGNIFICANT * sigma, LEAST_PLAY):
        yield (
            f"At no lateral acceleration the steer angle is larger after turns to the left than to the right by "
            f"{with_sigma(left - right, sigma, 'rad')}: play of the steering, or bends that are banked inwards. The "
            "gradient of both directions contains it; those of one direction do not."
        )


def gradient_measure(
    name: str, title: str, value: float, sigma: float, signal: str, reason: str = ""
) -> EvaluatedMeasure:
    """A gradient over the lateral acceleration, rad s^2/m."""
    return EvaluatedMeasure(name, title, GRADIENT, value, sigma, (signal,), reason)
