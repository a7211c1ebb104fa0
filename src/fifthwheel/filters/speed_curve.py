"""The speed of a record as a smooth curve, with its derivatives at any time.

The speed at a time is that of the parabola, and u' that of the line, through the samples around it with Gaussian
weights (J. Fan and I. Gijbels, Local Polynomial Modelling and Its Applications, 1996, chapter 2): both without delay. A
curve through every sample would follow their noise and their steps, so that the cost of an identification would ripple
along the delay of the speed, and a search along it would not converge.
"""

import numpy as np

from fifthwheel._types import Array
from fifthwheel.filters.spline import Spline

WIDTH = 0.28
"""Standard deviation of the weights, s: white noise of 0.1 m/s at 100 Hz gives a u' of 0.025 m/s^2."""
STEP = 0.05
"""Between the points of the curve, s; samples within it are averaged."""
CUT = 4.0
"""Beyond this number of `WIDTH`, samples have no weight."""


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
