"""What any drive at one speed tells, from two short ones: nobody steers, and one pulse of the steer angle.

At constant speed the model is linear with constant coefficients, so what its outputs' derivatives owe to a drive's steer
angle is the pulse's, convolved with it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import oaconvolve

from fifthwheel.identify.forecast import Forecast
from fifthwheel.identify.manoeuvres import to_record
from fifthwheel.identify.problem import Problem
from fifthwheel.identify.stage import Log
from fifthwheel.simulate import AFTER

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Shares:
    """Information (k, k) of a drive by the power of its size: still + mixed size + moved size^2."""

    still: Array
    mixed: Array
    moved: Array

    def at(self, size: float) -> Array:
        """Information (k, k) of the drive, its steer angle `size` times as large."""
        return self.still + size * self.mixed + size**2 * self.moved


class Echo:
    """The derivatives at one speed.

    Args:
        forecast: of the truck.
        speed: m/s.
        rate: samples a second, Hz.
        noise: variance of each channel that is logged, SI squared.
    """

    def __init__(self, forecast: Forecast, speed: float, *, rate: float, noise: Mapping[str, float]) -> None:
        pulse = np.zeros(round(AFTER * rate))
        places = [forecast.channels.index(name) for name in noise]
        scale = np.sqrt(list(noise.values()))[:, None]

        def derivatives(steer: Array) -> Array:
            record = to_record(forecast.vehicle, speed, steer, rate, "echo")
            log = Log(name="echo", sections=[record])
            problem = Problem(forecast.model, forecast.vehicle, [log], forecast.unknowns, forecast.settings)
            part = problem.part(np.zeros(len(problem.names)), 0, 0)
            self.names = tuple(problem.names[i] for i in part.places)
            return np.asarray(part.jacobian[:, places] / scale)

        self.still = derivatives(pulse)
        pulse[1] = 1.0  # between the samples a steer angle goes linearly, so that it begins to act with the first
        self.pulse = (derivatives(pulse) - self.still)[1:]

    def of(self, steer: Array, marks: Sequence[int]) -> list[Shares]:
        """What a drive tells up to some of its samples.

        Args:
            steer: (N,) rad, zero at first.
            marks: numbers of samples, rising.
        """
        count = marks[-1]
        moved = oaconvolve(steer[:count, None, None], self.pulse, axes=0)[:count]
        still = np.concatenate([self.still, np.repeat(self.still[-1:], max(count - len(self.still), 0), axis=0)])[:count]
        k = len(self.names)
        total, found = [np.zeros((k, k)) for _ in range(3)], []
        for begin, end in zip([0, *marks[:-1]], marks, strict=True):
            a, b = (part[begin:end].reshape(-1, k) for part in (still, moved))
            for sum_, new in zip(total, (a.T @ a, a.T @ b + b.T @ a, b.T @ b), strict=True):
                sum_ += new
            found.append(Shares(still=total[0].copy(), mixed=total[1].copy(), moved=total[2].copy()))
        return found
