"""Status and faults of a live node, and whether its mapped signals arrive and are valid."""

import math
from collections.abc import Iterable
from enum import IntEnum, IntFlag

from fifthwheel.live.sampler import Arrivals
from fifthwheel.logs.can.decoder import Quality
from fifthwheel.observe import Status

SHORTEST_TIMEOUT = 0.06
"""A signal is missing after this time, s, or after 1.5 of its periods if that is longer."""
FIRST = 0.1
"""A signal that has never arrived is missing after this time since the first frame, s."""


class NodeStatus(IntEnum):
    """Status of an output. The first values are those of `observe.Status`."""

    OK = Status.OK
    COASTING = Status.COASTING
    TOO_SLOW = Status.TOO_SLOW
    INPUT_MISSING = Status.INPUT_MISSING
    INCONSISTENT = Status.INCONSISTENT
    SETTLING = Status.SETTLING
    DEGRADED = 8
    """The states are valid, and a fault limits their quality; see `LiveFault`."""
    FAILED = 9
    """The estimator gave a state that is not finite; it starts again."""


class LiveFault(IntFlag):
    """What is wrong now; several may be."""

    NONE = 0
    SILENT = 1
    """No mapped signal arrives."""
    BUS_OFF = 2
    """The interface is off the bus or cannot be opened; the node tries again."""
    SIGNAL_MISSING = 4
    """A mapped signal does not arrive."""
    NOT_AVAILABLE = 8
    """A sender reports an error, or that it has no value."""
    WRONG_LENGTH = 16
    """A frame is too short for a mapped signal."""
    TIME_JUMP = 32
    """The clock of the bus has jumped, or a timestamp was wrong, in the last second."""
    OVERLOAD = 64
    """The node is late or has dropped frames in the last second."""
    CHANGED = 128
    """Load or trailer differ from those of the estimates."""
    NOT_RECORDED = 256
    """The record or the estimates cannot be written."""
    NOT_SENT = 512
    """Frames cannot be sent."""
    WHEEL_LIFT = 1024
    """A wheel is about to lift: see `observe.states.wheel_lifts`. A fault of the truck's motion."""


HARMLESS = LiveFault.NOT_RECORDED | LiveFault.NOT_SENT | LiveFault.WHEEL_LIFT
"""Faults that do not limit the quality of the states."""

_FAULTS = {Quality.NOT_AVAILABLE: LiveFault.NOT_AVAILABLE, Quality.WRONG_LENGTH: LiveFault.WRONG_LENGTH}


class Health:
    """Faults of the columns of a signal map, given by their names."""

    def __init__(self, columns: Iterable[str]) -> None:
        self._arrivals = {column: Arrivals() for column in columns}
        self._quality = dict.fromkeys(self._arrivals, Quality.VALID)
        self._since = math.nan  # time of the first sample, s

    def update(self, time: float, column: str, quality: Quality) -> None:
        """Take up a reading."""
        arrivals = self._arrivals.get(column)
        if arrivals is not None and time >= arrivals.last:
            arrivals.update(time)
            self._quality[column] = quality

    def restart(self, time: float) -> None:
        """After a jump of the time: nothing is missing at this time, s."""
        for arrivals in self._arrivals.values():
            if arrivals.last > -math.inf:
                arrivals.last = time

    def problems(self, time: float) -> dict[str, LiveFault]:
        """The fault of each column that has one at this time, s."""
        if math.isnan(self._since):
            self._since = time
        found = {}
        for column, arrivals in self._arrivals.items():
            if arrivals.last == -math.inf:
                missing = time - self._since > FIRST
            else:
                period = arrivals.period if arrivals.period > 0 else FIRST
                missing = time - arrivals.last > max(SHORTEST_TIMEOUT, 1.5 * period)
            if missing:
                found[column] = LiveFault.SIGNAL_MISSING
            elif (quality := self._quality[column]) is not Quality.VALID:
                found[column] = _FAULTS[quality]
        return found

    def faults(self, problems: dict[str, LiveFault]) -> LiveFault:
        """The faults of all columns together."""
        result = LiveFault.NONE
        for fault in problems.values():
            result |= fault
        if problems and len(problems) == len(self._arrivals) and result == LiveFault.SIGNAL_MISSING:
            return LiveFault.SILENT
        return result
