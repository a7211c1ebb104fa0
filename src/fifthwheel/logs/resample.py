"""Fewer samples a second without aliasing, and none where there was none."""

import numpy as np

from fifthwheel.logs.record import Array, usual_step

_HALF = 4
"""Half the kernel's length in new steps."""
_CUT_OFF = 0.35
"""Of the new rate; a Hann window of that length is 44 dB down from 0.54 of it on."""
DENSE = 2.5
"""So many times the wanted rate a channel may have before it is thinned."""
_COVERED = 0.02
"""Most of the kernel's weight that may lie in a hole."""


def _shape(x: Array) -> Array:
    return np.asarray(2 * _CUT_OFF * np.sinc(2 * _CUT_OFF * x) * np.cos(np.pi * x / (2 * _HALF)) ** 2)


_AREA = float(np.sum(_shape(np.arange(-_HALF, _HALF, 1e-3))) * 1e-3)


def _kernel(x: Array) -> Array:
    """Windowed sinc at x new steps from its centre; its integral is 1."""
    return _shape(x) / _AREA


def usual_steps(time: Array, values: Array) -> Array:
    """Usual step (c,) s between the samples that each column of values (n, c) has; NaN of fewer than two."""
    steps = np.full(values.shape[1], usual_step(time))
    missing = np.isnan(values)
    for column in np.flatnonzero(missing.any(axis=0)):
        steps[column] = usual_step(time[~missing[:, column]])
    return steps


def decimated(time: Array, values: Array, rate: float, steps: Array | None = None) -> tuple[Array, Array]:
    """Time (m,) s at multiples of 1 / rate, and values (m, c) there, low-passed below half of that rate.

    time (n,) s increasing, values (n, c) with NaN where missing, rate Hz, steps (c,) s the usual steps of the columns,
    by default as they are here. Every new value is the convolution with a symmetric windowed sinc, by the trapezoidal
    rule over the samples as they lie, so that jitter does not matter and nothing is delayed; where over 2 % of the
    kernel lies in a hole (three usual steps without a sample, or the ends) it is NaN. Instants further than half a new
    step from any sample do not appear. A column with fewer samples than 2.5 times the rate is only moved().
    """
    steps = usual_steps(time, values) if steps is None else steps
    at = np.unique(np.rint(time * rate))
    found = np.full((at.size, values.shape[1]), np.nan)
    missing = np.isnan(values).any(axis=0)
    alike = ~missing & (steps * DENSE * rate < 1)
    if alike.any():
        found[:, alike] = _convolved(time, values[:, alike], at, rate, float(steps[alike][0]))
    for column in np.flatnonzero(~alike):
        seen = np.isfinite(values[:, column])
        mine = time[seen], values[seen, column]
        if steps[column] * DENSE * rate < 1:
            found[:, column] = _convolved(mine[0], mine[1][:, None], at, rate, float(steps[column]))[:, 0]
        elif seen.any():
            near, there = moved(*mine, rate)
            found[np.searchsorted(at, np.rint(near * rate)), column] = there
    return at / rate, found


def _convolved(time: Array, values: Array, at: Array, rate: float, step: float) -> Array:
    steps = np.minimum(np.diff(time), 3 * step)
    weight = rate * (np.append(steps, 0.0) + np.insert(steps, 0, 0.0)) / 2
    rows = np.column_stack([values, np.ones(time.size)]) * weight[:, None]  # the last column tells what is covered
    below = np.floor(time * rate)
    first = np.flatnonzero(np.diff(below, prepend=-np.inf))
    total = np.zeros((at.size, rows.shape[1]))
    for shift in range(1 - _HALF, _HALF + 1):
        sums = np.add.reduceat(_kernel(time * rate - below - shift)[:, None] * rows, first, axis=0)
        place = np.minimum(np.searchsorted(at, below[first] + shift), at.size - 1)
        there = at[place] == below[first] + shift
        total[place[there]] += sums[there]
    covered = total[:, -1:]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(np.abs(covered - 1) < _COVERED, total[:, :-1] / covered, np.nan)


def moved(time: Array, values: Array, rate: float) -> tuple[Array, Array]:
    """The same samples at the nearest multiples of 1 / rate: time (m,) s and values (m,).

    Each goes there along the line to its neighbour on that side, if that is no further than three usual steps, and as
    it is otherwise. None is made: of two at the same instant the nearer stays.
    """
    if time.size < 2:
        return np.rint(time * rate) / rate, values
    steps = np.diff(time)
    slopes = np.where(steps <= 3 * usual_step(time), np.diff(values) / steps, 0.0)
    target = np.rint(time * rate)
    off = target / rate - time
    slope = np.where(off > 0, np.append(slopes, 0.0), np.insert(slopes, 0, 0.0))
    order = np.lexsort((np.abs(off), target))
    first = order[np.diff(target[order], prepend=-np.inf) > 0]
    return target[first] / rate, (values + slope * off)[first]
