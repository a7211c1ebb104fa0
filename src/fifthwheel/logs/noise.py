"""What sensors on trucks scatter by: variances to start from, by quantity."""

from collections.abc import Sequence

GYROS = {"roll_rate": (4.52e-4, 4.70e-5), "yaw_rate": (1.52e-5, 1.11e-5)}
"""Variances, (rad/s)^2, of the first unit's gyro and of those behind it: equation (12) of the article."""

OTHERS = {"articulation": 0.005**2, "roll": 0.005**2, "lateral_acceleration": 0.2**2, "sideslip": 0.005**2}
"""Variance of sensors that the article does not have, SI squared."""


def article_gyros(units: Sequence[str]) -> dict[str, float]:
    """The article's sensors: yaw and roll rate of every unit, front to rear, with their variances, (rad/s)^2."""
    return {
        f"{quantity}.{unit}": variances[min(i, 1)]
        for quantity, variances in GYROS.items()
        for i, unit in enumerate(units)
    }
