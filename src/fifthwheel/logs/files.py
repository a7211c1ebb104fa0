"""Files in and out: a log of any known format to a Record, and a Record to CSV or Parquet."""

import os
from collections.abc import Callable, Iterable
from pathlib import Path

import pyarrow as pa
import pyarrow.csv as pacsv
import pyarrow.parquet as pq

from fifthwheel.errors import SignalError
from fifthwheel.logs.assemble import assemble
from fifthwheel.logs.log import Progress, quiet
from fifthwheel.logs.names import REFERENCE, header, split_header
from fifthwheel.logs.readers import open_log
from fifthwheel.logs.record import Record
from fifthwheel.logs.signals import SignalMap


def read(
    path: str | Path, signals: SignalMap | None = None, *, name: str | None = None, progress: Progress = quiet
) -> Record:
    """The record in a log of any format that is told apart by content: CSV, Parquet, MF4, MATLAB, MCAP, CAN traces.

    The map says which column is which signal; besides, or without one, the columns are taken whose headers are names
    of signals ("yaw_rate.tractor [deg/s]"), those that begin with "reference." apart, on the time in column "time" or
    "t" or on the file's own stamps. Anything that cannot be read is a SignalError; what had to be left out stands in
    the record's notes. The record is called like the file unless `name` says otherwise. `progress` is told the share
    of the file that is read.
    """
    path = Path(path)
    asked = signals or SignalMap()
    with open_log(path, asked.databases, progress) as log:
        wanted = asked.completed(log.columns)
        if not wanted.signals and not wanted.reference:
            raise SignalError(
                f"{log.name}: no column has the name of a signal, there is {_listed(log.columns)}; write a "
                f"signals.toml that says which column is which, or let `fifthwheel signals` propose one:\n"
                f'[signals."yaw_rate.tractor"]\ncolumn = "..."\nunit = "deg/s"'
            )
        return assemble(log, wanted, name=name or path.stem, progress=progress)


def _listed(names: Iterable[str], most: int = 40) -> str:
    given = list(names)
    return ", ".join(given[:most]) + (f" and {len(given) - most} more" if len(given) > most else "")


def write(record: Record, path: str | Path) -> None:
    """Write a record as .csv or .parquet, in SI with the units in the headers; read() gives it back equal.

    The file appears whole or not at all. Notes are not written.
    """
    path = Path(path)
    columns = {"time": record.time, **record.signals, **{REFERENCE + n: v for n, v in record.reference.items()}}
    headers = [header(name) for name in columns]
    fields = [pa.field(h, pa.float64(), metadata={"unit": split_header(h)[1] or ""}) for h in headers]
    table = pa.table([pa.array(values, from_pandas=True) for values in columns.values()], schema=pa.schema(fields))
    write_table = writer(path)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        write_table(table, temporary)
        os.replace(temporary, path)
    except OSError as error:
        raise SignalError(f"{path}: cannot be written ({error.strerror or error}); check the folder") from error
    finally:
        temporary.unlink(missing_ok=True)


def writer(path: Path) -> Callable[[pa.Table, Path], None]:
    """What writes a file of such a name; a SignalError if nothing does."""
    writers: dict[str, Callable[[pa.Table, Path], None]] = {".csv": _write_csv, ".parquet": _write_parquet}
    if path.suffix.lower() not in writers:
        raise SignalError(f"{path.name}: no format for {path.suffix!r}; end the name in {' or '.join(writers)}")
    return writers[path.suffix.lower()]


def _write_csv(table: pa.Table, path: Path) -> None:
    with path.open("wb") as file:
        file.write((",".join(table.column_names) + "\n").encode())
        pacsv.write_csv(table, file, pacsv.WriteOptions(include_header=False))


def _write_parquet(table: pa.Table, path: Path) -> None:
    pq.write_table(table, path, write_page_checksum=True)
