"""The time of a node from the timestamps of frames: increasing, also when the clock of the bus jumps."""

import math
from collections.abc import Iterator

from fifthwheel.data.logs.can.database import Frame
from fifthwheel.data.record.timestamps import origin

MAX_LATE = 0.02
"""s; a frame that is further behind the newest one is not out of order, but of another time."""
MAX_GAP = 1.0
"""s; a frame that is further ahead of the newest one is a gap or a jump of the clock."""
RESTART_GAP = 2.0
"""s; the node's time advances by this at a jump back, so that the filters start again."""
CONFIRMED_BY = 5
"""Frames that agree on a new time, before it is accepted: a single wrong timestamp changes nothing."""
TRACKING = 1e-3
"""Fraction of the deviation of another clock that each of its frames corrects."""


class _Clock:
    """The clock of one bus."""

    def __init__(self, origin: float, *, own: bool) -> None:
        self.origin, self.own = origin, own
        self.newest = -math.inf  # latest time of a frame by the node, s
        self.astray: list[Frame] = []


class TimeBase:
    """Assigns each frame the node's time, s.

    Frames far from the newest one of their bus wait. When `CONFIRMED_BY` of them agree, the clock has jumped or the bus
    was silent, and they count. Forward, the node's time follows; backward it continues, because the filters' time must
    increase. A bus with another clock than the first one is aligned by the arrival of its frames.
    """

    def __init__(self) -> None:
        self.origin = math.nan
        """Time of the first bus at the node's time 0, s."""
        self.newest = -math.inf
        """Latest time of the node, s."""
        self.jumps = 0
        """How often a clock has jumped, or a timestamp was wrong. While a bus is silent, `advance` moves the time, so
        that its next frame is no jump."""
        self._clocks: dict[int, _Clock] = {}

    def start(self, time: float) -> None:
        """Choose the origin for a first time of the bus, s: the node's time starts near 0, as that of a log does."""
        self.origin = origin(time)

    def advance(self, time: float) -> None:
        """The node's time is at least this, s, also without a frame."""
        self.newest = max(self.newest, time)

    def assign(self, frame: Frame) -> Iterator[tuple[float, Frame]]:
        """The frames that count now, each with its time of the node."""
        if not math.isfinite(frame.time):
            self.jumps += 1
            return
        clock = self._clocks.get(frame.bus) or self._new_clock(frame)
        time = frame.time - clock.origin
        first = self.newest == -math.inf
        if first or clock.newest - MAX_LATE <= time <= self.newest + MAX_GAP:
            if clock.astray:
                self.jumps += 1
                clock.astray.clear()
            yield self._accept(clock, time), frame
            return
        if clock.astray and not -MAX_LATE <= frame.time - clock.astray[-1].time <= MAX_GAP:
            self.jumps += 1
            clock.astray.clear()
        clock.astray.append(frame)
        if len(clock.astray) < CONFIRMED_BY:
            return
        waiting, clock.astray = clock.astray, []
        self.jumps += 1
        if time < self.newest:
            self._move(clock, waiting[0].time - (self.newest + RESTART_GAP))
        for each in waiting:
            yield self._accept(clock, each.time - clock.origin), each

    def _new_clock(self, frame: Frame) -> _Clock:
        if math.isnan(self.origin):
            self.start(frame.time)
        clock = self._clocks[frame.bus] = _Clock(self.origin, own=False)
        if math.isfinite(self.newest) and abs(frame.time - self.origin - self.newest) > MAX_LATE:
            clock.own = len(self._clocks) > 1
            self._move(clock, frame.time - self.newest)
        return clock

    def _move(self, clock: _Clock, origin: float) -> None:
        """Set the origin of a clock; one that is not a bus's own is that of all buses."""
        clock.origin = origin
        if not clock.own:
            self.origin = origin
            for other in self._clocks.values():
                other.origin = other.origin if other.own else origin

    def _accept(self, clock: _Clock, time: float) -> float:
        if clock.own:
            clock.origin += TRACKING * max(-MAX_LATE, min(MAX_LATE, time - self.newest))
        clock.newest = max(clock.newest, time)
        self.newest = max(self.newest, time)
        return time
