"""What any drive at one speed tells, from two short ones: nobody steers, and one pulse of the steer angle.

At constant speed the model is linear with constant coefficients. So what the outputs' derivatives owe to the steer
angle of a drive is the pulse's, convolved with it; and each of the unknowns is shown either by steering, as a stiffness
is, or without, as a sensor's zero.
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
class Share:
    """Information of a drive of unit size (k, k), and which unknowns steering shows (k,)."""

    unit: Array
    steered: NDArray[np.bool_]

    def at(self, size: float) -> Array:
        """Information (k, k) of the drive with a steer angle `size` times as large."""
        grown = np.where(self.steered, size, 1.0)
        return np.asarray(self.unit * np.outer(grown, grown))


class Echo:
    """The derivatives at one speed.

    Args:
        forecast: of the truck, stable at this speed.
        speed: m/s.
        rate: samples a second, Hz.
        noise: variance of each channel that is logged, SI squared.
    """

    def __init__(self, forecast: Forecast, speed: float, *, rate: float, noise: Mapping[str, float]) -> None:
        pulse = np.zeros(round(AFTER * rate))
        places = [forecast.channels.index(name) for name in noise]
        scale = np.sqrt(list(noise.values()))

        def derivatives(steer: Array) -> Array:
            """Of the channels, by their noise (k, M, m)."""
            log = Log(name="echo", sections=[to_record(forecast.vehicle, speed, steer, rate, "echo")])
            problem = Problem(forecast.model, forecast.vehicle, [log], forecast.unknowns, forecast.settings)
            part = problem.part(np.zeros(len(problem.names)), 0, 0)
            self.names = tuple(problem.names[i] for i in part.places)
            return np.asarray(part.jacobian[..., places] / scale)

        self.still = derivatives(pulse)
        self.steered = np.asarray(~self.still.any(axis=(1, 2)), dtype=np.bool_)
        pulse[1] = SIZE  # between samples a steer angle goes linearly: this one begins to act after the first
        self.pulse = derivatives(pulse)[:, 1:] / SIZE * self.steered[:, None, None]

    def of(self, steer: Array, period: int, count: int) -> list[Share]:
        """What 1, 2, ... `count` of a manoeuvre tell, to the left and to the right in turn.

        Args:
            steer: (N,) of one, and of what still swings behind it, rad; zero at first.
            period: samples from the start of one to the start of the next.
        """
        whole, one = count * period, self._moved(steer)
        settled = np.repeat(self.still[:, -1:], max(whole - self.still.shape[1], 0), axis=1)
        found = np.concatenate([self.still, settled], axis=1)[:, :whole]
        for i in range(count):
            here = found[:, i * period : i * period + one.shape[1]]
            here += (-1) ** i * one[:, : here.shape[1]]
        k = len(self.names)
        shares, total = [], np.zeros((k, k))
        for i in range(count):
            rows = found[:, i * period : (i + 1) * period].reshape(k, -1)
            total = total + rows @ rows.T
            shares.append(Share(unit=total, steered=self.steered))
        return shares

    def _moved(self, steer: Array) -> Array:
        """What a steer angle (N,) adds to the derivatives, until all is at rest again (k, N + M, m)."""
        whole = len(steer) + self.pulse.shape[1]
        size = next_fast_len(whole, real=True)
        found = irfft(rfft(self.pulse, size, axis=1) * rfft(steer, size)[:, None], size, axis=1)
        return np.asarray(found[:, :whole])
