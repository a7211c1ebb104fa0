"""Faults that a channel shows on its own: missing samples, spikes and constant values."""

import math
from collections.abc import Iterable, Iterator
from itertools import pairwise

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from fifthwheel.base.types import Array
from fifthwheel.data.channels import DRIVING, SPEED, WEIGHTS, SignalName, is_input, is_of, limit_of, si_unit
from fifthwheel.data.checks.findings import Fault, Finding, error, warning
from fifthwheel.data.record.record import Record
from fifthwheel.data.record.timestamps import missing_steps

MAX_SPEED = SPEED.limit.magnitude if SPEED.limit else np.inf
"""m/s; a larger one is a fault."""
_WINDOW, _MAX_BINS = 5.0, 100_000
"""Parts of a record in which missing samples are counted: their duration, s, and their largest number."""
_ANY_LIMIT = 1e9
"""SI; no quantity of a truck is as large."""
_MAP_OR_CUT = "map another column, or cut the record with start and stop in [time] of signals.toml"
_LEFT_OUT = "the mass from driving leaves these times out, and nothing else uses it"
_MANOEUVRE = 5.0
"""s; the time in which a lane change or the entry to a bend shows."""
_MAX_PARTS = 1000
_MAX_SPIKES = 0.1
"""Fraction of the samples; with more outliers the signal or its unit is wrong, not single samples."""
_BURST = 0.1
"""Duration of the longest spike, s."""
_MAX_HALF = 500
"""Largest number of samples before and after one; with a wrong unit of time there are thousands in a burst."""
_CHUNK = 50_000
"""Samples that are searched for spikes at once, which bounds the memory."""


def present_samples(record: Record, name: str) -> tuple[Array, Array]:
    """Time (n,) s and values (n,) of the samples that are not missing."""
    values = record.signals[name]
    present = ~np.isnan(values)
    return record.time[present], values[present]


def impossible_samples(name: str, values: Array) -> NDArray[np.bool_]:
    """Mask (n,) of samples beyond ten times what a truck can do, if they are less than 1 %: bit errors, for example.

    If they are more, the unit or the column is wrong, which `check` reports, and only values above 1e9 are masked.
    """
    limit = limit_of(name)
    with np.errstate(invalid="ignore"):
        magnitude = np.abs(values)
        impossible = magnitude > (10 * limit.magnitude if limit else _ANY_LIMIT)
        few = impossible.sum() < 0.01 * impossible.size
        return impossible if few else np.isfinite(magnitude) & (magnitude > _ANY_LIMIT)


def dropouts(record: Record, name: str) -> Iterator[Finding]:
    """A gap above 0.5 s, or more than 5 % missing within 5 s; an error if more than half of all is missing.

    Missing samples are those of `missing_steps`. A signal that only the mass from driving uses is never an error. A
    weight is static, and SAE J1939 sends it every 10 s: it has no gaps.
    """
    severe, cure = (warning, _LEFT_OUT) if is_of(name, *DRIVING) else (error, _MAP_OR_CUT)
    present = int(np.isfinite(record.signals[name]).sum())
    first, last = record.span
    if present == len(record) or (present >= 2 and is_of(name, *WEIGHTS)):
        return
    if present < 2:
        problem = f"{present} samples in {len(record)} rows, at least 2 expected"
        yield severe(name, Fault.DROPOUT, f"{problem}; map another column in signals.toml")
        return
    edges, missing = missing_steps(record.time, record.signals[name])
    fraction = float(missing.sum() / (last - first))
    longest = int(missing.argmax())
    bins = min(max(1, round((last - first) / _WINDOW)), _MAX_BINS)
    per_bin, bin_edges = np.histogram(edges[:-1], bins=bins, range=(edges[0], last), weights=missing)
    worst = int(per_bin.argmax())
    local = per_bin[worst] / (bin_edges[1] - bin_edges[0])
    if missing[longest] > 0.5:
        start, stop = max(edges[longest], first), min(edges[longest + 1], last)
        where = f"the longest gap is {start:.2f} to {stop:.2f} s; up to 0.5 s is permitted"
    elif local > 0.05:
        begin, end = max(bin_edges[worst], first), bin_edges[worst + 1]
        where = f"{local:.0%} between {begin:.2f} and {end:.2f} s; up to 5 % is permitted"
    else:
        return
    finding = severe if fraction > 0.5 else warning
    yield finding(name, Fault.DROPOUT, f"{100 * fraction:.2g} % of the samples are missing; {where}; {cure}")


def spike_mask(name: str, time: Array, values: Array) -> NDArray[np.bool_]:
    """Mask (n,) of the spikes of a signal: single samples, or bursts up to about `_BURST`, that no truck makes.

    They are off the median of the samples around them by more than 8 robust sigmas, by more than the signal can change
    in that time, and by more than 5 % of its range, because a signal in a wrong unit changes fast. No sample is a spike
    if more than a tenth of them would be: then the signal or its unit is wrong. A signal that `channels` does not limit
    has none.
    """
    limit, mask = limit_of(name), np.zeros(values.size, dtype=bool)
    if limit is None or values.size < 5:
        return mask
    step = float(np.median(np.diff(time)))
    half = min(max(round(1.5 * _BURST / step), 2), _MAX_HALF)
    noise = 1.4826 * float(np.median(np.abs(np.diff(values)))) / math.sqrt(2)
    low, high = np.quantile(values, [_MAX_SPIKES / 2, 1 - _MAX_SPIKES / 2])
    # a peak is off its median by less than the fastest change before and after it
    threshold = max(8 * noise, limit.jump * max(0.75, step / 0.1), 0.05 * float(high - low))
    width = 2 * half + 1
    around = sliding_window_view(np.pad(values, half, mode="reflect"), width)
    blocks = [bound.reduceat(values, np.arange(0, values.size, width)) for bound in (np.minimum, np.maximum)]
    lowest, highest = (sliding_window_view(np.pad(block, 1, mode="edge"), 3) for block in blocks)
    wide = np.repeat(highest.max(axis=1) - lowest.min(axis=1) > threshold, width)[: values.size]
    for rows in np.array_split(np.flatnonzero(wide), math.ceil(values.size / _CHUNK)):
        rows = rows[np.ptp(around[rows], axis=1) > threshold]
        mask[rows] = np.abs(values[rows] - np.median(around[rows], axis=1)) > threshold
    return mask if np.mean(mask) < _MAX_SPIKES else np.zeros_like(mask)


def spike_note(name: str, time: Array, values: Array, mask: NDArray[np.bool_]) -> str:
    """What the spikes of a signal are, and that they are left out; the first is at its time (n,), s."""
    first, count = int(mask.argmax()), int((np.diff(mask.astype(int), prepend=0) > 0).sum())
    where = f"the first {values[first]:.3g} {si_unit(name)} at {time[first]:.2f} s"
    return f"{count} spike{'s' * (count > 1)} left out, {where}"


def without_spikes(record: Record) -> Record:
    """The record with the spikes of its signals marked as missing."""
    repaired = {}
    for name, given in record.signals.items():
        present = ~np.isnan(given)
        mask = spike_mask(name, record.time[present], given[present])
        if mask.any():
            repaired[name] = given.copy()
            repaired[name][np.flatnonzero(present)[mask]] = np.nan
    return record.with_signals(repaired) if repaired else record


def without_outliers(record: Record, names: Iterable[str], limit: float) -> Record:
    """The record with single samples of these signals marked as missing that are off the median of the five around them
    by more than `limit` robust sigmas of the noise: a mean of few samples would have them."""
    repaired = {}
    for name in names:
        present = np.flatnonzero(~np.isnan(record.signals[name]))
        values = record.signals[name][present]
        if values.size < 5:
            continue
        around, off = sliding_window_view(np.pad(values, 2, mode="edge"), 5), np.empty_like(values)
        for rows in np.array_split(np.arange(values.size), math.ceil(values.size / _CHUNK)):
            off[rows] = np.abs(values[rows] - np.median(around[rows], axis=1))
        # of the noise, by second differences; 0 of a signal that does not change from sample to sample
        sigma = 1.4826 * float(np.median(np.abs(np.diff(values, 2)))) / math.sqrt(6)
        mask = off > limit * sigma
        if sigma > 0 and 0 < np.mean(mask) < _MAX_SPIKES:
            repaired[name] = record.signals[name].copy()
            repaired[name][present[mask]] = np.nan
    return record.with_signals(repaired) if repaired else record


def spikes(record: Record, name: str) -> Iterator[Finding]:
    """Values that no truck makes, which are left out."""
    time, values = present_samples(record, name)
    mask = spike_mask(name, time, values)
    if mask.any():
        yield warning(name, Fault.SPIKE, spike_note(name, time, values, mask))


SETTLING_TIME = 4.0
"""Time until the units behind follow a constant steer angle, s: near the limit of adhesion, a semitrailer swings for
3 s."""


def stuck(record: Record, name: str, min_speed: float) -> Iterator[Finding]:
    """A constant value for over 1 s, and over three times the typical hold time, while other signals show a turn.

    An error if it lasts more than a tenth of the record.
    """
    limit = limit_of(name)
    if limit is None or limit.may_be_constant or "speed" not in record.signals:
        return
    time, values = present_samples(record, name)
    if values.size < 3:
        return
    starts = np.concatenate([[0], np.flatnonzero(np.diff(values) != 0) + 1])
    stops = np.concatenate([starts[1:] - 1, [values.size - 1]])
    hold_times = time[stops] - time[starts]
    typical = float(np.median(hold_times[:-1])) if hold_times.size > 2 else 0.0
    long = hold_times > max(1.0, 3 * typical)
    frozen = [
        (time[start], time[stop])
        for start, stop in zip(starts[long], stops[long], strict=True)
        if _turns(record, name, time[start], time[stop], min_speed)
    ]
    if not frozen:
        return
    total = sum(stop - start for start, stop in frozen)
    first, last = record.span
    start, stop = max(frozen, key=lambda span: span[1] - span[0])
    value = values[np.searchsorted(time, start)]
    finding = error if total > 0.1 * (last - first) else warning
    where = f"{value:.4g} {si_unit(name)} from {start:.2f} to {stop:.2f} s"
    yield finding(name, Fault.STUCK, f"constant at {where} while other signals show a turn; {_MAP_OR_CUT}")


def _turns(record: Record, name: str, start: float, stop: float, min_speed: float) -> bool:
    """Whether the vehicle moves from start to stop, s, and a signal other than `name` changes as in a turn."""
    parts = min(math.ceil((stop - start) / _MANOEUVRE), _MAX_PARTS)
    driven = is_input(name)
    factor = 2.0 if driven else 1.0  # steer is constant in a steady turn, and other signals follow it late
    for begin, end in pairwise(np.linspace(start, stop, parts + 1).tolist()):
        rows = slice(*np.searchsorted(record.time, [begin, end + 1e-9]))
        speed = record.signals["speed"][rows]
        if not np.any(speed > min_speed) or np.nanmedian(speed) < min_speed:
            continue
        for other, values in record.signals.items():
            limit = limit_of(other)
            late = driven and SignalName.of(other).unit != SignalName.of(name).unit
            settled = record.time[rows] >= start + SETTLING_TIME * late  # the units behind still turn
            within = values[rows][settled]
            within = within[~np.isnan(within)]
            if other != name and limit is not None and within.size > 3:
                low, high = np.quantile(within, [0.1, 0.9])
                if high - low > factor * limit.turn:
                    return True
    return False
