"""The derivative of a noisy speed, by a filter with fading memory.

The estimates of the speed u and its derivative u' are those of a line through all past samples with weights that fall
as exp(-2 t / T), for equal steps (E. Brookner, Tracking and Kalman Filtering Made Easy, 1998, 1.2.6). The transfer
function from speed to u' is s / (1 + T s)^2: u' is 2 T late, and noise of the standard deviation sigma at each of
samples dt apart gives u' one of sigma sqrt(dt / (4 T^3)).
"""

import math
from collections.abc import Callable
from typing import Any, cast

import casadi as ca
import numpy as np

from fifthwheel.base.lazy import lazy
from fifthwheel.base.native import Scan, compiled
from fifthwheel.base.types import Array

TIME_CONSTANT = 0.2
"""T by default, s: noise of 0.1 m/s at 100 Hz gives one of 0.06 m/s^2."""
START = np.zeros(2)
"""The carry before the first sample."""


@compiled(Scan)
def speed_rate_step() -> ca.Function:
    """The filter: carry = [u, u'], m/s and m/s^2; sample = [time since the last sample, s, speed, whether the filter
    starts]; constant = [1 / T]; output = [u']. The time is above 0 also at a start."""
    carry, sample, constant = ca.SX.sym("carry", 2), ca.SX.sym("sample", 3), ca.SX.sym("constant")
    dt, speed, starts = ca.vertsplit(sample)
    memory = ca.exp(-dt * constant)
    predicted = carry[0] + carry[1] * dt
    residual = speed - predicted
    u = predicted + (1 - memory**2) * residual
    rate = carry[1] + (1 - memory) ** 2 * residual / dt
    later = ca.vertcat(ca.if_else(starts, speed, u), ca.if_else(starts, 0, rate))
    return ca.Function("speed_rate", [carry, sample, constant], [later, later[1]])


def speed_rates(time: Array, speed: Array, time_constant: float, max_gap: float) -> Array:
    """u' (N,), m/s^2, of measured speeds (N,), m/s, without missing values, causal.

    With an infinite time constant T, u' is 0. After more than `max_gap` between two samples the filter starts again.
    """
    dt = np.diff(time, prepend=-np.inf)
    starts = ~((dt <= max_gap) & np.isfinite(dt))
    samples = np.column_stack([np.where(starts, 1.0, dt), speed, starts])
    _, rates = speed_rate_step()(START, samples, np.array([1 / time_constant]))
    return np.asarray(rates[:, 0])


class SpeedRate:
    """`speed_rates` sample by sample; the same values bit for bit."""

    def __init__(self, time_constant: float, max_gap: float) -> None:
        self.time_constant, self.max_gap = time_constant, max_gap
        self.carry = START.copy()

    def __getstate__(self) -> dict[str, Any]:
        """What a copy does not build anew."""
        return {name: value for name, value in vars(self).items() if name != "_memory"}

    @lazy
    def _memory(self) -> tuple[Any, Any, Callable[[], None]]:
        """Memory of sample and output, and the step on it."""
        sample, rate = np.zeros(3), np.zeros(1)
        arrays = self.carry, sample, np.array([1 / self.time_constant]), rate
        return sample.data, rate.data, speed_rate_step().bound(*arrays)

    def update(self, age: float, speed: float) -> float:
        """u' with a speed that was measured `age` seconds after the last one, infinite for the first one."""
        sample, rate, step = self._memory
        starts = not (age <= self.max_gap and math.isfinite(age))
        sample[0], sample[1], sample[2] = 1.0 if starts else age, speed, starts
        step()
        return cast(float, rate[0])
