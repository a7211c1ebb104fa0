"""What any drive at one speed tells, from two short ones: nobody steers, and one pulse of the steer angle.

At constant speed the model is linear with constant coefficients, so what its outputs' derivatives owe to a drive's steer
angle is the pulse's, convolved with it.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

from fifthwheel.identify.forecast import Forecast
from fifthwheel.identify.manoeuvres import to_record
from fifthwheel.identify.problem import Problem
from fifthwheel.identify.stage import Log
from fifthwheel.simulate import AFTER

Array = NDArray[np.float64]

SIZE = 1e-5
"""rad, of the pulse: the model is linear in it, but how well the start is known goes with the steer angle's scatter."""


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
            return np.asarray(np.moveaxis(part.jacobian, 0, -1)[:, places] / scale)

        self.still = derivatives(pulse)
        pulse[1] = SIZE  # between samples a steer angle goes linearly: this one begins to act after the first
        self.pulse = (derivatives(pulse) - self.still)[1:] / SIZE

    def of(self, steer: Array, period: int, count: int) -> list[Shares]:
        """What 1, 2, ... `count` of a manoeuvre tell, to the left and to the right in turn.

        Args:
            steer: (N,) of one, and of what still swings behind it, rad; zero at first.
            period: samples from the start of one to the start of the next.
        """
        whole = count * period
        one = self._moved(steer)
        moved = np.zeros((whole, *one.shape[1:]))
        for i in range(count):
            here = moved[i * period : i * period + len(one)]
            here += (-1) ** i * one[: len(here)]
        settled = np.repeat(self.still[-1:], max(whole - len(self.still), 0), axis=0)
        still = np.concatenate([self.still, settled])[:whole]
        k = len(self.names)
        total, found = np.zeros((3, k, k)), []
        for i in range(count):
            a, b = (part[i * period : (i + 1) * period].reshape(-1, k) for part in (still, moved))
            total += a.T @ a, a.T @ b + b.T @ a, b.T @ b
            still_, mixed, moved_ = total.copy()
            found.append(Shares(still=still_, mixed=mixed, moved=moved_))
        return found

    def _moved(self, steer: Array) -> Array:
        """What a steer angle (N,) adds to the derivatives, until all is at rest again (N + M, m, k)."""
        whole = len(steer) + len(self.pulse)
        size = next_fast_len(whole, real=True)
        found = irfft(rfft(self.pulse, size, axis=0) * rfft(steer, size)[:, None, None], size, axis=0)
        return np.asarray(found[:whole])
