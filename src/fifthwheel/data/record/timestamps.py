"""Timestamps: their typical step, their order, removal of corrupted ones; samples that are held between messages."""

from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

from fifthwheel.base.errors import SignalError
from fifthwheel.base.types import Array

MAX_BACKWARD_STEP = 1.0
"""s. Where time goes back by more and stays there, it is not repaired: another run begins, or the clock was set."""
DATES = datetime(1980, 1, 1, tzinfo=UTC).timestamp(), datetime(2100, 1, 1, tzinfo=UTC).timestamp()
"""s since 1970; times between them are dates, others count from an instant of the device."""
_MOST_REPEATED = 0.1
"""Fraction of the rows that may repeat the timestamp of the row before with other values."""
ENDS = 1.0
"""s; so much may be missing at each end of a record, as of a channel whose delay is corrected."""
_MAX_RESTARTS = 16
"""Restarts of the time that a piece of samples may have."""
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
SLOWEST_SPEED = 1.25
"""s. The same for the speed, which a receiver of satellites gives once a second."""
_MIN_RENEWALS, _MIN_LEVELS = 6, 5
"""Runs, and values among them, of a speed that moves too little: it is held if all runs are multiples of the same
number of rows."""
_CERTAIN_RUNS = 200
"""Runs of a piece that are enough to see that a column is not held."""


def utc_date(time: float) -> datetime | None:
    """The date of a time, s, that counts from 1970; None for any other."""
    return datetime.fromtimestamp(time, UTC) if DATES[0] <= time < DATES[1] else None


def origin(time: float) -> float:
    """The instant, s, from which a log that begins at a time counts: its first whole second, if it is since 1970."""
    return float(np.floor(time)) if time >= DATES[0] else 0.0


def instant(time: float) -> str:
    """A timestamp in words: the date where s count from 1970."""
    date = utc_date(time)
    return f"{date:%Y-%m-%d %H:%M:%S.%f}"[:-3] + " UTC" if date else f"{time:.6g} s"


def is_hour(step: float) -> bool:
    """Whether a step between timestamps, s, is one hour back or forward, as clocks make it for daylight saving time."""
    return abs(abs(step) - 3600.0) < 5.0


def typical_step(time: Array) -> float:
    """Typical step between increasing timestamps (n,), s; NaN for fewer than two.

    The median of the mean over 20 consecutive steps. Gaps do not change it, nor do samples that come in bursts, as
    messages on a bus do.
    """
    width = min(20, time.size - 1)
    return float(np.median(time[width:] - time[:-width])) / width if width > 0 else float("nan")


def require_increasing(time: Array, name: str = "time", rows_before: int = 0) -> Array:
    """The timestamps (n,) themselves, s, if they are finite and strictly increasing.

    Otherwise a SignalError names the first wrong row, counted from 1 after `rows_before` earlier ones.
    """
    if not np.isfinite(time).all():
        row = int((~np.isfinite(time)).argmax()) + rows_before
        raise SignalError(f"{name}: no finite value at row {row + 1}; give every row a time, or remove the row")
    steps = np.diff(time)
    if (steps <= 0).any():
        row = int((steps <= 0).argmax()) + 1
        at = f"{instant(time[row])} at row {row + rows_before + 1}"
        if steps[row - 1] == 0:
            raise SignalError(f"{name}: {at} occurs twice; keep one of the rows, or log the time with more digits")
        cure = "sort the rows, or split the log there if it holds two runs or the clock was set"
        if is_hour(steps[row - 1]):
            cure = (
                "the clock went back by one hour, as at the end of daylight saving time; export the time in UTC or "
                "with its zone, or split the log there"
            )
        raise SignalError(f"{name}: goes back from {instant(time[row - 1])} to {at}, increasing time expected; {cure}")
    return time


def implausible_timestamps(time: Array) -> NDArray[np.bool_]:
    """Mask (n,) of single timestamps that are more than 1 s later than the next one, as after a bit error."""
    mask = np.zeros(time.size, dtype=bool)
    mask[1:-1] = (time[1:-1] - time[2:] > MAX_BACKWARD_STEP) & (time[2:] > time[:-2])
    return mask


class RepeatedTimestamps:
    """Joins the rows of a table with one timestamp, which arrive in pieces: of each column the first value counts."""

    def __init__(self) -> None:
        self._held: tuple[Array, Mapping[str, Array]] = (np.empty(0), {})
        self._rows = self._joined = self._contrary = 0
        self._first = np.nan

    def push(self, time: Array, values: Mapping[str, Array]) -> tuple[Array, Mapping[str, Array]]:
        """The next rows, time (n,) and values (n,) by column, without those of the last timestamp, which is held."""
        held_time, held = self._held
        if held_time.size:
            time, values = np.concatenate([held_time, time]), {n: np.append(held[n], v) for n, v in values.items()}
        earlier = np.flatnonzero(time != time[-1:])
        last = int(earlier[-1]) + 1 if earlier.size else 0
        self._held = time[last:], {name: column[last:] for name, column in values.items()}
        return self._joined_rows(time[:last], {name: column[:last] for name, column in values.items()})

    def last(self, label: str) -> tuple[Array, Mapping[str, Array]]:
        """The rows that are held; a SignalError if too many rows have the timestamp of the row before them."""
        rows = self._joined_rows(*self._held)
        if self._contrary > _MOST_REPEATED * self._rows:
            raise SignalError(
                f"{label}: {self._contrary} of {self._rows} rows repeat the time of the row before with other values; "
                "log the time with more digits"
            )
        return rows

    @property
    def notes(self) -> list[str]:
        """One sentence if rows were joined."""
        if not self._joined:
            return []
        rows = "1 row repeats" if self._joined == 1 else f"{self._joined} rows repeat"
        return [f"time: {rows} the timestamp of the row before, first at {instant(self._first)}; one sample is used"]

    def _joined_rows(self, time: Array, values: Mapping[str, Array]) -> tuple[Array, Mapping[str, Array]]:
        self._rows += time.size
        same = np.diff(time, prepend=np.nan) == 0
        if not same.any():
            return time, values
        self._first = self._first if self._joined else float(time[same.argmax()])
        self._joined += int(same.sum())
        groups, new = np.cumsum(~same) - 1, np.flatnonzero(~same)
        contrary, joined = np.zeros(time.size, dtype=bool), {}
        for name, column in values.items():
            filled = np.flatnonzero(np.isfinite(column))[::-1]
            joined[name] = np.full(new.size, np.nan)
            joined[name][groups[filled]] = column[filled]  # the first row is written last
            contrary[filled] |= column[filled] != joined[name][groups[filled]]
        self._contrary += int(contrary.sum())
        return time[new], joined


class TimestampFilter:
    """Selects the samples of several time bases whose timestamps increase, piece by piece, and counts the others."""

    def __init__(self) -> None:
        self._last: dict[Hashable, float] = {}
        self._dropped: dict[Hashable, int] = {}

    def keep(self, clock: Hashable, time: Array) -> NDArray[np.bool_]:
        """Mask (n,) of the samples to keep: those later than all before them on this time base, also in earlier calls.

        Timestamps that go back by more than 1 s and stay there begin again; the reader of the log decides about them.
        """
        last = self._last.get(clock, -np.inf)
        if time.size and time[0] > last and np.isfinite(time).all() and (np.diff(time) > 0).all():
            self._last[clock] = float(time[-1])
            return np.ones(time.size, dtype=bool)
        kept = np.isfinite(time)
        rows = np.flatnonzero(kept)
        kept[rows[implausible_timestamps(time[rows])]] = False
        rows = np.flatnonzero(kept)
        begin = 0
        for _ in range(_MAX_RESTARTS):
            remaining = time[rows[begin:]]
            latest = np.maximum.accumulate(np.concatenate([[last], remaining]))[:-1]
            late = remaining <= latest
            backward = remaining < latest - MAX_BACKWARD_STEP
            restarts = np.flatnonzero(backward[:-1] & backward[1:])  # two in a row: the time stays there
            end = int(restarts[0]) if restarts.size else remaining.size
            kept[rows[begin : begin + end]] = ~late[:end]
            if not restarts.size:
                last = float(np.max(remaining, initial=last))
                break
            begin += end
            last = -np.inf
        else:
            last = float(time[rows[-1]])
        self._last[clock] = last
        self._dropped[clock] = self._dropped.get(clock, 0) + int((~kept).sum())
        return kept

    @property
    def dropped(self) -> int:
        """Samples left out, of all time bases."""
        return sum(self._dropped.values())

    @property
    def notes(self) -> list[str]:
        """One sentence for each time base that lost samples."""
        return [
            f"{count} sample{'s' * (count > 1)}{f' of {clock!r}' if clock else ''} left out: timestamps must increase"
            for clock, count in self._dropped.items()
            if count
        ]


def missing_steps(time: Array, values: Array) -> tuple[Array, Array]:
    """Edges (n + 2,), s, of the steps between the n present samples of a channel (N,), and the time that is missing in
    each, (n + 1,), s; n is at least 2.

    Missing samples are counted against the channel's own sampling period, the 30 % quantile of its steps: a channel of
    a lower rate than the rows, or one that is held, is complete. No sample is missing between two successive instants
    of the record, nor within `ENDS` of its first and last instant.
    """
    rows = np.flatnonzero(np.isfinite(values))
    period = float(np.quantile(np.diff(time[rows]), 0.3))
    edges = np.concatenate([[time[0] - period], time[rows], [time[-1] + period]])
    apart = np.diff(np.concatenate([[-1], rows, [time.size]])) > 1
    steps = np.diff(edges)
    missing = np.where(apart & (steps > 1.5 * period), steps - period, 0.0)
    missing[[0, -1]] = np.maximum(missing[[0, -1]] - ENDS, 0.0)
    return edges, missing


def missing_fraction(time: Array, values: Array) -> float:
    """Fraction of the time (N,), s, in which samples (N,) are missing, as `missing_steps` counts them; 1 with less than
    2 samples.

    >>> missing_fraction(np.arange(5.0), np.array([0.0, np.nan, 1.0, np.nan, 2.0]))
    0.0
    """
    if np.isfinite(values).sum() < 2:
        return 1.0
    return float(missing_steps(time, values)[1].sum() / (time[-1] - time[0]))


@dataclass(frozen=True, kw_only=True, eq=False)
class HeldSamples:
    """The samples of a held channel at which its value was renewed.

    Such a channel repeats its last value until the next message of the bus arrives. As samples of the table the
    repetitions make a staircase, on average half a period late.
    """

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

    def __init__(self, *, of_speed: bool = False) -> None:
        self._of_speed = of_speed
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
            rows = lengths[1:-1].astype(int)
            if not self._of_speed or rows.size < _MIN_RENEWALS or np.unique(values).size < _MIN_LEVELS:
                return None
            moving = np.full(rows.size, float(np.gcd.reduce(rows)))
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
        if rate * (SLOWEST_SPEED if self._of_speed else _LONGEST) < 1:
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
