"""The time of a node from the timestamps of frames: increasing, also when the clock of the bus jumps."""

import math
from collections.abc import Iterator

from fifthwheel.logs.can.decoder import Frame

MIN_EPOCH = 1e8
"""s; a time that begins later counts from 1970, and the node's time then starts near 0, as that of a log does."""
MAX_LATE = 0.02
"""s; a frame that is later than this behind the newest one does not belong to the present."""
MAX_GAP = 1.0
"""s; a frame that is further ahead of the newest one is a gap or a jump of the clock."""
RESTART_GAP = 2.0
"""s; the node's time advances by this at a jump back, so that the filters start again."""
CONFIRMED_BY = 5
"""Frames that agree on a new time, before it is accepted: a single wrong timestamp changes nothing."""


class TimeBase:
    """Assigns each frame the node's time, s.

    Frames far from the newest one wait. When `CONFIRMED_BY` of them agree, the clock has jumped or the bus was silent,
    and they count. Forward, the node's time follows; backward it continues, because the filters' time must increase.
    """

    def __init__(self) -> None:
        self.origin = math.nan
        """Time of the bus at the node's time 0, s."""
        self.newest = -math.inf
        """Latest time of the node, s."""
        self.jumps = 0
        """How often the clock has jumped back, or a timestamp was wrong."""
        self._astray: list[Frame] = []
        self._had_frame = False

    def start(self, time: float) -> None:
        """Choose the origin for a first time of the bus, s."""
        self.origin = math.floor(time) if time > MIN_EPOCH else 0.0

    def assign(self, frame: Frame) -> Iterator[tuple[float, Frame]]:
        """The frames that count now, each with its time of the node."""
        if math.isnan(self.origin):
            self.start(frame.time)
        if not self._had_frame and math.isfinite(frame.time):
            self._had_frame = True
            if abs(frame.time - self.origin - self.newest) > MAX_LATE and math.isfinite(self.newest):
                self.origin = frame.time - self.newest  # until now the time was that of another clock
        time = frame.time - self.origin
        if not math.isfinite(time):
            self.jumps += 1
            return
        if self.newest == -math.inf or -MAX_LATE <= time - self.newest <= MAX_GAP:
            if self._astray:
                self.jumps += 1
                self._astray.clear()
            self.newest = max(self.newest, time)
            yield time, frame
            return
        if self._astray and not -MAX_LATE <= frame.time - self._astray[-1].time <= MAX_GAP:
            self.jumps += 1
            self._astray.clear()
        self._astray.append(frame)
        if len(self._astray) < CONFIRMED_BY:
            return
        waiting, self._astray = self._astray, []
        if time < self.newest:
            self.jumps += 1
            self.origin = waiting[0].time - (self.newest + RESTART_GAP)
        for each in waiting:
            self.newest = max(self.newest, each.time - self.origin)
            yield each.time - self.origin, each

    def advance(self, time: float) -> None:
        """The node's time is at least this, s, also without a frame."""
        self.newest = max(self.newest, time)
