"""Cubic spline through the samples of a signal."""

import casadi as ca
import numpy as np

from fifthwheel._types import Array
from fifthwheel.native import Scan, compiled


class Spline:
    """Cubic spline, twice continuously differentiable, with the not-a-knot condition at both ends.

    C. de Boor (2001), A Practical Guide to Splines, chapter 4. The slopes at the samples are the solution of a
    tridiagonal system, by elimination without pivoting.

    Args:
        time: (N,) increasing; N is at least 4.
        values: (N,) finite.
    """

    def __init__(self, time: Array, values: Array) -> None:
        self.time, self.values = time, values
        h, rise = np.diff(time), np.diff(values) / np.diff(time)
        first, last = time[2] - time[0], time[-1] - time[-3]
        below = np.concatenate([[0.0], h[1:], [last]])
        diagonal = np.concatenate([h[1:2], 2 * (h[:-1] + h[1:]), h[-2:-1]])
        above = np.concatenate([[first], h[:-1], [0.0]])
        right = np.concatenate(
            [
                [((h[0] + 2 * first) * h[1] * rise[0] + h[0] ** 2 * rise[1]) / first],
                3 * (h[1:] * rise[:-1] + h[:-1] * rise[1:]),
                [(h[-1] ** 2 * rise[-2] + (2 * last + h[-1]) * h[-2] * rise[-1]) / last],
            ]
        )
        _, eliminated = _elimination()(np.zeros(2), np.column_stack([below, diagonal, above, right]), np.zeros(0))
        _, slopes = _substitution()(np.zeros(1), eliminated[::-1], np.zeros(0))
        self.slopes = slopes[::-1, 0]
        self._bend = (self.slopes[:-1] + self.slopes[1:] - 2 * rise) / h
        self._half_curvature = (rise - self.slopes[:-1]) / h - self._bend

    def __call__(self, time: Array) -> tuple[Array, Array]:
        """Values and derivatives (M,) each at times (M,) from the first sample to the last."""
        i = np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, len(self.time) - 2)
        t = time - self.time[i]
        third, second, first = (
            self._bend[i] / (self.time[i + 1] - self.time[i]),
            self._half_curvature[i],
            self.slopes[i],
        )
        return ((third * t + second) * t + first) * t + self.values[i], (3 * third * t + 2 * second) * t + first


@compiled(Scan)
def _elimination() -> ca.Function:
    """carry = output = [above, right] of the row with diagonal 1; sample = [below, diagonal, above, right]."""
    before, row, nothing = ca.SX.sym("before", 2), ca.SX.sym("row", 4), ca.SX.sym("nothing", 0)
    below, diagonal, above, right = ca.vertsplit(row)
    pivot = diagonal - below * before[0]
    later = ca.vertcat(above / pivot, (right - below * before[1]) / pivot)
    return ca.Function("elimination", [before, row, nothing], [later, later])


@compiled(Scan)
def _substitution() -> ca.Function:
    """carry = output = the unknown of the row; sample = [above, right], from the last row to the first."""
    after, row, nothing = ca.SX.sym("after"), ca.SX.sym("row", 2), ca.SX.sym("nothing", 0)
    unknown = row[1] - row[0] * after
    return ca.Function("substitution", [after, row, nothing], [unknown, unknown])
