"""Slopes with a sigma by a jackknife over segments of consecutive data, which road and wind affect together."""

import numpy as np
from numpy.typing import NDArray

from fifthwheel.base.types import Array

SEGMENTS = 10
"""Of the jackknife."""
SPAN = 0.8
"""Least range of the lateral acceleration without any one of the segments, m/s^2."""


def suffices(acceleration: Array) -> bool:
    """Whether blocks with this lateral acceleration determine a gradient."""
    return acceleration.size >= SEGMENTS + 2 and span(acceleration) >= SPAN


def span(acceleration: Array) -> float:
    """Least range of the lateral acceleration (n,) without one segment, m/s^2: one turn has one acceleration only."""
    if acceleration.size < SEGMENTS:
        return 0.0
    segment = segments(acceleration.size)
    return float(min(np.ptp(acceleration[segment != k]) for k in range(SEGMENTS)))


def segments(size: int) -> NDArray[np.int_]:
    """The segment of each block, (n,)."""
    return np.arange(size) * SEGMENTS // size


def jackknife(X: Array, y: Array) -> tuple[float, float]:
    """First coefficient of the least squares of y (n,) by X (n, k), and its sigma by leaving out each segment.

    Example:
        >>> import numpy as np
        >>> x = np.arange(40.0)
        >>> value, sigma = jackknife(np.column_stack([x, np.ones(40)]), 2 * x + 1)
        >>> round(value, 9), sigma < 1e-9
        (2.0, True)
    """
    scale = np.linalg.norm(X, axis=0)
    scaled = X / np.where(scale > 0, scale, 1.0)

    def first(rows: NDArray[np.bool_]) -> float:
        return float(np.linalg.lstsq(scaled[rows], y[rows], rcond=1e-6)[0][0]) / float(scale[0])

    segment = segments(len(y))
    left_out = np.array([first(segment != k) for k in range(SEGMENTS)])
    sigma = np.sqrt((SEGMENTS - 1) / SEGMENTS * np.sum((left_out - left_out.mean()) ** 2))
    return first(np.ones(len(y), dtype=bool)), float(sigma)
