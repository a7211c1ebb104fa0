"""The columns of a table of another library: a frame of pandas, or any table with the Arrow interface."""

from datetime import datetime
from typing import Any, NamedTuple

import numpy as np

from fifthwheel.base.errors import SignalError, printable
from fifthwheel.base.lazy import require
from fifthwheel.base.types import Array
from fifthwheel.data.record.timestamps import utc_date


class TableColumns(NamedTuple):
    """Numbers of a table, NaN where missing."""

    time: Array  # s
    values: dict[str, Array]  # by the name of the column
    date: datetime | None  # of the first row, if the time is a date


def columns_of(table: Any) -> TableColumns:
    """Time and columns of a table; see `Record.from_table`, also for the errors."""
    if hasattr(table, "index") and hasattr(table, "columns"):
        return _of_pandas(table)
    if hasattr(table, "__arrow_c_stream__"):
        return _of_arrow(table)
    raise SignalError(
        f"table: expected one of pandas, Polars or Arrow, got {type(table).__name__}; use"
        " fw.Record.from_arrays(time, signals)"
    )


def _of_pandas(frame: Any) -> TableColumns:
    """The index is the time."""
    pandas, index, date = require("pandas", "pandas"), frame.index, None
    _require_distinct(list(frame.columns))
    if isinstance(index, pandas.DatetimeIndex):
        utc = index.tz_convert("UTC") if index.tz is not None else index.tz_localize("UTC")
        date = utc[0].to_pydatetime(warn=False) if utc.size else None
        index = utc - utc[:1].repeat(utc.size)
    if isinstance(index, pandas.TimedeltaIndex):
        index = index.total_seconds()
    if isinstance(index, pandas.RangeIndex) or not pandas.api.types.is_numeric_dtype(index):
        raise SignalError("time: expected an index of seconds, durations or dates; use frame.set_index('time')")
    values = {}
    for name in frame.columns:
        try:
            values[name] = np.asarray(frame[name].to_numpy(dtype=np.float64, na_value=np.nan))
        except (TypeError, ValueError) as error:
            raise _not_numbers(name, error) from None
    return TableColumns(index.to_numpy(), values, date)


def _of_arrow(source: Any) -> TableColumns:
    """The column "time" is the time."""
    import pyarrow as pa

    table, date = pa.table(source), None
    _require_distinct(table.column_names)
    if "time" not in table.column_names:
        raise SignalError("time: no such column; rename the one with seconds, durations or dates")
    time, values = table["time"], dict[str, Array]()
    is_date = pa.types.is_timestamp(time.type)
    if is_date or pa.types.is_duration(time.type):
        ticks = time.cast(pa.timestamp("ns") if is_date else pa.duration("ns")).cast(pa.int64()).to_numpy()
        if is_date and ticks.size:
            date, ticks = utc_date(ticks[0] / 1e9), ticks - ticks[0]
        values["time"] = ticks / 1e9
    for name in table.column_names:
        if name not in values:
            try:
                values[name] = table[name].cast(pa.float64()).to_numpy()
            except (pa.ArrowInvalid, pa.ArrowNotImplementedError) as error:
                raise _not_numbers(name, error) from None
    return TableColumns(values.pop("time"), values, date)


def _require_distinct(names: list[Any]) -> None:
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise SignalError(f"{twice}: two columns have this name; remove or rename one")


def _not_numbers(name: object, error: Exception) -> SignalError:
    return SignalError(f"{name}: not numbers ({printable(str(error))}); convert the column, or drop it")
