"""Held samples: a channel that repeats its last value until the next message of the bus arrives.

As samples of the table the repetitions make a staircase, on average half a period late. A measurement is only where the
value was renewed.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fifthwheel.base.types import Array

_MOTION = 2.5
"""Steps above this multiple of the quantum count as motion. A quantised signal that moves slowly, or shows its noise
only, changes by one quantum at a time, at instants that contain no information on the message rate."""
_QUANTUM = 0.05
"""Quantile of the distances between neighbouring values that is taken for the quantum."""
_MIN_RUNS = 20
"""Runs of equal values during motion from which they are judged."""
_REGULAR = 0.7
"""Least fraction of these runs within half and three halves of their median length. Of 50 Hz in a table of 100 Hz, a
quarter has a length of 1 where jitter moves a message across the instant of a row."""
_LONGEST = 0.5
"""s. A longer staircase may be the signal itself."""
_CERTAIN_RUNS = 200
"""Runs of a piece that are enough to see that a column is not held."""


@dataclass(frozen=True, kw_only=True, eq=False)
class HeldSamples:
    """The samples of a held channel at which its value was renewed."""

    time: Array
    """(n,) s, increasing; rows of the table where its steps are regular."""
    values: Array
    """(n,) SI or the unit of the column."""
    rate: float
    """Hz, of the renewals."""
    repetitions: float
    """Mean number of rows with the same sample, at least 1.5."""


def held_samples(time: Array, values: Array) -> HeldSamples | None:
    """The renewals of a channel with time (N,), s, and values (N,); None where it is not held.

    A channel is held if its value repeats regularly while it moves: at least 70 % of the runs of equal values that
    begin with a large step have between half and three halves of their median length, which is 2 rows to 0.5 s. A
    renewal by the same value, of a constant or quantised signal, is assumed once in each period.
    """
    renewals = Renewals()
    renewals.push(time, values)
    return renewals.finish()


class Renewals:
    """Finds `held_samples` of a channel that arrives in pieces; keeps no repetition in memory."""

    def __init__(self) -> None:
        self._is_possible = True
        self._rows = self._present = 0
        self._last = (-1, np.nan, np.nan)
        self._runs: list[Array] = []

    @np.errstate(over="ignore")  # damaged values may overflow
    def push(self, time: Array, values: Array) -> None:
        """Add the next rows: time (n,) s and values (n,); rows without a time or a value belong to no run."""
        if not self._is_possible:
            return
        rows = np.flatnonzero(np.isfinite(time) & np.isfinite(values))
        if rows.size:
            row, instant, value = self._last
            before = np.concatenate([[row - self._rows], rows[:-1]])
            earlier = np.concatenate([[instant], time[rows[:-1]]])
            changed = np.diff(values[rows], prepend=value) != 0
            first = np.flatnonzero(changed | (rows - before > 1))
            runs = np.stack([self._present + first, time[rows[first]], earlier[first], values[rows[first]]])
            self._runs.append(runs)
            lengths = _lengths_in_motion(np.diff(runs[0]), runs[3])
            if lengths.size >= _CERTAIN_RUNS and np.median(lengths) <= 1:
                self._is_possible, self._runs = False, []
            self._last = (self._rows + int(rows[-1]), float(time[rows[-1]]), float(values[rows[-1]]))
        self._present += rows.size
        self._rows += time.size

    def finish(self) -> HeldSamples | None:
        """The renewals of all rows; None where the channel is not held."""
        if not self._runs:
            return None
        begins, start, end, values = np.concatenate(self._runs, axis=1)
        end = np.append(end[1:], self._last[1])
        lengths = np.diff(begins, append=self._present)
        moving = _lengths_in_motion(lengths[:-1], values)
        if moving.size < _MIN_RUNS:
            return None
        typical = np.median(moving)
        single = moving[moving <= 1.5 * typical]
        if typical < 2 or (single > typical / 2).sum() < _REGULAR * moving.size:
            return None
        repetitions = float(np.mean(single))
        counts = np.maximum(np.rint(lengths / repetitions), 1).astype(int)
        number = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        row = np.rint(number * np.repeat(lengths / counts, counts))
        step = (end - start) / np.maximum(lengths - 1, 1)
        rate = 1 / (repetitions * float(np.median(step[lengths > 1])))
        if rate * _LONGEST < 1:
            return None
        time = np.repeat(start, counts) + row * np.repeat(step, counts)
        return HeldSamples(time=time, values=np.repeat(values, counts), rate=rate, repetitions=repetitions)


@np.errstate(over="ignore", invalid="ignore")  # as in push; the quantum is then no number
def _lengths_in_motion(lengths: Array, values: Array) -> NDArray[np.float64]:
    """Lengths of the runs that begin with a step of a signal in motion; lengths (n,) of all but the last of n + 1."""
    levels = np.unique(values)
    if levels.size < _MIN_RUNS:
        return np.empty(0)
    quantum = np.quantile(np.diff(levels), _QUANTUM)
    return np.asarray(lengths[1:][np.abs(np.diff(values))[:-1] > _MOTION * quantum])
