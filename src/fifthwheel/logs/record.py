"""A record: one time base, named signals on it, and, kept apart, the truth that only a comparison may see."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fifthwheel.errors import SignalError
from fifthwheel.logs.names import known, suggest

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Record:
    """What a truck's sensors said, in SI and ISO 8855, on one strictly increasing time base.

    Arrays are copied, float64 and read-only. NaN is a missing sample; infinite values are refused. Names follow
    quantity.unit[.axle] (names.py). Two records are equal when time, signals and reference are; name and notes do not
    count.
    """

    time: Array
    """(N,) s, N >= 2, strictly increasing, not necessarily regular."""
    signals: Mapping[str, Array]
    """Signal name to (N,) values in SI, NaN where missing."""
    reference: Mapping[str, Array] = field(default_factory=dict)
    """The same for what an estimator may never see: optical sideslip, an INS's lateral velocity, a plant's states."""
    name: str = "record"
    """What to call it in a report."""
    notes: tuple[str, ...] = ()
    """What was left out or repaired on the way in, a sentence each."""

    def __post_init__(self) -> None:
        time = increasing(_frozen("time", self.time))
        if time.size < 2:
            raise SignalError(f"time: {time.size} samples, at least 2 expected; the log or the cut is empty")
        object.__setattr__(self, "time", time)
        for part in ("signals", "reference"):
            columns = {known(name): _frozen(name, values) for name, values in getattr(self, part).items()}
            for name, values in columns.items():
                if name == "time":
                    raise SignalError("time: is the base of the record, it cannot be one of its signals")
                if values.size != time.size:
                    raise SignalError(f"{name}: {values.size} samples where time has {time.size}; give one value each")
                if np.isinf(values).any():
                    at = time[np.isinf(values).argmax()]
                    raise SignalError(f"{name}: infinite at {at:.2f} s; mark missing samples with NaN")
            object.__setattr__(self, part, MappingProxyType(columns))
        object.__setattr__(self, "notes", tuple(self.notes))

    @property
    def span(self) -> tuple[float, float]:
        """First and last instant, s."""
        return float(self.time[0]), float(self.time[-1])

    @property
    def rate(self) -> float:
        """Samples a second, Hz, as usual_step() tells it."""
        return 1 / usual_step(self.time)

    def cut(self, start: float = -np.inf, stop: float = np.inf) -> "Record":
        """The samples with start <= time <= stop, s."""
        inside = (self.time >= start) & (self.time <= stop)
        if inside.sum() < 2:
            first, last = self.span
            raise SignalError(
                f"{self.name}: {inside.sum()} samples between {start:.2f} and {stop:.2f} s, at least 2 expected; "
                f"the record runs from {first:.2f} to {last:.2f} s"
            )
        return self._rows(inside, self.name)

    def sections(self, max_gap: float = 1.0, shortest: float = 1.0) -> list["Record"]:
        """The stretches between time steps above `max_gap` s, without those under `shortest` s; none left: an error."""
        pieces = np.split(np.arange(len(self)), np.flatnonzero(np.diff(self.time) > max_gap) + 1)
        if len(pieces) == 1:
            return [self]
        kept = [rows for rows in pieces if rows.size > 1 and self.time[rows[-1]] - self.time[rows[0]] >= shortest]
        if not kept:
            raise SignalError(
                f"{self.name}: falls into {len(pieces)} pieces under {shortest:g} s at time steps above {max_gap:g} s, "
                f"its median step is {1 / self.rate:g} s; check the unit of time, or allow longer gaps"
            )
        return [self._rows(rows, f"{self.name} ({k})") for k, rows in enumerate(kept, 1)]

    def input(self, name: str, max_gap: float = 0.5) -> Array:
        """A signal (N,) without holes, as one that drives a model must be.

        Linear between samples up to `max_gap` s apart; a hole at either end, as short, takes the nearest sample.
        """
        if name not in self.signals:
            raise SignalError(f"{name}: not in {self.name}; {suggest(name, sorted(self.signals))}; map a channel to it")
        values, time = self.signals[name], self.time
        good = ~np.isnan(values)
        if good.all():
            return values
        seen = np.flatnonzero(good)
        edges = np.concatenate([[0], seen, [time.size - 1]])  # of a hole at either end only the missing part counts
        holes = np.where(np.diff(edges) > 1, np.diff(time[edges]), 0.0)
        holes[0], holes[-1] = time[edges[1]] - time[0], time[-1] - time[edges[-2]]
        worst = int(holes.argmax())
        if not seen.size or holes[worst] > max_gap + 1e-9:
            raise SignalError(
                f"{name}: {1 - good.mean():.0%} missing, nothing between {time[edges[worst]]:.2f} and "
                f"{time[edges[worst + 1]]:.2f} s, {max_gap:g} s allowed; map another channel or cut the record"
            )
        return _frozen(name, np.interp(time, time[good], values[good]))

    def with_signals(self, signals: Mapping[str, ArrayLike]) -> "Record":
        """The same record with these signals added, or put in the place of those of the same name."""
        return replace(self, signals={**self.signals, **{n: np.asarray(v, dtype=float) for n, v in signals.items()}})

    def __len__(self) -> int:
        return int(self.time.size)

    def __repr__(self) -> str:
        first, last = self.span
        names = ", ".join(self.signals)
        return f"Record({self.name!r}, {len(self)} samples, {first:g} to {last:g} s at {self.rate:.3g} Hz: {names})"

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Record):
            return NotImplemented
        return np.array_equal(self.time, other.time) and all(
            a.keys() == b.keys() and all(np.array_equal(a[n], b[n], equal_nan=True) for n in a)
            for a, b in ((self.signals, other.signals), (self.reference, other.reference))
        )

    __hash__ = None  # type: ignore[assignment]

    def __reduce__(self) -> tuple[Any, ...]:
        fields: dict[str, Any] = {"signals": dict(self.signals), "reference": dict(self.reference)}
        return partial(Record, time=self.time, **fields, name=self.name, notes=self.notes), ()

    def _rows(self, rows: NDArray[Any], name: str) -> "Record":
        signals = {n: v[rows] for n, v in self.signals.items()}
        reference = {n: v[rows] for n, v in self.reference.items()}
        return replace(self, time=self.time[rows], signals=signals, reference=reference, name=name)


def usual_step(time: Array) -> float:
    """Seconds a sample where there are samples, of an increasing time (n,); NaN of fewer than two.

    The median over 20 steps at a time: neither holes count, nor whether samples come evenly or in bursts, as the
    messages of a bus do.
    """
    width = min(20, time.size - 1)
    return float(np.median(time[width:] - time[:-width])) / width if width > 0 else float("nan")


def increasing(time: Array, name: str = "time", before: int = 0) -> Array:
    """The time itself, s, when finite and strictly increasing; else a SignalError at the first bad row (from 1).

    before: rows that came earlier, for the message.
    """
    if not np.isfinite(time).all():
        row = int((~np.isfinite(time)).argmax()) + before
        raise SignalError(f"{name}: no finite value at row {row + 1}; every row needs its time, leave it out otherwise")
    steps = np.diff(time)
    if (steps <= 0).any():
        row = int((steps <= 0).argmax()) + 1
        at = f"{time[row]:.6g} s at row {row + before + 1}"
        if steps[row - 1] == 0:
            raise SignalError(f"{name}: {at} is there twice; keep one of the rows, or give more digits of the time")
        raise SignalError(
            f"{name}: goes back from {time[row - 1]:.6g} to {at}; "
            f"sort the log, or split it there when it holds two drives or the clock was set"
        )
    return time


def _frozen(name: str, values: ArrayLike) -> Array:
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise SignalError(f"{name}: not numbers; expected one float for each sample") from error
    if array.ndim != 1:
        raise SignalError(f"{name}: {array.ndim} dimensions, expected one value for each sample")
    array.setflags(write=False)
    return array
