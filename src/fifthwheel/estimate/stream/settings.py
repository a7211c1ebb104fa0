"""Which samples a filter uses, and its status after each."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

from fifthwheel.data.channels import limit_of
from fifthwheel.model.dynamics import SPEED_RATE
from fifthwheel.model.dynamics.speed_rate import TIME_CONSTANT


class Status(IntEnum):
    """Status of a sample; its states are NaN if it is TOO_SLOW or INPUT_MISSING.

    Example:
        >>> import fifthwheel as fw
        >>> fw.Status(2).name
        'TOO_SLOW'
    """

    OK = 0
    COASTING = 1
    """No accepted measurement for longer than `ObserverSettings.coast`: the model predicts from its inputs."""
    TOO_SLOW = 2
    """Below the lowest speed of the model."""
    INPUT_MISSING = 3
    """The speed or a steer angle is missing or implausible for longer than `ObserverSettings.hold`."""
    INCONSISTENT = 4
    """The measurements contradict the vehicle, the speed or the steer angles: `States.nis` is above
    `ObserverSettings.max_nis`. The states may be wrong by many sigmas."""
    SETTLING = 5
    """Too few samples agree since a start of the filter or a sudden input. The states are wrong if that was wrong."""


VALID = frozenset(Status) - {Status.TOO_SLOW, Status.INPUT_MISSING}
"""Statuses with which the states have values; otherwise they are NaN."""


@dataclass(frozen=True, kw_only=True)
class InputRule:
    """Which values of an input are plausible; any other value counts as missing."""

    name: str
    largest: float  # magnitude, SI
    jump: float  # largest change within any time, SI: of noise and repeated samples
    rate: float  # largest change per second, SI, if that is more

    def follows(self, change: Any, age: Any, hold: float) -> Any:
        """Whether a value can follow the last plausible one, by its change and the age of that; numbers or arrays."""
        return self.agrees(change, age) | (age > hold)

    def agrees(self, change: Any, age: Any) -> Any:
        """Whether a value agrees with the last plausible one."""
        return (change <= self.jump) | (change <= self.rate * age)


@dataclass(frozen=True, kw_only=True)
class StreamSettings:
    """How a filter treats faults of its signals.

    An input that is implausible for longer than `hold` takes any value up to its largest: the last plausible one is
    outdated, or was the wrong one. So does an input of which no second value has followed the first one of a start.
    """

    inputs: tuple[InputRule, ...]  # of the speed and the steer angles
    measured: Mapping[str, float]  # largest magnitude of each measured signal, SI
    min_speed: float  # m/s; below it the status is TOO_SLOW
    hold: float  # longest time for which a missing input keeps its value, s; then the status is INPUT_MISSING
    max_gap: float  # longest time between samples without a new start, s
    coast: float  # longest time without an accepted measurement, s; then the status is COASTING
    speed_smoothing: float = TIME_CONSTANT  # of the derivative of the speed, s

    @property
    def names(self) -> tuple[str, ...]:
        """The inputs of the model."""
        return (*(rule.name for rule in self.inputs), SPEED_RATE)


def magnitude(name: str) -> float:
    """Largest magnitude of a signal of a heavy vehicle, SI."""
    limit = limit_of(name)
    return limit.magnitude if limit else math.inf
