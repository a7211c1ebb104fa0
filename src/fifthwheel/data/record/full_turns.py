"""Angles that jump by a full turn, from 360 to 0 degrees, made continuous."""

import numpy as np

from fifthwheel.base.types import Array

_JUMP = (0.75, 1.02)
"""Fractions of a turn between which a change from one sample to the next is a jump: nothing turns as fast."""
_BETWEEN = 0.1
"""The same of a sample on the way of a jump: a logger has interpolated it, and no angle was there."""
_NEXT = 0.3
"""s; the first jump is between samples that are closer."""


class Unwrapped:
    """A column that arrives in pieces. It wraps if it stays in one turn, from 0 or from minus a half, and jumps."""

    def __init__(self, turn: float) -> None:
        """Take a full turn in the unit of the column."""
        self.turn = turn
        self.jumps = 0
        """Their number so far."""
        self._low, self._high = np.inf, -np.inf
        self._last, self._turns = np.empty((2, 0)), 0.0
        self._centre = 0.0

    def push(self, time: Array, values: Array) -> Array:
        """The next samples (n,), continuous; those that a logger has interpolated between 360 and 0 are NaN."""
        usable = np.flatnonzero(np.isfinite(time) & (np.abs(np.nan_to_num(values, nan=np.inf)) <= _JUMP[1] * self.turn))
        if not usable.size:
            return values
        self._low, self._high = min(self._low, values[usable].min()), max(self._high, values[usable].max())
        is_one_turn = bool(self._low > -0.02 * self.turn or -self._low < 0.52 * self.turn > self._high)
        t, raw = np.hstack([self._last, [time[usable], values[usable]]])
        before = self._last.shape[1]
        between = np.zeros(raw.size, dtype=bool)
        steps = np.abs(np.diff(raw)) / self.turn
        between[1:-1] = self._jumps(raw[2:] - raw[:-2]) * is_one_turn & (np.minimum(steps[1:], steps[:-1]) > _BETWEEN)
        between[1:-1] &= (t[2:] - t[:-2] < _NEXT) & (steps[1:] < _JUMP[0]) & (steps[:-1] < _JUMP[0])
        kept = np.flatnonzero(~between)
        change = np.diff(raw[kept])
        jumps = self._jumps(change) * is_one_turn
        if not self.jumps and not np.any(jumps & (np.diff(t[kept]) < _NEXT)):
            jumps[:] = False
        self.jumps += int(jumps.sum())
        turns = np.full(raw.size, np.nan)
        turns[kept] = self._turns - np.concatenate([[0.0], np.cumsum(np.sign(change) * jumps)])
        self._last, self._turns = np.array([t[kept[-1:]], raw[kept[-1:]]]), float(turns[kept[-1]])
        result = values.copy()
        if self.jumps:
            result[usable] = (raw + self.turn * turns)[before:]
        return result

    def push_live(self, time: float, value: float) -> float:
        """The next sample, continuous but for the first jump: only this shows that the column wraps, and is near 0."""
        before = self.jumps
        (result,) = self.push(np.array([time]), np.array([value]))
        if self.jumps and not before:
            self._centre = self.turn * np.round(result / self.turn)
        return float(result - self._centre)

    def _jumps(self, change: Array) -> Array:
        fraction = np.abs(change) / self.turn
        return np.asarray((fraction > _JUMP[0]) & (fraction < _JUMP[1]))

    def centred(self, values: Array) -> Array:
        """All samples (N,), by full turns so that most are near 0."""
        if not self.jumps or np.isnan(values).all():
            return values
        return values - self.turn * np.round(np.nanmedian(values) / self.turn)
