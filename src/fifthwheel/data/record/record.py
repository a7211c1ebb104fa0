"""The record of a run: named signals on one time base, and reference signals that no estimator uses."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from datetime import datetime, timedelta
from functools import partial
from itertools import pairwise
from numbers import Real
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fifthwheel.base.arguments import expect
from fifthwheel.base.errors import SignalError, UnitError, suggestion
from fifthwheel.base.lazy import lazy, require
from fifthwheel.base.types import Array, ComparedByContents
from fifthwheel.base.units import factor
from fifthwheel.data.channels import CHANNELS, REFERENCE, SignalName, checked_name, si_unit, split_reference
from fifthwheel.data.channels.sensors import SensorPrior
from fifthwheel.data.record.tables import columns_of
from fifthwheel.data.record.timestamps import missing_fraction, require_increasing, typical_step, utc_date

if TYPE_CHECKING:
    import pandas as pd

    from fifthwheel.base.plots import Plot

V = TypeVar("V")

LONGEST_GAP = 0.5
"""Of an input, s, across which it is interpolated."""
PAUSE = 1.0
"""A longer time step, s, divides a record into segments."""
SHOWN_NAMES = 8
"""The largest number of signals that the text of a record names."""


class ReadOnlyDict(dict[str, V]):
    """A dictionary that refuses changes.

    It is a `dict` and not a `MappingProxyType`, because pandas reads any other mapping as a list of its keys:
    `pandas.DataFrame(record.signals)` would be one column of names.
    """

    def _refuse(self, *_: Any, **__: Any) -> NoReturn:
        raise TypeError("read-only; make a new record, for example by record.with_signals")

    __setitem__ = __delitem__ = __ior__ = _refuse
    clear = pop = popitem = setdefault = update = _refuse

    def __reduce__(self) -> tuple[Any, ...]:
        return ReadOnlyDict, (dict(self),)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Record(ComparedByContents):
    """Measured signals of a truck in SI and ISO 8855 on one strictly increasing time base.

    Arrays are copied to float64 and read-only. NaN is a missing sample; infinite values are refused. Signals are named
    quantity.unit[.axle]; `from_arrays` and `from_table` take other units. Two records are equal if time, signals and
    reference are equal; name, notes, time bases, sensors and date are not compared. In a notebook a record shows a
    table of its channels.

    Example:
        >>> import fifthwheel as fw
        >>> record = fw.Record(time=[0, 0.1, 0.2], signals={"speed": [20.0, 20.1, 20.2]}, name="run")
        >>> record
        Record('run', 3 samples, 0 to 0.2 s at 10 Hz: speed)
        >>> record.cut(0.1, 0.2).signals["speed"]
        array([20.1, 20.2])
        >>> record.to_pandas().columns.tolist()
        ['speed']
    """

    time: Array
    """(N,) s, N >= 2, strictly increasing, not necessarily regular."""
    signals: Mapping[str, Array]
    """Signal name to (N,) values in SI, NaN where missing."""
    reference: Mapping[str, Array] = field(default_factory=dict)
    """Signals for comparison only, never used by an estimator: optical sideslip, INS velocity, simulated states."""
    name: str = field(default="record", compare=False)
    """Name of the run in reports."""
    notes: tuple[str, ...] = field(default=(), compare=False)
    """What was left out or repaired when the log was read, one sentence each."""
    time_bases: Mapping[str, str] = field(default_factory=dict, compare=False)
    """Signal to the name of the time base, or clock, that gave its timestamps; signals that are not listed share the
    main time base. Entries of other names are left out."""
    sensors: Mapping[str, SensorPrior] = field(default_factory=dict, compare=False)
    """What is stated of the sensor of a signal; an identification takes the priors of its errors from it. Entries of
    other names are left out."""
    date: datetime | None = field(default=None, compare=False)
    """UTC date and time at which `time` is 0, where the log has one."""

    def __post_init__(self) -> None:
        for part in ("signals", "reference", "time_bases", "sensors"):
            expect(part, getattr(self, part), Mapping)
        expect("name", self.name, str)
        time = require_increasing(_frozen("time", self.time))
        if time.size < 2:
            raise SignalError(
                f"time: {time.size} samples, at least 2 expected; check the log, and the start and stop of the cut"
            )
        object.__setattr__(self, "time", time)
        for part in ("signals", "reference"):
            columns = {checked_name(name): _frozen(name, values) for name, values in getattr(self, part).items()}
            for name, values in columns.items():
                if name == "time":
                    raise SignalError("time: the time base cannot be a signal as well; give the signal another name")
                if values.size != time.size:
                    raise SignalError(
                        f"{name}: {values.size} samples, {time.size} expected as in time; give one per instant"
                    )
                if np.isinf(values).any():
                    at = time[np.isinf(values).argmax()]
                    raise SignalError(f"{name}: infinite at {at:.2f} s; mark missing samples with NaN")
            object.__setattr__(self, part, ReadOnlyDict(columns))
        object.__setattr__(self, "notes", tuple(self.notes))
        known = {name: base for name, base in self.time_bases.items() if name in self.signals or name in self.reference}
        object.__setattr__(self, "time_bases", ReadOnlyDict(known))
        for name, sensor in self.sensors.items():
            expect(f"sensors, {checked_name(name)}", sensor, SensorPrior)
        sensors = {name: s for name, s in self.sensors.items() if name in self.signals and s != SensorPrior()}
        for name, sensor in sensors.items():
            sensor.require_fits(name)
        object.__setattr__(self, "sensors", ReadOnlyDict(sensors))

    @classmethod
    def from_arrays(
        cls, time: ArrayLike, signals: Mapping[str, ArrayLike], *, units: Mapping[str, str] | None = None, **fields: Any
    ) -> "Record":
        """A record of arrays in any unit.

        Args:
            time: (N,) s, strictly increasing.
            signals: signal name to (N,) values, NaN where missing; reference signals as "reference.<name>".
            units: signal name to unit, such as "km/h" or "deg/s"; SI for others.
            fields: others of a record, such as `name`.

        Raises:
            SignalError: the name of a signal, a unit, or the shape of an array is wrong.

        Example:
            >>> import fifthwheel as fw
            >>> record = fw.Record.from_arrays([0, 0.1], {"speed": [72.0, 72.0]}, units={"speed": "km/h"})
            >>> record.signals["speed"]
            array([20., 20.])
        """
        if unknown := sorted(set(units or {}) - set(signals)):
            raise SignalError(f"{unknown[0]}: has a unit, but is not a signal; {suggestion(unknown[0], signals)}")
        parts: dict[bool, dict[str, Array]] = {False: {}, True: {}}
        for given, values in signals.items():
            signal, is_reference = split_reference(str(given))
            name = checked_name(signal)
            scale = _factor(given, units[given]) if units and given in units else 1.0
            parts[is_reference][name] = _frozen(given, values) * scale
        return cls(time=np.asarray(time), signals=parts[False], reference=parts[True], **fields)

    @classmethod
    def from_table(cls, table: Any, *, units: Mapping[str, str] | None = None, **fields: Any) -> "Record":
        """A record of a table whose columns are signals, such as a frame of pandas or Polars; inverse of `to_pandas`.

        Args:
            table: the index of a frame of pandas is the time; any other table with the Arrow interface has a column
                "time". The time is in seconds, durations, or dates; dates without a zone are UTC. Rename other columns
                before; columns "reference.<name>" become reference signals.
            units: column to unit, such as "km/h" or "deg/s"; SI for others.
            fields: others of a record, such as `name`.

        Raises:
            SignalError: there is no time, or a column is not a signal.

        Example:
            >>> import pandas as pd
            >>> import fifthwheel as fw
            >>> time = pd.date_range("2026-05-01", periods=2, freq="100ms")
            >>> frame = pd.DataFrame({"speed": [72.0, 72.0]}, index=time)
            >>> record = fw.Record.from_table(frame, units={"speed": "km/h"})
            >>> record.time, record.date.year
            (array([0. , 0.1]), 2026)
        """
        time, values, date = columns_of(table)
        return cls.from_arrays(time, values, units=units, **{**({} if date is None else {"date": date}), **fields})

    @property
    def span(self) -> tuple[float, float]:
        """First and last instant, s."""
        return float(self.time[0]), float(self.time[-1])

    @lazy
    def rate(self) -> float:
        """Sampling rate, Hz: one over the typical step."""
        return 1 / typical_step(self.time)

    def cut(self, start: float = -np.inf, stop: float = np.inf) -> "Record":
        """The record of the samples with start <= time <= stop, s; a SignalError for fewer than two."""
        expect("start", start, Real)
        expect("stop", stop, Real)
        inside = (self.time >= start) & (self.time <= stop)
        if inside.sum() < 2:
            first, last = self.span
            raise SignalError(
                f"{self.name}: {inside.sum()} samples between {start:.2f} and {stop:.2f} s, at least 2 expected; "
                f"choose start and stop within {first:.2f} to {last:.2f} s"
            )
        rows = np.flatnonzero(inside)
        return self._rows(slice(rows[0], rows[-1] + 1), self.name)

    def segments(self, max_gap: float = PAUSE, shortest: float = 1.0) -> list["Record"]:
        """The segments between time steps above `max_gap` s that last at least `shortest` s.

        Raises:
            SignalError: no segment is long enough.
        """
        edges = [0, *(np.flatnonzero(np.diff(self.time) > max_gap) + 1).tolist(), len(self)]
        segments = [slice(*pair) for pair in pairwise(edges)]
        if len(segments) == 1:
            return [self]
        kept = [s for s in segments if s.stop - s.start > 1 and self.time[s.stop - 1] - self.time[s.start] >= shortest]
        if not kept:
            raise SignalError(
                f"{self.name}: all {len(segments)} segments between gaps above {max_gap:g} s are shorter than "
                f"{shortest:g} s, the typical step is {1 / self.rate:g} s; check the unit of time, or allow longer gaps"
            )
        return [self._rows(rows, f"{self.name} ({k})") for k, rows in enumerate(kept, 1)]

    def input(self, name: str, max_gap: float = LONGEST_GAP) -> Array:
        """A signal (N,) without missing samples, as the inputs of a model must be.

        Gaps up to `max_gap` s are filled: linearly between samples, with the nearest sample at either end. A pause of
        all signals, a time step above `PAUSE`, does not count.

        Raises:
            SignalError: the signal does not exist, or a gap is longer.
        """
        if name not in self.signals:
            raise SignalError(
                f"{name}: not in {self.name}; {suggestion(name, sorted(self.signals))}; "
                "map a column to it in signals.toml"
            )
        values, time = self.signals[name], self.time
        present = ~np.isnan(values)
        if present.all():
            return values
        edges, gaps = self._gaps(name)
        longest = int(gaps.argmax())
        if not present.any():
            raise SignalError(f"{name}: missing in all samples of {self.name}; map another column")
        if gaps[longest] > max_gap + 1e-9:
            raise SignalError(
                f"{name}: missing from {time[edges[longest]]:.2f} to {time[edges[longest + 1]]:.2f} s; up to "
                f"{max_gap:g} s is permitted; map another column, or cut the record with start and stop"
            )
        return _frozen(name, np.interp(time, time[present], values[present]))

    def _gaps(self, name: str) -> tuple[NDArray[np.int64], Array]:
        """Rows (k + 1,) of the present samples of a signal and of both ends, and the time, s, that is missing between
        them (k,)."""
        rows, steps = np.flatnonzero(~np.isnan(self.signals[name])), np.diff(self.time, prepend=self.time[0])
        edges = np.concatenate([[0], rows, [self.time.size - 1]])  # at either end only the missing part is a gap
        logged = np.cumsum(np.where(steps > PAUSE, 0.0, steps))  # a pause of all signals divides the record
        gaps = np.where(np.diff(edges) > 1, np.diff(logged[edges]), 0.0)
        gaps[0], gaps[-1] = logged[edges[1]] - logged[0], logged[-1] - logged[edges[-2]]
        return edges, gaps

    def averaged(self, count: int) -> "Record":
        """The record of the means of `count` samples each. White noise stays white, with a `count`-th of its variance.

        Where a signal lacks some of the samples, their mean is moved to the mean time of all along the slope of the
        signal.

        Example:
            >>> import fifthwheel as fw
            >>> record = fw.Record(time=[0, 0.1, 0.2, 0.3], signals={"speed": [20.0, 22.0, 24.0, 26.0]})
            >>> record.averaged(2).signals["speed"]
            array([21., 25.])
        """
        if len(self) < 3 * count or count == 1:  # too short for two means
            return self
        row = np.floor((self.time - self.time[0]) * self.rate / count + 0.5 / count)
        starts = np.flatnonzero(np.diff(row, prepend=-1.0))
        sizes = np.diff(np.append(starts, len(self)))
        elapsed = self.time - self.time[0]
        mean_time = np.add.reduceat(elapsed, starts) / sizes

        def mean(values: Array) -> Array:
            present = np.isfinite(values)
            if present.all():
                return np.asarray(np.add.reduceat(values, starts) / sizes)
            number = np.add.reduceat(present.astype(float), starts)
            with np.errstate(invalid="ignore"):
                result, own_time = (
                    np.add.reduceat(np.where(present, each, 0.0), starts) / number for each in (values, elapsed)
                )
            some = np.flatnonzero(number)
            if len(some) > 1:
                result[some] += np.gradient(result[some], own_time[some]) * (mean_time[some] - own_time[some])
            return result

        signals, reference = ({n: mean(v) for n, v in part.items()} for part in (self.signals, self.reference))
        return replace(self, time=self.time[0] + mean_time, signals=signals, reference=reference)

    def with_signals(self, signals: Mapping[str, ArrayLike]) -> "Record":
        """The record with these signals added; a signal of the same name is replaced."""
        return replace(self, signals={**self.signals, **{n: np.asarray(v, dtype=float) for n, v in signals.items()}})

    def to_pandas(self) -> "pd.DataFrame":
        """The signals as columns in SI over the time in s; reference signals are named "reference.<name>".

        Raises:
            FifthwheelError: pandas is not installed.
        """
        pandas = require("pandas", "pandas")
        frame: pd.DataFrame = pandas.DataFrame(self._channels(), index=pandas.Index(self.time, name="time"))
        return frame

    def plot(self, *names: str) -> "Plot":
        """Signals over time, one panel for each quantity; reference signals are dashed.

        Args:
            names: signals, or "reference.<name>"; all by default.

        Raises:
            SignalError: a name is not in the record.
        """
        from fifthwheel.base.formatting import shown
        from fifthwheel.base.plots import Axis, Line, Panel, Plot
        from fifthwheel.base.plots.items import CYCLE, Dash

        channels = self._channels()
        for name in names:
            if name not in channels:
                raise SignalError(f"{name}: not in {self.name}; {suggestion(name, channels)}")
        signals = {name: SignalName.of(split_reference(name)[0]) for name in names or channels}
        places = dict.fromkeys(signal.place for signal in signals.values())
        colours = {place: CYCLE[k % len(CYCLE)] for k, place in enumerate(places)}
        panels = []
        for quantity in dict.fromkeys(signal.quantity for signal in signals.values()):
            unit, lines = shown(CHANNELS[quantity].unit), []
            for name in (name for name, signal in signals.items() if signal.quantity == quantity):
                place, reference = signals[name].place, name.startswith(REFERENCE)
                label = ", ".join(filter(None, (place, "reference" if reference else "")))
                dash: Dash = "dash" if reference else "solid"
                values = channels[name] * unit.factor
                lines.append(Line(self.time, values, name=label, colour=colours[place], dash=dash, gaps=True))
            axis = Axis(label=quantity.replace("_", " "), unit=unit.name)
            panels.append(Panel(items=lines, x=Axis(label="time", unit="s"), y=axis))
        return Plot(panels=panels, title=self.name)

    def _channels(self) -> dict[str, Array]:
        """Signals and reference signals by name, the latter with "reference."."""
        return {**self.signals, **{REFERENCE + name: values for name, values in self.reference.items()}}

    def __len__(self) -> int:
        return int(self.time.size)

    def _extent(self) -> str:
        first, last = self.span
        return f"{len(self)} samples, {first:g} to {last:g} s at {self.rate:.3g} Hz"

    @property
    def started(self) -> datetime | None:
        """UTC date and time of the first sample; None where the log has none."""
        first = float(self.time[0])
        if self.date is not None:
            return self.date + timedelta(seconds=first)
        return utc_date(first)

    def __repr__(self) -> str:
        names, more = list(self.signals)[:SHOWN_NAMES], len(self.signals) - SHOWN_NAMES
        listed = ", ".join(names) + (f" and {more} more" if more > 0 else "")
        return f"Record({self.name!r}, {self._extent()}: {listed})"

    def _repr_html_(self) -> str:
        """What a notebook shows: unit, rate, range, missing samples and course of each channel, and the notes."""
        from fifthwheel.base import pages
        from fifthwheel.base.formatting import digits, percent, shown
        from fifthwheel.base.pages.html import course, notebook
        from fifthwheel.base.plots.items import range_without_spikes

        rows = []
        for name, values in self._channels().items():
            present = np.isfinite(values)
            unit = shown(CHANNELS[SignalName.of(split_reference(name)[0]).quantity].unit)
            step = typical_step(self.time[present])
            rate = f"{1 / step:.3g} Hz" if step > 0 else "–"
            ends = [values[present].min(), values[present].max()] if present.any() else [np.nan, np.nan]
            low, high = (digits(float(end) * unit.factor, 3) for end in ends)
            missing = percent(fraction) if (fraction := missing_fraction(self.time, values)) else ""
            rows.append(
                (name, unit.name, rate, low, high, missing, course(self.time, values, range_without_spikes(values)))
            )
        table = pages.Table(("Signal", "Unit", "Rate", "Lowest", "Highest", "Missing", "Course"), rows)
        return notebook(pages.Document(self.name, [pages.Paragraph(self._extent()), table, pages.Items(self.notes)]))

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(Record, **{f.name: getattr(self, f.name) for f in fields(self)}), ()

    def _rows(self, rows: slice, name: str) -> "Record":
        """A part. It shares the memory of the record, unless that would keep more than twice its own."""
        shared = 2 * (rows.stop - rows.start) >= len(self)
        part = rows if shared else np.arange(rows.start, rows.stop)
        signals = {n: v[part] for n, v in self.signals.items()}
        reference = {n: v[part] for n, v in self.reference.items()}
        return replace(self, time=self.time[part], signals=signals, reference=reference, name=name)


def parts_where(record: Record, kept: NDArray[np.bool_], shortest: float = 0.0) -> list[Record]:
    """The parts of a record in which all samples (N,) are kept, of more than `shortest` seconds."""
    spans = [
        (record.time[rows[0]], record.time[rows[-1]])
        for rows in np.split(np.arange(len(kept)), np.flatnonzero(np.diff(kept.astype(int))) + 1)
        if kept[rows[0]]
    ]
    return [record.cut(first, last) for first, last in spans if last - first > shortest]


def segments_above(record: Record, min_speed: float, inputs: Sequence[str] = ("speed",)) -> list[Record]:
    """The segments of a record without time gaps in which the speed stays at `min_speed` (m/s) or above.

    Where one of the inputs is missing for more than `LONGEST_GAP`, a segment ends. A SignalError if there is none.
    """
    gap, interrupted = np.zeros(len(record), dtype=bool), list[str]()
    for name in inputs:
        if np.isfinite(record.signals.get(name, np.nan)).any():
            edges, gaps = record._gaps(name)
            for first, stop in zip(edges[:-1][gaps > LONGEST_GAP], edges[1:][gaps > LONGEST_GAP], strict=True):
                gap[first + (first > 0) : stop + (stop == len(record) - 1)] = True
                interrupted += [name]
    speed = record.input("speed", max_gap=np.inf)
    fast = (speed >= min_speed) & ~gap
    if not (speed >= min_speed).any():
        raise SignalError(
            f"speed: at most {speed.max():.1f} m/s in {record.name}, {min_speed:g} m/s needed for rolling tyres; "
            "check the column and unit of speed in signals.toml, or log a faster run"
        )
    runs = parts_where(record, fast)
    if not runs and interrupted:
        raise SignalError(
            f"{' and '.join(dict.fromkeys(interrupted))}: missing for more than {LONGEST_GAP:g} s again and again in"
            f" {record.name}, so that nothing is left; map a column with more samples"
        )
    if not runs:
        raise SignalError(
            f"speed: never at {min_speed:g} m/s or above for two samples in succession in {record.name}; "
            "map a smoother speed, or log a faster run"
        )
    return [segment for run in runs for segment in run.segments()]


def _factor(name: str, unit: str) -> float:
    """SI units of a signal in one unit."""
    try:
        return factor(unit, si_unit(split_reference(name)[0]) or "1")
    except UnitError as error:
        raise SignalError(f"{name}: {error}") from None


def _frozen(name: str, values: ArrayLike) -> Array:
    try:
        masked = np.ma.getmaskarray(values).any() if isinstance(values, np.ma.MaskedArray) else False
        given = np.ma.filled(np.ma.asarray(values, dtype=np.float64), np.nan) if masked else np.asarray(values)
        array = given if _unchangeable(given) else given.astype(np.float64)
    except (TypeError, ValueError) as error:
        raise SignalError(f"{name}: not numbers; give one number for each sample") from error
    if given.dtype.kind == "c":  # NumPy drops the imaginary part
        raise SignalError(f"{name}: complex numbers; give the part or the magnitude that is the signal")
    if given.dtype.kind in "Mm":
        raise SignalError(f"{name}: dates or durations; give seconds")
    if array.ndim != 1:
        raise SignalError(f"{name}: {array.ndim} dimensions, 1 expected; give one value for each sample")
    array.setflags(write=False)
    return array


def _unchangeable(array: NDArray[Any]) -> bool:
    """Whether a record can share an array: numbers of float64 in succession to which nobody can write."""
    owner = array if array.base is None else array.base
    usable = array.dtype == np.float64 and array.flags.c_contiguous
    return usable and isinstance(owner, np.ndarray) and not owner.flags.writeable
