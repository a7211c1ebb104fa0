"""The minimum of a function of a few variables without its derivatives."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from fifthwheel._types import Array


class Point(NamedTuple):
    """A point and the value of the function there."""

    x: Array  # (n,)
    value: float


def nelder_mead(function: Callable[[Array], float], simplex: Array, *, tolerance: float, iterations: int) -> Point:
    """The best vertex of the simplex of Nelder and Mead (1965, The Computer Journal 7, 308-313).

    Args:
        function: of x (n,).
        simplex: first simplex (n + 1, n).
        tolerance: the search ends when all vertices are within this distance of the best one, in each element of x and
            in the value of the function.
        iterations: largest number of iterations.
    """
    points = _sorted([Point(x, function(x)) for x in simplex])
    for _ in range(1, iterations):
        best, *others = points
        spread = max(np.abs(point.x - best.x).max() for point in others)
        if spread <= tolerance and points[-1].value - best.value <= tolerance:
            break
        worst, second = points[-1], points[-2]
        centre = np.sum([point.x for point in points[:-1]], axis=0) / len(worst.x)

        new = _beyond(function, centre, worst, 1.0)
        if new.value < best.value:
            further = _beyond(function, centre, worst, 2.0)
            new = further if further.value < new.value else new
        elif new.value >= second.value:
            outside = new.value < worst.value
            contracted = _beyond(function, centre, worst, 0.5 if outside else -0.5)
            if contracted.value > new.value if outside else contracted.value >= worst.value:
                shrunk = [best.x + 0.5 * (point.x - best.x) for point in others]
                points = _sorted([best, *[Point(x, function(x)) for x in shrunk]])
                continue
            new = contracted
        points = _sorted([*points[:-1], new])
    return points[0]


def _sorted(points: list[Point]) -> list[Point]:
    return sorted(points, key=lambda point: point.value)


def _beyond(function: Callable[[Array], float], centre: Array, worst: Point, factor: float) -> Point:
    """The point on the line from the worst vertex through the centre, `factor` times as far on the other side."""
    x = (1 + factor) * centre - factor * worst.x
    return Point(x, function(x))
