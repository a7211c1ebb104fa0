"""One time base for channels of several rates and delays, without inventing a measurement."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fifthwheel.errors import SignalError
from fifthwheel.logs.names import is_input
from fifthwheel.logs.record import Array, usual_step
from fifthwheel.logs.resample import DENSE, moved

_SAME = 1e-6
"""s; stamps closer than this are one instant."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Samples:
    """A channel as it was sampled."""

    time: Array
    """(n,) s, when its values held."""
    values: Array
    """(n,) in SI."""
    own: bool
    """Whether its instants are others than those of the rows: its own clock, or a delay."""


def align(
    base: Samples | None, *, signals: Mapping[str, Samples], reference: Mapping[str, Samples], rate: float = np.inf
) -> tuple[Array, dict[str, Array], dict[str, Array]]:
    """Time (N,) s, and every signal on it.

    The base is the union of the rows' instants and of those of every measurement with other instants. A measurement
    keeps each of its samples where it was taken and is NaN elsewhere. An input (speed, steer) with other instants is
    linear between its neighbours; outside its first and last sample, and in holes of its own clock, it is NaN: nothing
    is extrapolated. Where clocks that tick apart would make the base denser than 2.5 times `rate` (Hz), it is the
    multiples of 1 / rate instead, and every measurement goes to the nearest of them along the line to its neighbour.
    """
    every = [*signals.items(), *reference.items()]
    if base is not None and not any(samples.own for _, samples in every):
        return base.time, {n: s.values for n, s in signals.items()}, {n: s.values for n, s in reference.items()}
    time = _union(base, every)
    if time.size > 2 and (time.size - 1) / (time[-1] - time[0]) > DENSE * rate:
        moving = {n: _moved(n, s, rate) for n, s in every}
        rows = (
            None
            if base is None
            else Samples(time=np.unique(np.rint(base.time * rate)) / rate, values=base.time, own=False)
        )
        time = _union(rows, list(moving.items()))
        return time, {n: _onto(time, n, moving[n]) for n in signals}, {n: _onto(time, n, moving[n]) for n in reference}
    return (
        time,
        {n: _onto(time, n, s) for n, s in signals.items()},
        {n: _onto(time, n, s) for n, s in reference.items()},
    )


def _union(base: Samples | None, every: Sequence[tuple[str, Samples]]) -> Array:
    clocks = [] if base is None else [base.time]
    clocks += [s.time[np.isfinite(s.values)] for name, s in every if s.own and not is_input(name)]
    if not clocks:
        clocks = [s.time for _, s in every]
    instants = np.unique(np.concatenate(clocks))
    time = instants[np.concatenate([[True], np.diff(instants) > _SAME])] if instants.size else instants
    if time.size < 2:
        raise SignalError(
            f"time: {time.size} instants in all channels together, at least 2 expected; check the time columns"
        )
    return time


def _moved(name: str, samples: Samples, rate: float) -> Samples:
    if is_input(name):
        return samples
    seen = np.isfinite(samples.values)
    time, values = moved(samples.time[seen], samples.values[seen], rate)
    return Samples(time=time, values=values, own=True)


def _onto(time: Array, name: str, samples: Samples) -> Array:
    if is_input(name) and samples.time.size:
        return between(time, samples.time, samples.values)
    found = np.full(time.size, np.nan)
    taken = np.isfinite(samples.values)
    nearest = np.searchsorted(time, samples.time[taken] + _SAME, side="right") - 1
    found[nearest] = samples.values[taken]
    return found


def between(time: Array, at: Array, values: Array) -> Array:
    """Linear between samples; NaN outside, next to missing ones and in holes of over 0.5 s and three periods."""
    found = np.interp(time, at, values, left=np.nan, right=np.nan)
    if at.size > 1:
        steps = np.diff(at)
        after = np.clip(np.searchsorted(at, time, side="left"), 1, at.size - 1)
        inside = (time - at[after - 1] > _SAME) & (at[after] - time > _SAME)
        found[inside & (steps[after - 1] > max(0.5, 3 * usual_step(at)))] = np.nan
    return found
