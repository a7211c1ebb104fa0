"""Decimation without aliasing, for whole channels and for channels that arrive in pieces."""

from collections.abc import Mapping, Sequence

import numpy as np

from fifthwheel.base.types import Array
from fifthwheel.data.record.timestamps import require_increasing, typical_step

_HALF_WIDTH = 4
"""Half the length of the kernel, in new steps."""
_CUT_OFF = 0.35
"""Cut-off frequency as a fraction of the new rate; with the Hann window, attenuation is 44 dB from 0.54 of it on."""
DECIMATION_RATIO = 2.5
"""A channel is decimated if its rate exceeds the requested rate by this factor."""
_MAX_GAP_WEIGHT = 0.02
"""Largest fraction of the kernel's weight that may lie in a gap."""
_RATE_SAMPLES = 1000
"""Samples from which the rate of a stream is determined."""
_OVERLAP = 6
"""New steps of a stream that wait for the next piece."""


def _shape(x: Array) -> Array:
    """Windowed sinc at x new steps from its centre."""
    return np.asarray(2 * _CUT_OFF * np.sinc(2 * _CUT_OFF * x) * np.cos(np.pi * x / (2 * _HALF_WIDTH)) ** 2)


_AREA = float(np.sum(_shape(np.arange(-_HALF_WIDTH, _HALF_WIDTH, 1e-3))) * 1e-3)


def typical_steps(time: Array, values: Array) -> Array:
    """Typical step (c,) between the present samples of each column of values (n, c), s; NaN for fewer than two."""
    steps = np.full(values.shape[1], typical_step(time))
    missing = np.isnan(values)
    for column in np.flatnonzero(missing.any(axis=0)):
        steps[column] = typical_step(time[~missing[:, column]])
    return steps


def decimate(time: Array, values: Array, rate: float, steps: Array | None = None) -> tuple[Array, Array]:
    """Columns (n, c) at the multiples of 1 / rate, low-passed below half of that rate: time (m,), s, and values (m, c).

    Each new value is the convolution with a symmetric windowed sinc, by the trapezoidal rule over the samples at their
    own times: jitter has no effect, and no delay results. A value is NaN where more than 2 % of the kernel's weight
    lies in a gap (three typical steps without a sample, or an end). There are no new instants further than half a new
    step from every sample. A column with fewer samples than 2.5 times the rate is moved by `snap_to_grid` instead. The
    typical `steps` (c,) of the columns, s, are by default those of these samples.
    """
    steps = typical_steps(time, values) if steps is None else steps
    grid = np.unique(np.rint(time * rate))
    result = np.full((grid.size, values.shape[1]), np.nan)
    missing = np.isnan(values).any(axis=0)
    complete = ~missing & (steps * DECIMATION_RATIO * rate < 1)
    if complete.any():
        result[:, complete] = _convolved(time, values[:, complete], grid, rate, float(steps[complete][0]))
    for column in np.flatnonzero(~complete):
        present = np.isfinite(values[:, column])
        samples = time[present], values[present, column]
        if steps[column] * DECIMATION_RATIO * rate < 1:
            result[:, column] = _convolved(samples[0], samples[1][:, None], grid, rate, float(steps[column]))[:, 0]
        elif present.any():
            moved_time, moved_values = snap_to_grid(*samples, rate)
            result[np.searchsorted(grid, np.rint(moved_time * rate)), column] = moved_values
    return grid / rate, result


@np.errstate(all="ignore")  # damaged values may be infinite; where there is no weight, 0 / 0
def _convolved(time: Array, values: Array, grid: Array, rate: float, step: float) -> Array:
    steps = np.minimum(np.diff(time), 3 * step)
    weight = rate * (np.append(steps, 0.0) + np.insert(steps, 0, 0.0)) / 2
    rows = np.column_stack([values, np.ones(time.size)]) * weight[:, None]  # the last column sums the kernel's weight
    below = np.floor(time * rate)
    first = np.flatnonzero(np.diff(below, prepend=-np.inf))
    total = np.zeros((grid.size, rows.shape[1]))
    for shift in range(1 - _HALF_WIDTH, _HALF_WIDTH + 1):
        sums = np.add.reduceat((_shape(time * rate - below - shift) / _AREA)[:, None] * rows, first, axis=0)
        place = np.minimum(np.searchsorted(grid, below[first] + shift), grid.size - 1)
        on_grid = grid[place] == below[first] + shift
        total[place[on_grid]] += sums[on_grid]
    covered = total[:, -1:]
    return np.where(np.abs(covered - 1) < _MAX_GAP_WEIGHT, total[:, :-1] / covered, np.nan)


def snap_to_grid(time: Array, values: Array, rate: float) -> tuple[Array, Array]:
    """The samples at the nearest multiples of 1 / rate: time (m,) s and values (m,).

    A value is interpolated linearly towards the neighbour on that side, if the neighbour is at most three typical
    steps away; otherwise it is kept. Of several samples at one instant the nearest is kept; no sample is added.
    """
    if time.size < 2:
        return np.rint(time * rate) / rate, values
    steps = np.diff(time)
    slopes = np.where(steps <= 3 * typical_step(time), np.diff(values) / steps, 0.0)
    target = np.rint(time * rate)
    shift = target / rate - time
    slope = np.where(shift > 0, np.append(slopes, 0.0), np.insert(slopes, 0, 0.0))
    order = np.lexsort((np.abs(shift), target))
    first = order[np.diff(target[order], prepend=-np.inf) > 0]
    return target[first] / rate, (values + slope * shift)[first]


class StreamDecimator:
    """Columns of one time base that arrive in pieces: checked, decimated where they are too dense, and joined.

    Memory grows with the result, not with the pieces. Except for rounding, the result does not depend on the division
    into pieces.
    """

    def __init__(self, names: Sequence[str], *, rate: float, time_base: str) -> None:
        """Take the names of the columns, the requested rate in Hz, and the name of the time base for messages."""
        self.names = tuple(names)
        self.rows_without_time = 0
        """Samples left out because they have no timestamp."""
        self.decimated_from: float | None = None
        """Hz, original rate of decimated columns; None where they are not decimated."""
        self._samples = 0
        self._rate, self._time_base = rate, time_base
        self._times: list[Array] = []
        self._values: list[Array] = []
        self._waiting_times: list[Array] = []
        self._waiting_values: list[Array] = []
        self._last = -np.inf
        self._steps: Array | None = None

    def push(self, time: Array, values: Mapping[str, Array]) -> None:
        """Add the next samples: time (n,) s, values (n,) by column; a SignalError where time does not increase."""
        timed = np.isfinite(time)
        rows = np.column_stack([values[name] for name in self.names]) if self.names else np.empty((time.size, 0))
        if not timed.all():
            self.rows_without_time += int((~timed).sum())
            time, rows = time[timed], rows[timed]
        if not time.size:
            return
        rows_before = self._samples + self.rows_without_time
        if np.isfinite(self._last):
            require_increasing(np.insert(time, 0, self._last), self._time_base, rows_before - 1)
        else:
            require_increasing(time, self._time_base, rows_before)
        self._last = float(time[-1])
        self._samples += time.size
        self._waiting_times.append(time)
        self._waiting_values.append(rows)
        if sum(map(len, self._waiting_times)) >= _RATE_SAMPLES:
            self._process(last=False)

    def finish(self) -> tuple[Array, dict[str, Array]]:
        """Time (N,) s and values (N,) of every column."""
        self._process(last=True)
        time = np.concatenate(self._times) if self._times else np.empty(0)
        values = np.concatenate(self._values) if self._values else np.empty((0, len(self.names)))
        return time, {name: np.ascontiguousarray(values[:, k]) for k, name in enumerate(self.names)}

    def _process(self, *, last: bool) -> None:
        """Move the waiting samples to the result, decimated if they are too dense."""
        if not self._waiting_times:
            return
        time, values = np.concatenate(self._waiting_times), np.concatenate(self._waiting_values)
        self._waiting_times, self._waiting_values = [], []
        if self._steps is None and time.size > 2:
            self._steps = typical_steps(time[:_RATE_SAMPLES], values[:_RATE_SAMPLES])
            original_rate = 1 / typical_step(time[:_RATE_SAMPLES])
            self.decimated_from = original_rate if original_rate > DECIMATION_RATIO * self._rate else None
        if self.decimated_from is None:
            self._times.append(time)
            self._values.append(values)
            return
        new_time, new_values = decimate(time, values, self._rate, self._steps)
        before = self._times[-1][-1] if self._times else -np.inf
        after = np.inf if last else time[-1] - _OVERLAP / self._rate
        new = (new_time > before) & (new_time <= after)
        if new.any():
            self._times.append(new_time[new])
            self._values.append(new_values[new])
        if not last:
            kept = time >= (self._times[-1][-1] if self._times else -np.inf) - _OVERLAP / self._rate
            self._waiting_times, self._waiting_values = [time[kept]], [values[kept]]
