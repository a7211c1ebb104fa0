"""Which frames of a message follow one another in time."""

import numpy as np
from numpy.typing import NDArray

_SINGLE = 1.0
"""s; a time further back is another recording, or the clock was set, once a second frame bears it out."""


class Steps:
    """Frames of one message: those not later than the one before are left out, a clock that was set back is kept.

    After a jump of more than 1 s back that the next frame confirms, times go on from there and are not increasing.
    """

    def __init__(self) -> None:
        self.dropped = 0
        self._last = -np.inf
        self._doubt: float | None = None

    def keep(self, time: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(n,) whether to keep the next frames of this message, with their times (n,) in s."""
        if not time.size:
            return np.ones(0, np.bool_)
        if time[0] > self._last and (np.diff(time) > 0).all():
            self._last, self._doubt = float(time[-1]), None
            return np.ones(time.size, np.bool_)
        kept = np.array([self._follows(at) for at in time.tolist()])
        self.dropped += int((~kept).sum())
        return kept

    def _follows(self, at: float) -> bool:
        if at <= self._last:
            confirmed = self._doubt is not None and at > self._doubt and at < self._last - _SINGLE
            if not confirmed:
                self._doubt = at if at < self._last - _SINGLE else self._doubt
                return False
        self._last, self._doubt = at, None
        return True
