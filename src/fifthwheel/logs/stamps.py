"""Stamps of a clock, kept rising: loggers write a sample twice, or late, and nobody downstream wants to know."""

from collections.abc import Hashable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LONGEST_SLIP = 1.0
"""s. Time that goes back by more, and stays there, is not repaired: it is another drive, or the clock was set."""
_MOST_JUMPS = 16


def wild(time: Array) -> NDArray[np.bool_]:
    """Which stamps (n,) jump ahead by more than 1 s for themselves alone, as those whose bits have flipped."""
    found = np.zeros(time.size, dtype=bool)
    found[1:-1] = (time[1:-1] - time[2:] > LONGEST_SLIP) & (time[2:] > time[:-2])
    return found


class Stamps:
    """What of each clock's samples can be given, and how many could not."""

    def __init__(self) -> None:
        self._last: dict[Hashable, float] = {}
        self._dropped: dict[Hashable, int] = {}

    def keep(self, clock: Hashable, time: Array) -> NDArray[np.bool_]:
        """Which of the next stamps (n,) of a clock are to be kept: those later than all before, (n,)."""
        last = self._last.get(clock, -np.inf)
        if time.size and time[0] > last and np.isfinite(time).all() and (np.diff(time) > 0).all():
            self._last[clock] = float(time[-1])
            return np.ones(time.size, dtype=bool)
        kept = np.isfinite(time)
        good = np.flatnonzero(kept)
        kept[good[wild(time[good])]] = False
        good = np.flatnonzero(kept)
        begin = 0
        for _ in range(_MOST_JUMPS):
            stamps = time[good[begin:]]
            before = np.maximum.accumulate(np.concatenate([[last], stamps]))[:-1]
            late = stamps <= before
            back = stamps < before - LONGEST_SLIP
            jumps = np.flatnonzero(back[:-1] & back[1:])  # two in a row have not strayed, they stay
            until = int(jumps[0]) if jumps.size else stamps.size
            kept[good[begin : begin + until]] = ~late[:until]
            if not jumps.size:
                last = float(np.max(stamps, initial=last))
                break
            begin += until
            last = -np.inf
        else:
            last = float(time[good[-1]])
        self._last[clock] = last
        self._dropped[clock] = self._dropped.get(clock, 0) + int((~kept).sum())
        return kept

    @property
    def dropped(self) -> int:
        """Samples of all clocks that could not be given."""
        return sum(self._dropped.values())

    @property
    def notes(self) -> list[str]:
        """A sentence for each clock that lost samples."""
        return [
            f"{count} samples{f' of {clock!r}' if clock else ''} left out: their time does not rise"
            for clock, count in self._dropped.items()
            if count
        ]


def add_notes(notes: list[str], *more: str) -> None:
    """Append those that are not there yet; reading a log twice says nothing new."""
    notes.extend(note for note in more if note not in notes)
