"""Long series made short enough to draw, without losing an extreme or bridging a gap."""

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]

LIMIT = 4000
"""Most points of a line."""
MOST_GAPS = 200
"""Most gaps of a line; of more, the longest."""


def keep(values: Array, limit: int = LIMIT) -> Index:
    """Which of the values (N,), all finite, to draw: of every stretch its least and its greatest, and both ends."""
    count = len(values)
    if count <= limit:
        return np.arange(count)
    stretches = max((limit - 2) // 2, 1)
    length = -(-count // stretches)
    padded = np.full(stretches * length, values[-1])
    padded[:count] = values
    table = padded.reshape(stretches, length)
    first = np.arange(stretches) * length
    chosen = np.concatenate([[0], first + table.argmin(axis=1), first + table.argmax(axis=1), [count - 1]])
    return np.unique(np.minimum(chosen, count - 1))


def pieces(time: Array, values: Array) -> list[Index]:
    """Rows of the stretches to draw as one line each: finite values, without a hole in time.

    A channel with fewer samples than its record is missing in most rows; it has no hole there. A hole is longer than
    five times the channel's own usual step.
    """
    seen = np.flatnonzero(np.isfinite(values))
    if seen.size < 2:
        return [seen] if seen.size else []
    steps = np.diff(time[seen])
    holes = np.flatnonzero(steps > 5 * np.median(steps))
    if holes.size > MOST_GAPS:
        holes = np.sort(holes[np.argsort(steps[holes])[-MOST_GAPS:]])
    return np.split(seen, holes + 1)


def rows(time: Array, values: Array, limit: int = LIMIT) -> list[Index]:
    """Rows to draw of every stretch, about `limit` in all."""
    parts = pieces(time, values)
    total = max(sum(len(part) for part in parts), 1)
    return [part[keep(values[part], max(int(limit * len(part) / total), 4))] for part in parts]


def envelope(time: Array, lower: Array, upper: Array, count: int) -> tuple[Array, Array, Array]:
    """A band (N,), all finite, in `count` stretches at most, and never narrower than it was."""
    length = -(-len(time) // count)
    if length <= 1:
        return time, lower, upper
    starts = np.arange(0, len(time), length)
    middle = (starts + np.minimum(starts + length, len(time)) - 1) // 2
    at = time[middle]
    at[0], at[-1] = time[0], time[-1]
    return at, np.minimum.reduceat(lower, starts), np.maximum.reduceat(upper, starts)


def runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and last row of every stretch of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def numbers(values: Array, digits: int = 5) -> list[float | None]:
    """For JSON: about so many digits of the span (to a part of 5e-5 with five), None where not finite."""
    finite = values[np.isfinite(values)]
    if not finite.size:
        return [None] * len(values)
    width = float(np.ptp(finite)) or float(np.abs(finite).max()) or 1.0
    decimals = int(np.clip(digits - np.ceil(np.log10(width)), -3, 12))
    rounded: list[float | None] = np.round(values, decimals).tolist()
    if finite.size == len(values):
        return rounded
    return [value if value is not None and math.isfinite(value) else None for value in rounded]
