"""Long series with fewer points to draw: no extreme is lost and no gap is bridged."""

import math

import numpy as np
from numpy.typing import NDArray

from fifthwheel.base.types import Array

Index = NDArray[np.int64]

MAX_POINTS = 4000
"""The largest number of points of a line."""
BAND_POINTS = 800
"""The largest number of points of a band."""
MAX_GAPS = 200
"""The largest number of gaps of a line; the longest are kept."""


def extreme_samples(values: Array, limit: int = MAX_POINTS) -> Index:
    """Rows to draw of finite values (N,): the smallest and the largest of each segment, and both ends."""
    count = len(values)
    if count <= limit:
        return np.arange(count)
    segments = max((limit - 2) // 2, 1)
    length = -(-count // segments)
    padded = np.full(segments * length, values[-1])
    padded[:count] = values
    table = padded.reshape(segments, length)
    first = np.arange(segments) * length
    chosen = np.concatenate([[0], first + table.argmin(axis=1), first + table.argmax(axis=1), [count - 1]])
    return np.unique(np.minimum(chosen, count - 1))


def segments(time: Array, values: Array, *, gaps: bool = True) -> list[Index]:
    """Rows of the segments to draw as one line each: finite values without a gap in time.

    A gap is longer than five times the median step of the channel, so a channel with a lower rate than its record has
    no gaps because of its rate. Without `gaps`, each value that is not finite interrupts the line, and nothing else.
    """
    finite = np.flatnonzero(np.isfinite(time) & np.isfinite(values))
    if finite.size < 2:
        return [finite] if finite.size else []
    if not gaps:
        return np.split(finite, np.flatnonzero(np.diff(finite) > 1) + 1)
    steps = np.diff(time[finite])
    ends = np.flatnonzero(steps > 5 * np.median(steps))
    if ends.size > MAX_GAPS:
        ends = np.sort(ends[np.argsort(steps[ends])[-MAX_GAPS:]])
    return np.split(finite, ends + 1)


def rows(time: Array, values: Array, limit: int = MAX_POINTS, *, gaps: bool = True) -> list[Index]:
    """Rows to draw of each segment, about `limit` in total."""
    pieces = segments(time, values, gaps=gaps)
    total = max(sum(len(piece) for piece in pieces), 1)
    return [piece[extreme_samples(values[piece], max(int(limit * len(piece) / total), 4))] for piece in pieces]


def course(time: Array, values: Array, limit: int = MAX_POINTS, *, gaps: bool = True) -> tuple[Array, Array]:
    """Time and values (n,) to draw, about `limit` of them; a NaN in both interrupts the line."""
    pieces = rows(time, values, limit, gaps=gaps)
    if not pieces:
        return np.empty(0), np.empty(0)
    chosen = np.concatenate([np.append(piece, -1) for piece in pieces])[:-1]
    return np.where(chosen < 0, np.nan, time[chosen]), np.where(chosen < 0, np.nan, values[chosen])


def band(time: Array, lower: Array, upper: Array, *, gaps: bool = True) -> list[Array]:
    """Time, lower and upper edge (n,) to draw, about `BAND_POINTS` of them; a NaN in all interrupts the band."""
    pieces = segments(time, lower + upper, gaps=gaps)
    total = max(sum(map(len, pieces)), 1)
    parts = []
    for rows in pieces:
        count = max(int(BAND_POINTS * len(rows) / total), 4)
        parts += [np.full((3, 1), np.nan), np.stack(envelope(time[rows], lower[rows], upper[rows], count))]
    return list(np.concatenate(parts[1:] or [np.empty((3, 0))], axis=1))


def envelope(time: Array, lower: Array, upper: Array, count: int) -> tuple[Array, Array, Array]:
    """Time, lower and upper edge of a band (N,) with at most `count` points, nowhere narrower than the given band."""
    length = -(-len(time) // count)
    if length <= 1:
        return time, lower, upper
    starts = np.arange(0, len(time), length)
    middle = (starts + np.minimum(starts + length, len(time)) - 1) // 2
    at = time[middle]
    at[0], at[-1] = time[0], time[-1]
    return at, np.minimum.reduceat(lower, starts), np.maximum.reduceat(upper, starts)


def runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and last row of each run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def numbers(values: Array, digits: int = 5) -> list[float | None]:
    """Values for JSON, rounded to about `digits` digits of their range; None where not finite."""
    finite = values[np.isfinite(values)]
    if not finite.size:
        return [None] * len(values)
    width = float(np.ptp(finite)) or 1e-4 * float(np.abs(finite).max()) or 1.0
    decimals = int(np.clip(digits - np.ceil(np.log10(width)), -3, 12))
    rounded: list[float | None] = np.round(values, decimals).tolist()
    if finite.size == len(values):
        return rounded
    return [value if value is not None and math.isfinite(value) else None for value in rounded]


def significant(values: Array, digits: int) -> list[float | None]:
    """Values for JSON, each rounded to `digits` significant digits; None where not finite."""
    return [float(f"{value:.{digits}g}") if math.isfinite(value) else None for value in values.tolist()]
