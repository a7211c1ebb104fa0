"""Whether the mapped signals arrive and are valid."""

import math
from collections.abc import Iterable

from fifthwheel.live.sampler import Arrivals
from fifthwheel.live.status import LiveFault
from fifthwheel.logs.can.decoder import Quality

SHORTEST_TIMEOUT = 0.06
"""A signal is missing after this time, s, or after 1.5 of its periods if that is longer."""
FIRST = 0.1
"""A signal that has never arrived is missing after this time since the first frame, s."""

_FAULTS = {Quality.NOT_AVAILABLE: LiveFault.NOT_AVAILABLE, Quality.WRONG_LENGTH: LiveFault.WRONG_LENGTH}


class Health:
    """Faults of the columns of a signal map.

    Args:
        columns: names.
    """

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
