"""Samples at a fixed rate from readings that arrive in any order."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from fifthwheel.data.logs.assemble import SAME_INSTANT

LOST = 3.0
"""A column whose last reading is so many of its periods ago is no longer awaited."""
EARLY, LATE = 0.25, 0.5
"""A cycle ends at most so many periods before and after it is due."""
TRACKING = 0.1
"""Fraction of a deviation from the messages on the bus that the next cycle corrects."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Cycle:
    """One sample."""

    time: float  # instant of the newest reading, s; without a new one, when the cycle was due
    values: dict[str, float]  # by column, in the unit of the log; a column without a valid reading is absent


class Arrivals:
    """When the readings of a column arrive."""

    __slots__ = ("last", "period")

    def __init__(self) -> None:
        self.last = -math.inf
        """Time of the newest reading, s."""
        self.period = math.nan
        """Typical time between readings, s; NaN before the second one."""

    def update(self, time: float) -> None:
        """Take up a reading."""
        step = time - self.last
        if self.period > 0:  # a dropout hardly changes the typical period
            self.period += 0.1 * (min(step, 2 * self.period) - self.period)
        elif 0 < step < math.inf:
            self.period = step
        self.last = time


class Sampler:
    """Joins the readings of one cycle to a sample.

    A cycle ends as soon as every column that is expected in it has a reading, at the latest half a period after it is
    due; the samples thus follow the messages on the bus. A column has its newest reading. Readings of one instant are
    always in the same sample. The rate is in Hz.
    """

    def __init__(self, rate: float) -> None:
        self.period = 1 / rate
        self._arrivals: dict[str, Arrivals] = {}
        self.restart()

    def restart(self) -> None:
        """Begin at the next reading; what is known of the columns' periods stays."""
        self._values: dict[str, float] = {}
        self._arrived: set[str] = set()  # columns with a reading in this cycle
        self._newest = math.nan  # time of the newest reading or sample, s
        self._closed = math.nan  # time of the last sample, s
        self._due = math.nan  # s
        for arrivals in self._arrivals.values():
            arrivals.last = -math.inf

    def start(self, time: float) -> None:
        """The first cycle is due at this time, s, unless the cycles run already."""
        if math.isnan(self._due):
            self._due = self._newest = time
            self._closed = -math.inf

    def put(self, time: float, column: str, value: float) -> Iterator[Cycle]:
        """Add a reading, NaN if it is not valid; gives the samples that end before it."""
        self.start(time)
        yield from self.advance(time)
        arrivals = self._arrivals.setdefault(column, Arrivals())
        if time < arrivals.last:
            return  # a newer one is known
        arrivals.update(time)
        self._arrived.add(column)
        self._newest = max(self._newest, time)
        if value == value:
            self._values[column] = value
        else:
            self._values.pop(column, None)

    def advance(self, time: float) -> Iterator[Cycle]:
        """The samples that end before this time, s."""
        while time > self._due + LATE * self.period or self._complete(time):
            new = self._newest > self._closed + SAME_INSTANT and bool(self._arrived)
            at = self._newest if new else max(self._due, self._closed + 2 * SAME_INSTANT)
            values, self._values, self._closed = self._values, {}, at
            self._newest = max(self._newest, at)
            self._arrived.clear()
            self._due += self.period + TRACKING * max(-self.period, min(self.period, at - self._due))
            yield Cycle(time=at, values=values)

    def _complete(self, time: float) -> bool:
        """Whether no reading is missing that is expected in this cycle."""
        if (self._newest < self._due - EARLY * self.period and time < self._due) or time <= self._newest + SAME_INSTANT:
            return False
        if not self._arrived and time <= self._due:
            return False
        for column, arrivals in self._arrivals.items():
            expected = arrivals.last + arrivals.period
            awaited = expected <= self._due + EARLY * self.period and time <= arrivals.last + LOST * arrivals.period
            if awaited and column not in self._arrived:
                return False
        return True
