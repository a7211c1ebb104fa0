"""Curves through the samples of a signal: a cubic spline through each, and the speed of a record as a smooth curve.

The smooth speed at a time is that of the parabola, and u' that of the line, through the samples around it with Gaussian
weights (J. Fan and I. Gijbels, Local Polynomial Modelling and Its Applications, 1996, chapter 2): both without delay. A
curve through every sample would follow their noise and their steps, so that the cost of an identification would ripple
along the delay of the speed, and a search along it would not converge.
"""

import casadi as ca
import numpy as np

from fifthwheel.base.native import Scan, compiled
from fifthwheel.base.types import Array

WIDTH = 0.28
"""Standard deviation of the weights, s: white noise of 0.1 m/s at 100 Hz gives a u' of 0.025 m/s^2."""
STEP = 0.05
"""Between the points of the curve, s; samples within it are averaged."""
CUT = 4.0
"""Beyond this number of `WIDTH`, samples have no weight."""


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


class SpeedCurve:
    """Speed and its rate between the first and the last sample; outside, the rate is constant.

    Args:
        time: (N,) increasing, s.
        speed: (N,) m/s, finite.
    """

    def __init__(self, time: Array, speed: Array) -> None:
        self._first, self._last = float(time[0]), float(time[-1])
        points = max(round((self._last - self._first) / STEP), 3) + 1
        grid = np.linspace(self._first, self._last, points)
        step = grid[1] - grid[0]
        place = np.rint((time - self._first) / step).astype(np.int64)
        samples = [np.bincount(place, weights, points) for weights in (np.ones(time.size), time - grid[place], speed)]
        present = samples[0] > 0
        offset, mean = (values[present] / samples[0][present] for values in samples[1:])
        knots = grid[present] + offset
        level = np.interp(grid, knots, mean)
        for end, inner in ((0, 1), (-1, -2)) if knots.size > 1 else ():
            level[end] += (mean[end] - mean[inner]) / (knots[end] - knots[inner]) * (grid[end] - knots[end])
        half = np.arange(-round(CUT * WIDTH / step), round(CUT * WIDTH / step) + 1) * step
        weights = np.exp(-0.5 * (half / WIDTH) ** 2)

        def moment(values: Array, power: int) -> Array:
            """Sum of w t^power times the values (N,) about each point, with t from there."""
            return np.convolve(values, weights * (-half) ** power, "full")[half.size // 2 :][:points]

        M, right = [moment(np.ones(points), k) for k in range(5)], np.stack([moment(level, k) for k in range(3)], -1)
        gram = np.stack([np.stack(M[k : k + 3], -1) for k in range(3)], -1)
        parabola, line = (
            np.asarray(np.linalg.solve(gram[:, :n, :n], right[:, :n, None])[..., 0], np.float64) for n in (3, 2)
        )
        self._speed, self._rate = Spline(grid, parabola[:, 0]), Spline(grid, line[:, 1])

    def __call__(self, time: Array) -> tuple[Array, Array, Array, Array]:
        """Speed, m/s, the slope of its curve, m/s^2, u', m/s^2, and the slope of u', m/s^3, at times (M,)."""
        inside = np.clip(time, self._first, self._last)
        (speed, slope), (rate, change) = self._speed(inside), self._rate(inside)
        within = inside == time
        return speed + rate * (time - inside), np.where(within, slope, rate), rate, np.where(within, change, 0.0)
