"""Read a log file of any supported format into a Record; write a Record as CSV or Parquet."""

import os
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import pyarrow as pa
import pyarrow.csv as pacsv
import pyarrow.parquet as pq

from fifthwheel.base.arguments import expect, expect_optional
from fifthwheel.base.atomic import atomic_write
from fifthwheel.base.errors import SignalError, printable
from fifthwheel.base.spelling import command
from fifthwheel.data.channels import REFERENCE, header, split_header, split_reference
from fifthwheel.data.logs.assemble import Window, assemble
from fifthwheel.data.logs.readers import open_log
from fifthwheel.data.logs.signal_map import SignalMap
from fifthwheel.data.logs.source import LogSource, ReadProgress, no_progress
from fifthwheel.data.record.record import Record

_LISTED_COLUMNS = 40


def read_log(
    path: str | Path,
    signals: SignalMap | None = None,
    *,
    name: str | None = None,
    exclude: Sequence[Window] = (),
    progress: ReadProgress = no_progress,
) -> Record:
    """The record in a log file: CSV, Excel, Parquet, MF4, MATLAB, TDMS, MCAP, ULog or a CAN trace.

    The content of the file identifies the format.
    Columns whose headers are names of signals ("yaw_rate.tractor [deg/s]") need no map; those that begin with
    "reference." become reference signals. The time is that of the file, or the column "time" or "t" of a table.
    Samples that were left out are listed in the record's notes.

    Args:
        path: the file.
        signals: map from columns to signals, for columns with other names.
        name: of the record; default: the file's name without its ending.
        exclude: windows by the timestamps of the log, first and last instant, s, whose samples are left out.
        progress: receives the fraction of the file that has been read.

    Raises:
        SignalError: the file cannot be read, or holds no signal.

    Example:
        >>> import fifthwheel as fw
        >>> signal_map = fw.SignalMap.load("signals.toml")  # doctest: +SKIP
        >>> fw.read_log("run.mf4", signal_map)  # doctest: +SKIP
        Record('run', 6000 samples, 0 to 59.99 s at 100 Hz: speed, steer.tractor.front, yaw_rate.tractor)
    """
    expect("path", path, str, os.PathLike)
    expect_optional("signals", signals, SignalMap)
    path = Path(path)
    with open_log(path, signals.databases if signals else (), progress) as log:
        return record_of(log, signals, name=name or path.stem, exclude=exclude, progress=progress)


def record_of(
    log: LogSource,
    signals: SignalMap | None = None,
    *,
    name: str,
    exclude: Sequence[Window] = (),
    progress: ReadProgress = no_progress,
) -> Record:
    """The record in an open log; arguments and errors as in `read_log`."""
    complete = (signals or SignalMap()).completed(log.columns)
    if not complete.signals and not complete.reference:
        more = len(log.columns) - _LISTED_COLUMNS
        names = ", ".join(list(log.columns)[:_LISTED_COLUMNS]) + (f" and {more} more" if more > 0 else "")
        raise SignalError(
            f"{log.name}: no column has the name of a signal, the columns are {names}; map columns to "
            f"signals in a signals.toml, which {command('signals')} proposes:\n"
            f'[signals.speed]\ncolumn = "..."\nunit = "km/h"'
        )
    return assemble(log, complete, name=printable(name), exclude=exclude, progress=progress)


def write_record(record: Record, path: str | Path) -> None:
    """Write a record as .csv or .parquet, in SI with the units in the headers; `read_log` returns an equal record.

    The file is written atomically. Notes are not written; time bases and sensors are written to Parquet only.

    Raises:
        SignalError: the ending is another one, or the file cannot be written.

    Example:
        >>> import tempfile
        >>> import fifthwheel as fw
        >>> record = fw.simulate(fw.vehicle("cheng_cebon_2011"), count=1)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     fw.write_record(record, f"{folder}/run.parquet")
        ...     fw.read_log(f"{folder}/run.parquet") == record
        True
    """
    expect("record", record, Record)
    path = Path(path)
    columns = {"time": record.time, **record.signals, **{REFERENCE + n: v for n, v in record.reference.items()}}
    headers = [header(name) for name in columns]
    fields = []
    for name, text in zip(columns, headers, strict=True):
        metadata = {"unit": split_header(text)[1] or ""}
        if base := record.time_bases.get(split_reference(name)[0]):
            metadata["time_base"] = base
        if sensor := record.sensors.get(name):
            metadata["sensor"] = sensor.dumps()
        fields.append(pa.field(text, pa.float64(), metadata=metadata))
    table = pa.table([pa.array(values, from_pandas=True) for values in columns.values()], schema=pa.schema(fields))
    write_table = record_writer(path)
    try:
        with atomic_write(path) as temporary:
            write_table(table, temporary)
    except OSError as error:
        raise SignalError(
            f"{path}: cannot be written ({error.strerror or error}); check the folder and its permissions"
        ) from error


def record_writer(path: Path) -> Callable[[pa.Table, Path], None]:
    """The function that writes a file with the ending of `path`; a SignalError for an unknown ending."""
    write_parquet = partial(pq.write_table, write_page_checksum=True)
    writers: dict[str, Callable[[pa.Table, Path], None]] = {".csv": _write_csv, ".parquet": write_parquet}
    if path.suffix.lower() not in writers:
        raise SignalError(f"{path.name}: no format for {path.suffix!r}; end the name in {' or '.join(writers)}")
    return writers[path.suffix.lower()]


def _write_csv(table: pa.Table, path: Path) -> None:
    with path.open("wb") as file:
        file.write((",".join(table.column_names) + "\n").encode())
        pacsv.write_csv(table, file, pacsv.WriteOptions(include_header=False))
