"""Speed and steer angles of a live filter, each held at its last plausible value while it is missing."""

import math
from collections.abc import Sequence

from fifthwheel.checks.samples import MAX_SPEED
from fifthwheel.identify.online.settings import LearnerSettings
from fifthwheel.observe import Status


class HeldInputs:
    """The last plausible speed and steer angles, and when each was measured.

    Args:
        count: number of inputs: the speed and the steer angles.
        settings: limits.
        min_speed: speed below which the status is TOO_SLOW, m/s.
    """

    def __init__(self, count: int, settings: LearnerSettings, min_speed: float) -> None:
        self.settings, self.min_speed = settings, min_speed
        self._values = [math.nan] * count
        self._measured_at = [-math.inf] * count  # s
        self._last_dropout = -math.inf  # last time of a steer angle older than max_steer_dropout, s

    def update(self, time: float, measured: Sequence[float | None]) -> tuple[Status, list[float]]:
        """Status and inputs at this time, s; a value that is None, NaN or not plausible is missing."""
        missing = False
        for i, value in enumerate(measured):
            age = time - self._measured_at[i]
            if value is not None and math.isfinite(value) and self._is_plausible(i, value, age):
                self._values[i], self._measured_at[i] = float(value), time
            elif not age <= self.settings.hold:
                missing = True
            elif i and age > self.settings.max_steer_dropout:
                self._last_dropout = time
        if missing:
            return Status.INPUT_MISSING, self._values
        too_slow = self._values[0] < self.min_speed
        return (Status.TOO_SLOW if too_slow else Status.OK), list(self._values)

    def has_settled(self, time: float) -> bool:
        """Whether every steer angle is measured at this time, and the last long dropout is `settling_time` ago."""
        if any(measured_at < time for measured_at in self._measured_at[1:]):
            return False
        return time - self._last_dropout >= self.settings.settling_time

    def _is_plausible(self, i: int, value: float, age: float) -> bool:
        """Whether an input is possible, and can follow its last value, measured `age` seconds ago.

        A spike of an input moves the state and its sensitivities alike, so that the filter would learn from it.
        """
        settings = self.settings
        if abs(value) > (settings.max_steer if i else MAX_SPEED):
            return False
        change = abs(value - self._values[i])
        return change <= (settings.max_steer_rate * age if i else settings.max_speed_change) or age > settings.hold
