"""What a learner computes from the steer angles: inputs of its model, and whether to learn from a sample."""

import math
from collections.abc import Sequence

import numpy as np

from fifthwheel.estimate.filters.step_rows import SMALLEST_PLAY
from fifthwheel.estimate.identify.online.settings import LearnerSettings
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.tyres import Tyres
from fifthwheel.truck import Vehicle

REFERENCE_SPEED = 20.0
"""Speed at which the understeer gradient is computed, m/s."""
NO_LIMIT = 1e6
"""More than any acceleration, m/s^2; a number that C has too."""


class PlayContacts:
    """The contacts of the plays of some steer angles, sample by sample; see `step_rows.play_contact`."""

    def __init__(self, count: int) -> None:
        self._contacts = [0.0] * count

    def update(
        self, gap: float, last: Sequence[float], inputs: Sequence[float], plays: Sequence[float]
    ) -> tuple[list[float], list[float]]:
        """Inputs of the extended model at both ends of a step of `gap` seconds.

        `last` and `inputs` are speed and steer angles there; `plays`, rad, is empty if they are exactly zero.
        """
        before = self._contacts
        after = list(before)
        for i, play in enumerate(plays):
            step = (inputs[1 + i] - last[1 + i]) / max(play, SMALLEST_PLAY)
            after[i] = min(0.5, max(-0.5, before[i] + step))
        self._contacts = after
        end = 1 + len(before)  # of the steer angles; then what is derived from the speed
        rates = [(b - a) / max(gap, 1e-3) for a, b in zip(last[1:end], inputs[1:end], strict=True)]
        before_step, after_step = ([*x[:end], *c, *rates, *x[end:]] for x, c in ((last, before), (inputs, after)))
        return before_step, after_step


class Excitation:
    """A causal measure of the steering excitation.

    States and measurements do not measure it: on a straight road they are noise, and noise looks like excitation.

    A steer angle d corresponds to the steady lateral acceleration u^2 d / (L + K u^2), with the wheelbase L of the
    first unit and the understeer gradient K of the vehicle. Its mean over `high_pass_time` is subtracted; the rest is
    squared and averaged over `excitation_window`. The steered axle with the largest result counts. Beyond
    `max_lateral_acceleration`, averaged over the same time, or `max_speed_rate` nothing is learned, except of tyres
    that saturate.
    Estimates do not change the excitation.
    """

    def __init__(self, vehicle: Vehicle, axles: int, settings: LearnerSettings, *, tyres: Tyres = "linear") -> None:
        self.settings, self.axles = settings, axles
        limits = settings.max_lateral_acceleration, settings.max_speed_rate
        self.largest, self.largest_rate = limits if tyres == "linear" else (NO_LIMIT, NO_LIMIT)
        self.wheelbase, self.understeer = vehicle.wheelbase, _understeer_gradient(vehicle)
        self.restart()

    def restart(self) -> None:
        """Discard all samples."""
        self.mean = [math.nan] * self.axles
        self.power = [0.0] * self.axles
        self.level = [0.0] * self.axles
        self.speed_rate = 0.0
        self.on = False

    def update(self, dt: float, inputs: Sequence[float]) -> bool:
        """Whether to learn from the speed, m/s, the steer angles, rad, and the derivative of the speed, m/s^2, of a
        sample dt seconds after the last one."""
        self.speed_rate = inputs[-1]
        settings, squared = self.settings, inputs[0] * inputs[0]
        gain = squared / (self.wheelbase + self.understeer * squared)
        slow, fast = dt / (settings.high_pass_time + dt), dt / (settings.excitation_window + dt)
        for i in range(self.axles):
            acceleration, mean = gain * inputs[1 + i], self.mean[i]
            if mean != mean:  # NaN at the first sample
                mean = acceleration
            self.mean[i] = mean = mean + slow * (acceleration - mean)
            self.power[i] += fast * ((acceleration - mean) ** 2 - self.power[i])
            self.level[i] += fast * (acceleration - self.level[i])
        limit = settings.stop_excitation if self.on else settings.start_excitation
        self.on = max(self.power) > limit * limit and not self.is_beyond_limit
        return self.on

    @property
    def is_beyond_limit(self) -> bool:
        """Whether the averaged acceleration of a steer angle, or the derivative of the speed, exceeds its limit."""
        return max(map(abs, self.level)) > self.largest or abs(self.speed_rate) > self.largest_rate


def _understeer_gradient(vehicle: Vehicle) -> float:
    """Understeer gradient K, rad s^2, by the steady yaw rate of the linear model; 0 for an oversteering vehicle."""
    speed = REFERENCE_SPEED
    m = dynamics.matrices(vehicle, speed, roll=False)
    yaw_rate = m.states.index(f"yaw_rate.{vehicle.units[0].name}")
    gain = -speed * float(np.linalg.solve(m.A, m.B[:, 0])[yaw_rate])
    return max(1 / gain - vehicle.wheelbase / speed**2, 0.0) if gain > 0 else 0.0
