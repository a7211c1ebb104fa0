"""Files in and out: a log of any known format to a Record, and a Record to CSV or Parquet."""

import os
from collections.abc import Callable
from pathlib import Path

import pyarrow as pa
import pyarrow.csv as pacsv
import pyarrow.parquet as pq

from fifthwheel.errors import SignalError
from fifthwheel.logs.names import REFERENCE, header, split_header
from fifthwheel.logs.record import Record
from fifthwheel.logs.signals import SignalMap
from fifthwheel.logs.table import Table
from fifthwheel.logs.text import read_text


def read(path: str | Path, signals: SignalMap | None = None, *, name: str | None = None) -> Record:
    """The record in a CSV or Parquet file, told apart by content.

    Without a map the columns are taken whose headers are names of signals ("yaw_rate.tractor [deg/s]"), those that
    begin with "reference." apart, on the time in column "time" or "t". Anything that cannot be read is a SignalError;
    what had to be left out stands in the record's notes. The record is called like the file unless `name` says
    otherwise.
    """
    path = Path(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise SignalError(f"{path}: cannot be read ({error.strerror}); check the path") from error
    if not data:
        raise SignalError(f"{path.name}: empty, 0 bytes; the log was never written")
    table = _read_parquet(data, path.name) if data.startswith(b"PAR1") else read_text(data, path.name)
    return (signals or SignalMap.of_headers(table.headers, table.source)).apply(table, name=name or path.stem)


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


def _read_parquet(data: bytes, source: str) -> Table:
    try:
        table = pq.read_table(pa.BufferReader(data), page_checksum_verification=True)
        table.validate(full=True)
        headers = [_header(field) for field in table.schema]
    except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
        raise SignalError(
            f"{source}: a Parquet file cut short or damaged; copy it again, or export it as CSV"
        ) from error
    if not table.num_rows:
        raise SignalError(f"{source}: columns but no rows; the log is empty")
    return Table(source=source, headers=headers, columns=table.columns)


def _header(field: pa.Field) -> str:
    """Name of a column with its unit, which other writers keep in the metadata only."""
    unit = (field.metadata or {}).get(b"unit", b"").decode(errors="replace")
    return field.name if not unit or split_header(field.name)[1] else f"{field.name} [{unit}]"


def _write_csv(table: pa.Table, path: Path) -> None:
    with path.open("wb") as file:
        file.write((",".join(table.column_names) + "\n").encode())
        pacsv.write_csv(table, file, pacsv.WriteOptions(include_header=False))


def _write_parquet(table: pa.Table, path: Path) -> None:
    pq.write_table(table, path, write_page_checksum=True)
