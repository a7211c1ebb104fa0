"""The samples of one clock as they come in pieces: checked, thinned where they are too dense, and put together."""

from collections.abc import Mapping, Sequence

import numpy as np

from fifthwheel.logs.record import Array, increasing, usual_step
from fifthwheel.logs.resample import DENSE, decimated, usual_steps

_BEFORE = 1000
"""Samples from which a clock's rate is told."""
_OVERLAP = 6
"""New steps that are kept back for what comes next."""


class Stream:
    """Columns that are sampled together.

    Memory stays with the pieces and with what is wanted in the end, not with what the file holds.
    """

    def __init__(self, names: Sequence[str], *, rate: float, clock: str) -> None:
        self.names = tuple(names)
        self.timeless = 0
        """Samples that had no time, and were left out."""
        self.came = 0
        """Samples with a time."""
        self.thinned_from: float | None = None
        """Hz, the rate of the samples when they were too dense, else None."""
        self._rate, self._clock = rate, clock
        self._times: list[Array] = []
        self._values: list[Array] = []
        self._times_left: list[Array] = []
        self._values_left: list[Array] = []
        self._last = -np.inf
        self._steps: Array | None = None

    def push(self, time: Array, values: Mapping[str, Array]) -> None:
        """Add samples: time (n,) s, values (n,) by name; a SignalError when time does not increase."""
        stamped = np.isfinite(time)
        rows = np.column_stack([values[name] for name in self.names]) if self.names else np.empty((time.size, 0))
        if not stamped.all():
            self.timeless += int((~stamped).sum())
            time, rows = time[stamped], rows[stamped]
        if not time.size:
            return
        first = self.came + self.timeless
        if np.isfinite(self._last):
            increasing(np.insert(time, 0, self._last), self._clock, first - 1)
        else:
            increasing(time, self._clock, first)
        self._last = float(time[-1])
        self.came += time.size
        self._times_left.append(time)
        self._values_left.append(rows)
        if sum(map(len, self._times_left)) >= _BEFORE:
            self._settle(last=False)

    def finish(self) -> tuple[Array, dict[str, Array]]:
        """Time (N,) s and values (N,) of every column."""
        self._settle(last=True)
        time = np.concatenate(self._times) if self._times else np.empty(0)
        values = np.concatenate(self._values) if self._values else np.empty((0, len(self.names)))
        return time, {name: np.ascontiguousarray(values[:, k]) for k, name in enumerate(self.names)}

    def _settle(self, *, last: bool) -> None:
        """Move on what is waiting, thinned if this clock is too dense."""
        if not self._times_left:
            return
        time, values = np.concatenate(self._times_left), np.concatenate(self._values_left)
        self._times_left, self._values_left = [], []
        if self._steps is None and time.size > 2:
            self._steps = usual_steps(time[:_BEFORE], values[:_BEFORE])
            own = 1 / usual_step(time[:_BEFORE])
            self.thinned_from = own if own > DENSE * self._rate else None
        if self.thinned_from is None:
            self._times.append(time)
            self._values.append(values)
            return
        thin, found = decimated(time, values, self._rate, self._steps)
        before = self._times[-1][-1] if self._times else -np.inf
        after = np.inf if last else time[-1] - _OVERLAP / self._rate
        new = (thin > before) & (thin <= after)
        if new.any():
            self._times.append(thin[new])
            self._values.append(found[new])
        if not last:
            kept = time >= (self._times[-1][-1] if self._times else -np.inf) - _OVERLAP / self._rate
            self._times_left, self._values_left = [time[kept]], [values[kept]]
