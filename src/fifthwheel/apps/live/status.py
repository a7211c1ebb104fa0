"""Status and faults of a live node, and whether its mapped signals arrive and are valid."""

import math
from collections.abc import Iterable, Mapping
from enum import IntEnum, IntFlag
from functools import reduce
from operator import or_

from fifthwheel.apps.live.sampler import Arrivals
from fifthwheel.data.channels import is_input
from fifthwheel.data.logs.can.database import Quality
from fifthwheel.estimate.observe import Status
from fifthwheel.estimate.stream import magnitude

SHORTEST_TIMEOUT = 0.06
"""A signal is missing after this time, s, or after 1.5 of its periods if that is longer."""
FIRST = 0.1
"""A signal that has never arrived is missing after this time since the first frame, s."""
IMPLAUSIBLE_FOR = 1.0
"""A signal is implausible when all of its values were, for this time, s."""
FROZEN_FOR = 3.0
"""A measurement is frozen when it has been the same for this time, s, and others have changed."""


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
    """A wheel is about to lift: see `estimate.observe.states.time_to_lift`. A fault of the truck's motion."""
    IMPLAUSIBLE = 2048
    """All values of a mapped signal are beyond what a heavy vehicle can reach."""
    FROZEN = 4096
    """A measurement does not change, while another one does."""


HARMLESS = LiveFault.NOT_RECORDED | LiveFault.NOT_SENT | LiveFault.WHEEL_LIFT
"""Faults that do not limit the quality of the states."""

_FAULTS = {Quality.NOT_AVAILABLE: LiveFault.NOT_AVAILABLE, Quality.WRONG_LENGTH: LiveFault.WRONG_LENGTH}


def in_words(name: str) -> str:
    """The name of a status or of a fault."""
    return name.replace("_", " ").lower()


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
        result = reduce(or_, problems.values(), LiveFault.NONE)
        if problems and len(problems) == len(self._arrivals) and result == LiveFault.SIGNAL_MISSING:
            return LiveFault.SILENT
        return result


class _Seen:
    """What a signal has been."""

    def __init__(self, largest: float) -> None:
        self.largest = largest
        self.value = math.nan
        self.last = self.plausible = self.changed = math.nan
        """Times of the last value, of the last plausible one and of the last change, s; nan before the first value."""


class SignalHealth:
    """Faults of the values of signals, by name: implausible, and frozen, if it is no input."""

    def __init__(self) -> None:
        self._seen: dict[str, _Seen] = {}
        self._time = math.nan  # of the last sample, s

    def update(self, sample: Mapping[str, float]) -> None:
        """Take up a sample in SI; NaN is missing."""
        self._time = now = sample["time"]
        for name, value in sample.items():
            if value != value or name == "time":
                continue
            seen = self._seen.get(name)
            if seen is None:
                seen = self._seen[name] = _Seen(magnitude(name))
            if not now - seen.last < IMPLAUSIBLE_FOR:  # it begins
                seen.plausible = seen.changed = now
            seen.last = now
            if -seen.largest <= value <= seen.largest:
                seen.plausible = now
            if value != seen.value:
                seen.value, seen.changed = value, now

    def problems(self) -> dict[str, LiveFault]:
        """The fault of each signal that has one at the last sample."""
        now = self._time
        present = {name: seen for name, seen in self._seen.items() if now - seen.last < IMPLAUSIBLE_FOR}
        found = {name: LiveFault.IMPLAUSIBLE for name, s in present.items() if now - s.plausible > IMPLAUSIBLE_FOR}
        measured = {name: seen for name, seen in present.items() if not is_input(name)}
        same = [name for name, seen in measured.items() if now - seen.changed > FROZEN_FOR]
        if 0 < len(same) < len(measured):
            found |= {name: LiveFault.FROZEN for name in same if name not in found}
        return found
