"""Whether a drive tells anything of the vehicle, by what its driver does.

States and measurements are no measure of that: on a straight road they are noise, and noise looks like excitation.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from fifthwheel import dynamics
from fifthwheel.errors import SignalError
from fifthwheel.filters.twice import Looks
from fifthwheel.vehicle import Vehicle


@dataclass(frozen=True, kw_only=True)
class LearnerSettings:
    """When a `Learner` learns, and how long it bears faults."""

    start: float = 0.25
    """Learning starts when the lateral acceleration that the steer angle asks for swings by so much, m/s^2 rms."""
    stop: float = 0.1
    """And it stops when it swings by no more than this, m/s^2 rms."""
    window: float = 0.5
    """The swing is a mean over about so long, s."""
    curve: float = 4.0
    """What lasts longer than this, s, is no swing but a curve or a wrong zero of the steer sensor."""
    settle: float = 1.0
    """Nothing is learned so long after a start or a gap, s."""
    looks: Looks = field(default_factory=Looks)
    """How often the samples from which it learned are gone over again."""
    misfit: float = 2.0
    """No parameter counts as converged while a channel's innovations are, in the mean square, so many times what the
    filter thinks they may be."""
    window_misfit: float = 10.0
    """That mean is over about so long a time of learning, s."""
    stale: float = 0.1
    """A steer angle missing for longer than this, s, leaves a wrong state; for `settle` seconds nothing is learned."""
    hold: float = 0.5
    """A missing speed or steer angle keeps its last value for so long, s."""
    jump: float = 3.0
    """A steer angle that changes faster than this, rad/s, counts as missing; no driver turns the wheels so fast."""
    surge: float = 2.0
    """So does a speed that differs by more than this from the last one, m/s."""
    coast: float = 1.0
    """Without an accepted measurement for so long, s, the status is COASTING, or the state starts anew if there were
    any."""
    max_gap: float = 1.0
    """After a longer gap in time, s, the state starts anew; what was learned stays."""

    def __post_init__(self) -> None:
        for name in (
            "start",
            "stop",
            "window",
            "curve",
            "misfit",
            "window_misfit",
            "jump",
            "surge",
            "coast",
            "max_gap",
        ):
            if not getattr(self, name) > 0:
                raise SignalError(f"{name}: expected above 0, got {getattr(self, name)}")
        for name in ("settle", "stale", "hold"):
            if not getattr(self, name) >= 0:
                raise SignalError(f"{name}: expected 0 or more, got {getattr(self, name)}")
        if self.stop > self.start:
            raise SignalError(f"stop: expected at most start, {self.start:g} m/s^2, got {self.stop:g}")


class Excitation:
    """A causal measure of how much is being steered.

    A steer angle d asks for the lateral acceleration u^2 d / (L + K u^2) of a car of the first unit's wheelbase L and
    the vehicle's understeer gradient K. Its mean over `curve` seconds is taken off, and what is left is squared and
    averaged over `window` seconds; the steered axle that swings most counts.

    Args:
        vehicle: as it is known before the drive; what is learned does not change what is learned from.
        axles: how many steer angles there are.
    """

    def __init__(self, vehicle: Vehicle, axles: int, settings: LearnerSettings) -> None:
        self.settings, self.axles = settings, axles
        self.length = vehicle.wheelbase
        speed = 20.0
        m = dynamics.matrices(vehicle, speed, roll=False)
        turning = m.states.index(f"yaw_rate.{vehicle.units[0].name}")
        gain = -speed * float(np.linalg.solve(m.A, m.B[:, 0])[turning])
        self.understeer = max(1 / gain - self.length / speed**2, 0.0) if gain > 0 else 0.0
        self.restart()

    def restart(self) -> None:
        """Forget what was steered."""
        self.mean = [math.nan] * self.axles
        self.power = [0.0] * self.axles
        self.on = False

    def __call__(self, dt: float, inputs: Sequence[float]) -> bool:
        """Whether to learn from the sample that comes dt seconds after the last one; speed, m/s, and angles, rad."""
        settings, squared = self.settings, inputs[0] * inputs[0]
        gain = squared / (self.length + self.understeer * squared)
        slow, quick = dt / (settings.curve + dt), dt / (settings.window + dt)
        for i in range(self.axles):
            asked, mean = gain * inputs[1 + i], self.mean[i]
            if mean != mean:  # not a number: the first one
                mean = asked
            self.mean[i] = mean = mean + slow * (asked - mean)
            self.power[i] += quick * ((asked - mean) ** 2 - self.power[i])
        limit = settings.stop if self.on else settings.start
        self.on = max(self.power) > limit * limit
        return self.on
