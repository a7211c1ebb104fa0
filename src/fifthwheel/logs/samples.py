"""Faults that a channel shows by itself: missing, lone and frozen samples."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fifthwheel.logs.faults import Fault, Finding, Severity
from fifthwheel.logs.names import is_input
from fifthwheel.logs.record import Array, Record


@dataclass(frozen=True, kw_only=True)
class Limit:
    """What a heavy vehicle on a road can do in one quantity."""

    most: float
    """Magnitude never exceeded."""
    jump: float
    """Change within 0.1 s that no truck makes: a spike."""
    turn: float
    """Change within a second that tells a turn from a straight."""
    unit: str


LIMITS: dict[str, Limit] = {
    "speed": Limit(most=45.0, jump=2.0, turn=np.inf, unit="m/s"),
    "steer": Limit(most=1.2, jump=0.15, turn=0.01, unit="rad"),
    "yaw_rate": Limit(most=1.5, jump=0.15, turn=0.03, unit="rad/s"),
    "articulation": Limit(most=1.7, jump=0.06, turn=0.02, unit="rad"),
    "lateral_acceleration": Limit(most=12.0, jump=3.0, turn=1.0, unit="m/s^2"),
    "lateral_velocity": Limit(most=10.0, jump=1.0, turn=np.inf, unit="m/s"),
    "sideslip": Limit(most=1.0, jump=0.1, turn=np.inf, unit="rad"),
    "roll": Limit(most=0.5, jump=0.05, turn=0.02, unit="rad"),
    "roll_rate": Limit(most=2.0, jump=0.4, turn=np.inf, unit="rad/s"),
    "wheel_speed": Limit(most=45.0, jump=2.0, turn=np.inf, unit="m/s"),
    "longitudinal_acceleration": Limit(most=12.0, jump=3.0, turn=np.inf, unit="m/s^2"),
    "axle_load": Limit(most=5e5, jump=1e5, turn=np.inf, unit="N"),
}


_STEADY = ("speed", "wheel_speed", "axle_load")
"""What may stay as it is while the truck turns."""


def seen(record: Record, name: str) -> tuple[Array, Array]:
    """Instants (n,) s and values (n,) of the samples that are there."""
    values = record.signals[name]
    there = ~np.isnan(values)
    return record.time[there], values[there]


_MOST_WINDOWS = 100_000
_ENDLESS = 1e9
"""SI; no quantity of a truck is as large."""


def absurd(name: str, values: Array) -> NDArray[np.bool_]:
    """Which samples (n,) no sensor shows and no unit explains: beyond ten times what a truck can do, and few of them.

    Where more than 1 % are, it is the unit or the column, which check() names; only beyond 1e9 all of them are absurd.
    """
    limit = LIMITS.get(name.partition(".")[0])
    with np.errstate(invalid="ignore"):
        size = np.abs(values)
        far = size > (10 * limit.most if limit else _ENDLESS)
        return far if far.sum() < 0.01 * far.size else np.isfinite(size) & (size > _ENDLESS)


def dropouts(record: Record, name: str, window: float = 5.0) -> Iterator[Finding]:
    """A hole above 0.5 s, more than 5 % missing within `window` s, or (an error) more than half of all.

    Missing is what the channel's own rhythm lacks, the 30 % quantile of its steps: one of a slower rate than the rows
    is whole. Between two instants of the record that follow each other nothing is missing.
    """
    time, values = seen(record, name)
    there = np.flatnonzero(np.isfinite(record.signals[name]))
    first, last = record.span
    if values.size == len(record):
        return
    if values.size < 2:
        message = f"{name}: {values.size} samples of {len(record)}; map another channel"
        yield Finding(signal=name, fault=Fault.DROPOUT, severity="error", message=message)
        return
    rhythm = float(np.quantile(np.diff(time), 0.3))
    ends = np.concatenate([[first - rhythm], time, [last + rhythm]])
    steps = np.diff(ends)
    apart = np.diff(np.concatenate([[-1], there, [len(record)]])) > 1
    holes = apart & (steps > 1.5 * rhythm)
    lost = np.where(holes, steps - rhythm, 0.0)
    share = float(lost.sum() / (last - first))
    longest = int(lost.argmax())
    bins = min(max(1, round((last - first) / window)), _MOST_WINDOWS)
    per_bin, edges = np.histogram(ends[:-1], bins=bins, range=(first - rhythm, last), weights=lost)
    worst = int(per_bin.argmax())
    if lost[longest] > 0.5:
        start, stop = ends[longest], ends[longest + 1]
        where = f"nothing between {max(start, first):.2f} and {min(stop, last):.2f} s, 0.5 s allowed"
    elif per_bin[worst] / (edges[1] - edges[0]) > 0.05:
        local = per_bin[worst] / (edges[1] - edges[0])
        where = f"{local:.0%} between {max(edges[worst], first):.2f} and {edges[worst + 1]:.2f} s, 5 % allowed"
    else:
        return
    message = f"{name}: {share:.0%} missing, {where}; map another channel or cut the record"
    yield Finding(signal=name, fault=Fault.DROPOUT, severity="error" if share > 0.5 else "warning", message=message)


def lone(time: Array, values: Array, jump: float) -> NDArray[np.bool_]:
    """Which samples are spikes: over 8 robust sigmas, and over a jump no truck makes, off the median of five."""
    if values.size < 5:
        return np.zeros(values.size, dtype=bool)
    padded = np.concatenate([values[[2, 1]], values, values[[-2, -3]]])
    off = np.abs(values - np.median(np.lib.stride_tricks.sliding_window_view(padded, 5), axis=1))
    jump *= max(1.0, float(np.median(np.diff(time))) / 0.1)
    marks: NDArray[np.bool_] = off > max(8 * 1.4826 * float(np.median(off)), jump)
    return marks


def without_spikes(record: Record) -> Record:
    """The record with the lone samples of speed and steer angles missing: nothing gates what drives the model."""
    clean = {}
    for name in filter(is_input, record.signals):
        time, values = seen(record, name)
        marks = lone(time, values, LIMITS[name.partition(".")[0]].jump)
        if marks.any() and np.mean(marks) < 0.1:
            clean[name] = np.where(np.isin(record.time, time[marks]), np.nan, record.signals[name])
    return record.with_signals(clean) if clean else record


def spikes(record: Record, name: str) -> Iterator[Finding]:
    """Lone samples; only a warning, as filters gate them where they are measurements."""
    limit = LIMITS.get(name.partition(".")[0])
    if limit is None:
        return
    time, values = seen(record, name)
    marks = lone(time, values, limit.jump)
    if marks.any() and np.mean(marks) < 0.1:  # where a tenth are, it is no spike but the signal or its unit
        at = int(marks.argmax())
        cure = (
            "an identification leaves them out, an observer cannot: repair the channel, or mark them as missing"
            if is_input(name)
            else "they are gated as outliers, repair the channel if they are many"
        )
        first = f"the first {values[at]:.3g} {limit.unit} at {time[at]:.2f} s"
        message = f"{name}: {marks.sum()} spikes, {first}; {cure}"
        yield Finding(signal=name, fault=Fault.SPIKE, severity="warning", message=message)


def stuck(record: Record, name: str, min_speed: float) -> Iterator[Finding]:
    """The very same value for over 1 s, and three times as long as it usually holds one, while others show a turn.

    An error when that is more than a tenth of the record.
    """
    limit = LIMITS.get(name.partition(".")[0])
    time, values = seen(record, name)
    if limit is None or name.partition(".")[0] in _STEADY or "speed" not in record.signals or values.size < 3:
        return
    starts = np.concatenate([[0], np.flatnonzero(np.diff(values) != 0) + 1])
    stops = np.concatenate([starts[1:] - 1, [values.size - 1]])
    held = time[stops] - time[starts]
    usual = float(np.median(held[:-1])) if held.size > 2 else 0.0
    frozen = [
        (time[a], time[b])
        for a, b in zip(starts[held > max(1.0, 3 * usual)], stops[held > max(1.0, 3 * usual)], strict=True)
        if _turns(record, name, time[a], time[b], min_speed)
    ]
    if not frozen:
        return
    total = sum(b - a for a, b in frozen)
    first, last = record.span
    a, b = max(frozen, key=lambda run: run[1] - run[0])
    at = values[np.searchsorted(time, a)]
    message = (
        f"{name}: stuck at {at:.4g} {limit.unit} from {a:.2f} to {b:.2f} s while other signals show a turn; "
        f"map another channel or cut the record"
    )
    severity: Severity = "error" if total > 0.1 * (last - first) else "warning"
    yield Finding(signal=name, fault=Fault.STUCK, severity=severity, message=message)


def _turns(record: Record, name: str, start: float, stop: float, min_speed: float) -> bool:
    """Whether the vehicle moves within start to stop and a signal other than `name` changes as it does in a turn."""
    within = slice(*np.searchsorted(record.time, [start, stop + 1e-9]))
    speed = record.signals["speed"][within]
    if not np.any(speed > min_speed) or np.nanmedian(speed) < min_speed:
        return False
    factor = 2.0 if is_input(name) else 1.0  # steer rests in a steady turn, and acts late
    for other, values in record.signals.items():
        limit = LIMITS.get(other.partition(".")[0])
        inside = values[within]
        inside = inside[~np.isnan(inside)]
        if other != name and limit is not None and inside.size > 3:
            low, high = np.quantile(inside, [0.1, 0.9])
            if high - low > factor * limit.turn:
                return True
    return False
