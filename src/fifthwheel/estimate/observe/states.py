"""States of a record with their sigmas and status."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fifthwheel.base.atomic import atomic_write
from fifthwheel.base.errors import SignalError, suggestion
from fifthwheel.base.formatting import percent, shown
from fifthwheel.base.lazy import require
from fifthwheel.base.plots import Axis, Band, Guide, Item, Line, Panel, Plot, Span, downsample
from fifthwheel.base.plots.items import BLUE, GREY, ORANGE, PURPLE, VERMILLION, trimmed, visible_range
from fifthwheel.base.types import Array, ComparedByContents
from fifthwheel.data.channels import LOAD_TRANSFER, PREDICTED_LOAD_TRANSFER, SignalName, is_of, names_of, si_unit
from fifthwheel.data.channels.table import HORIZON
from fifthwheel.data.record import Record
from fifthwheel.estimate.stream import Status

if TYPE_CHECKING:
    import pandas as pd


LIFT_LIMIT = 0.9
"""Load transfer ratio of an axle group half a second before its first axle lifts; it is 0.85 to 0.97."""
LARGEST_SIGMA = 0.2
"""Of a predicted ratio, in a warning: an observer that knows less, as after its start, does not warn for that."""
ROW_GROUP = 32_768
"""Rows that are compressed at a time when states are written."""
LIFT_SAMPLES = 3
"""Consecutive samples that must warn: a single wrong steer angle is no manoeuvre."""


SHADES = {
    Status.COASTING: (ORANGE, 0.25),
    Status.TOO_SLOW: ("#000000", 0.10),
    Status.INPUT_MISSING: (PURPLE, 0.30),
    Status.INCONSISTENT: (VERMILLION, 0.25),
    Status.SETTLING: (ORANGE, 0.12),
}
"""Colour and opacity of intervals by their status."""


def time_to_lift(values: Mapping[str, Any]) -> Any:
    """Time until a wheel lifts at the present steer angles and speed, s; infinite beyond `HORIZON`, NaN if unknown.

    An axle group has lifted where the magnitude of its load transfer ratio and one sigma of the predicted ratio reach
    `LIFT_LIMIT`; the time is then 0. From the present ratio to the predicted one the magnitude is taken to rise
    linearly. The time is unknown where a ratio is unknown, and without roll, which has no ratios.

    Args:
        values: states by name with "<state>.sigma", such as the answer of `Observer.push`; numbers or arrays (N,).

    Raises:
        SignalError: a predicted ratio without its sigma or without the present ratio.

    Example:
        >>> import fifthwheel as fw
        >>> ratios = {"load_transfer.semitrailer": 0.5, "predicted_load_transfer.semitrailer": 0.93}
        >>> round(float(fw.time_to_lift({**ratios, "predicted_load_transfer.semitrailer.sigma": 0.06})), 3)
        0.474
    """
    predicted = [name for name in names_of(PREDICTED_LOAD_TRANSFER, values) if not name.endswith(".sigma")]
    first: Any = np.float64(np.inf)
    unknown: Any = np.bool_(not predicted)
    for name in predicted:
        present, sigma = f"{LOAD_TRANSFER.quantity}.{SignalName.of(name).place}", f"{name}.sigma"
        for needed in (present, sigma):
            if needed not in values:
                raise SignalError(f"{needed}: needed beside {name}; give all states with their sigmas")
        now, later = np.abs(values[present]), np.abs(values[name])
        limit = LIFT_LIMIT - np.minimum(values[sigma], LARGEST_SIGMA)
        time = HORIZON * np.clip((limit - now) / np.maximum(later - now, 1e-9), 0.0, 1.0)
        first = np.minimum(first, np.where(np.maximum(now, later) >= limit, time, np.inf))
        unknown = unknown | np.isnan(later)
    return np.where(unknown & np.isinf(first), np.nan, first)[()]


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class States(ComparedByContents):
    """States of a record of N samples.

    Example:
        >>> import fifthwheel as fw
        >>> truck = fw.vehicle("cheng_cebon_2011")
        >>> record = fw.simulate(truck, count=1)
        >>> states = fw.Observer(truck, record.signals).batch(record)
        >>> bool(states.lift_warning.any())
        False
        >>> states.to_pandas()[["sideslip.semitrailer", "sideslip.semitrailer.sigma"]].shape
        (800, 2)
    """

    name: str
    time: Array  # (N,) s
    values: Mapping[str, Array]  # by signal, (N,) each, SI
    sigma: Mapping[str, Array]  # standard deviation, (N,) each
    status: NDArray[np.int8]  # (N,) `Status`
    nis: Array  # (N,) health: normalised innovation squared, averaged over channels and time; 1 is expected
    innovation: Mapping[str, Array]  # by measured signal, measurement less prediction, (N,), NaN where missing
    innovation_sigma: Mapping[str, Array]  # standard deviation, (N,) each
    accepted: Mapping[str, NDArray[np.bool_]]  # (N,) each, False where missing or outside the gate

    @property
    def time_to_lift(self) -> Array:
        """(N,) s; see the function `time_to_lift`."""
        sigmas = {f"{name}.sigma": self.sigma[name] for name in self.values if is_of(name, PREDICTED_LOAD_TRANSFER)}
        return np.broadcast_to(time_to_lift({**self.values, **sigmas}), self.time.shape)

    @property
    def lift_warning(self) -> NDArray[np.bool_]:
        """Samples (N,) at which a wheel lifts within `HORIZON`, as at the `LIFT_SAMPLES` - 1 samples before.

        There is none where `time_to_lift` is unknown.
        """
        warns = np.isfinite(self.time_to_lift)
        before = np.concatenate([np.zeros(LIFT_SAMPLES - 1, dtype=bool), warns])
        return np.asarray(np.lib.stride_tricks.sliding_window_view(before, LIFT_SAMPLES).all(axis=1))

    def to_pandas(self) -> "pd.DataFrame":
        """States in SI over the time in s, each with "<state>.sigma", "status" (`Status`) and "nis".

        Raises:
            FifthwheelError: pandas is not installed.
        """
        pandas = require("pandas", "pandas")
        frame: pd.DataFrame = pandas.DataFrame(self._columns(), index=pandas.Index(self.time, name="time"))
        return frame

    def plot(self, *names: str, record: Record | None = None) -> Plot:
        """States over time with a band of two sigma; times without valid states are grey, and load transfer ratios are
        red while a wheel is about to lift.

        Args:
            names: states, such as "sideslip.semitrailer"; all by default.
            record: its signals and reference signals of the same names are drawn too.

        Raises:
            SignalError: there is no such state.
        """
        for name in names:
            if name not in self.values:
                raise SignalError(f"{name}: not among the states; {suggestion(name, self.values)}")
        invalid = self._spans(~np.isin(self.status, (Status.OK, Status.COASTING)), GREY)
        lifting = [*self._spans(self.lift_warning, VERMILLION), *(Guide(y=y) for y in (-LIFT_LIMIT, LIFT_LIMIT))]
        ratios = (LOAD_TRANSFER, PREDICTED_LOAD_TRANSFER)
        panels = [
            self.panel(name, record, [*invalid, *(lifting if is_of(name, *ratios) else ())])
            for name in names or self.values
        ]
        return Plot(panels=panels, title=self.name)

    def panel(self, name: str, record: Record | None = None, marks: Sequence[Item] = ()) -> Panel:
        """A state with a band of two sigma, its measurement and its reference where the record has them.

        Args:
            marks: drawn first, such as those of `status_spans`.
        """
        unit = shown(si_unit(name))
        values, sigma = self.values[name] * unit.factor, self.sigma[name] * unit.factor
        lower, upper = values - 2 * sigma, values + 2 * sigma
        items, visible = list(marks), [values, trimmed(lower, 0.05), trimmed(upper, 0.05)]
        if record is not None and name in record.signals:
            measured = record.signals[name] * unit.factor
            items.append(Line(record.time, measured, name="measured", colour="#b8b8b8", width=1, gaps=True))
            visible.append(trimmed(measured, 0.01))
        items.append(Band(self.time, lower, upper, name="± 2 sigma", colour=BLUE, gaps=True))
        items.append(Line(self.time, values, name="estimate", colour=BLUE, gaps=True))
        if record is not None and name in record.reference:
            reference = record.reference[name] * unit.factor
            items.append(Line(record.time, reference, name="reference", colour=VERMILLION, dash="dash", gaps=True))
            visible.append(reference)
        y = Axis(unit=unit.name, range=visible_range(*visible))
        return Panel(items=items, title=name, x=Axis(label="time", unit="s"), y=y)

    def status_spans(self) -> list[Span]:
        """Intervals in which the states are not OK, in the colours of `SHADES`."""
        return [
            span
            for status, (colour, opacity) in SHADES.items()
            for span in self._spans(self.status == status, colour, opacity)
        ]

    def _spans(self, marked: NDArray[np.bool_], colour: str, opacity: float = 0.15) -> list[Span]:
        """The times of marked samples (N,); those that are closer than about a pixel are joined."""
        ends, pixel = np.append(self.time[1:], self.time[-1]), (self.time[-1] - self.time[0]) / 1000
        spans: list[Span] = []
        for first, last in downsample.runs(marked):
            start, stop = float(self.time[first]), float(ends[last])
            if spans and start - spans[-1].stop < pixel:
                start = spans.pop().start
            spans.append(Span(start, stop, colour=colour, opacity=opacity))
        return spans

    def _columns(self) -> dict[str, NDArray[Any]]:
        """States, their sigmas, status and nis by name."""
        sigma = {f"{name}.sigma": values for name, values in self.sigma.items()}
        return {**self.values, **sigma, "status": self.status, "nis": self.nis}

    def __repr__(self) -> str:
        quantities = ", ".join(dict.fromkeys(SignalName.of(name).quantity for name in self.values))
        ok = percent(float((self.status == Status.OK).mean()), round_down=True).replace(".0", "")
        return f"States({self.name!r}, {len(self.time)} samples, {ok} OK: {quantities})"


def write_states(states: Sequence[States], path: Path) -> None:
    """Write states to a Parquet file: log, time, states in SI, their sigmas as "<state>.sigma", status and nis.

    Raises:
        OSError: the file cannot be written.
    """
    import pyarrow as pa
    from pyarrow import parquet

    tables = []
    for record in states:
        columns = {"time": record.time, **record._columns()}
        arrays = {name: _arrow(values) for name, values in columns.items()}
        name = record.name.encode()
        offsets = pa.py_buffer(np.array([0, len(name)], dtype=np.int32))
        names = pa.StringArray.from_buffers(1, offsets, pa.py_buffer(name))
        arrays["log"] = pa.DictionaryArray.from_arrays(_arrow(np.zeros(len(record.time), dtype=np.int32)), names)
        tables.append(pa.table(arrays))
    with atomic_write(path) as temporary:
        table = pa.concat_tables(tables, promote_options="permissive").unify_dictionaries()
        parquet.write_table(table, temporary, row_group_size=ROW_GROUP)


def _arrow(values: NDArray[Any]) -> Any:
    """Values (N,) as an array of Arrow. The conversion of objects of Python would import pandas."""
    import pyarrow as pa

    buffer = pa.py_buffer(np.ascontiguousarray(values))
    return pa.Array.from_buffers(pa.from_numpy_dtype(values.dtype), len(values), [None, buffer])
