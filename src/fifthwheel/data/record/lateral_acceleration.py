"""The lateral acceleration of the first unit from its speed and yaw rate."""

import numpy as np

from fifthwheel.base.types import Array
from fifthwheel.data.record.record import Record

AVERAGING_TIME = 0.5
"""Time over which the lateral acceleration is averaged, s."""


def lateral_acceleration(record: Record, unit: str, *, offset: float = 0.0) -> Array:
    """Speed times yaw rate of the first unit, averaged over 0.5 s, m/s^2, (N,); NaN without the signals.

    `offset` is that of the yaw rate, rad/s.
    """
    missing = np.full(len(record), np.nan)
    values = record.signals.get("speed", missing) * (record.signals.get(f"yaw_rate.{unit}", missing) - offset)
    known = np.isfinite(values)
    width = min(max(round(record.rate * AVERAGING_TIME), 1), len(record))  # "same": the length of the longer one
    window = np.ones(width)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.convolve(np.where(known, values, 0.0), window, "same") / np.convolve(known, window, "same")
    return np.where(known, mean, np.nan)


def largest_lateral_acceleration(record: Record, unit: str, *, offset: float = 0.0, min_speed: float = 5.0) -> float:
    """Largest magnitude of speed times yaw rate of the first unit, averaged over 0.5 s, m/s^2; NaN without the signals.

    The record's samples are evenly spaced, apart from gaps. `offset` is that of the yaw rate, rad/s; samples slower
    than `min_speed`, m/s, are left out.
    """
    name = f"yaw_rate.{unit}"
    if name not in record.signals or "speed" not in record.signals:
        return float("nan")
    speed = record.signals["speed"]
    lateral = speed * (record.signals[name] - offset)
    with np.errstate(invalid="ignore"):
        valid = (speed >= min_speed) & np.isfinite(lateral)
    return largest_mean(lateral[valid], round(record.rate * AVERAGING_TIME * valid.mean()) if valid.any() else 1)


def largest_mean(values: Array, width: int) -> float:
    """The largest magnitude of a moving mean of `width` values; NaN without values."""
    if not values.size:
        return float("nan")
    width = min(max(width, 1), values.size)
    total = np.concatenate([[0.0], np.cumsum(values)])
    return float(np.abs((total[width:] - total[:-width]) / width).max())
