"""The manifest: one row for each trip, in CSV or Parquet."""

import csv
import datetime
import io
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from fifthwheel.apps.fleet import storage
from fifthwheel.base.errors import FifthwheelError, printable, suggestion
from fifthwheel.truck import catalogue

MAX_SIZE = 200_000_000
"""Bytes of a manifest."""
MAX_TRIPS = 1_000_000
"""Rows of a manifest; give more in several manifests."""
MAX_CELL = 1000
"""Characters of a cell."""
COLUMNS = ("log", "truck", "trailer", "vehicle", "signals", "load", "date")
REQUIRED = ("log", "truck", "vehicle")
PATHS = ("log", "vehicle", "signals")


@dataclass(frozen=True, kw_only=True)
class Trip:
    """One trip of one truck, as the manifest describes it."""

    log: str
    """Path of the log."""
    truck: str
    vehicle: str
    """Path of the vehicle file, or a name of the catalogue."""
    trailer: str = ""
    signals: str = ""
    """Path of the signal map; empty if the columns of the log have names of signals."""
    load: str = ""
    """Name of the load: trips with the same truck, trailer and load have the same payload."""
    date: datetime.datetime | None = None
    """Of the trip, UTC; None takes it from the log or the file."""


def read_manifest(path: str) -> list[Trip]:
    """The trips of a manifest. Relative paths are relative to its folder.

    Raises:
        FifthwheelError: the manifest cannot be read, or a cell is not accepted; the message names row and column. The
            first row below the headers is row 1.
    """
    data = storage.read_bytes(storage.checked(path), MAX_SIZE)
    rows = _parquet_rows(path, data) if data.startswith(b"PAR1") else _csv_rows(path, data)
    folder, trips = storage.parent(path), []
    for number, row in enumerate(rows, start=1):
        if number > MAX_TRIPS:
            raise FifthwheelError(f"{path}: more than {MAX_TRIPS} rows; divide it into several manifests")
        trips.append(_trip(path, number, row, folder))
    if not trips:
        raise FifthwheelError(f"{path}: no rows; expected one for each trip")
    return trips


def _trip(path: str, number: int, row: Mapping[str, Any], folder: str) -> Trip:
    values: dict[str, Any] = {}
    for column in COLUMNS:
        given = row.get(column)
        try:
            values[column] = _date(given) if column == "date" else _text(given, required=column in REQUIRED)
            if column in PATHS and values[column]:
                written = storage.checked(values[column])
                named = column == "vehicle" and written in catalogue.names()
                values[column] = written if named else storage.joined(folder, written)
        except FifthwheelError as error:
            raise FifthwheelError(f"{path}: row {number}, column {column}: {error}") from None
    return Trip(**values)


def _text(value: Any, *, required: bool = False) -> str:
    if not isinstance(value, str | None):
        raise FifthwheelError(f"expected a text, got {value!r}")
    text = (value or "").strip()
    if required and not text:
        raise FifthwheelError("empty; expected a value")
    if len(text) > MAX_CELL:
        raise FifthwheelError(f"{len(text)} characters, at most {MAX_CELL} expected")
    if printable(text) != text:
        raise FifthwheelError(f"control characters in {text!r}; remove them")
    return text


def _date(value: Any) -> datetime.datetime | None:
    if isinstance(value, datetime.date) and not isinstance(value, datetime.datetime):
        value = datetime.datetime.combine(value, datetime.time())
    if not isinstance(value, datetime.datetime):
        text = _text(value)
        if not text:
            return None
        try:
            value = datetime.datetime.fromisoformat(text)
        except ValueError:
            raise FifthwheelError(f"expected a date such as 2026-03-01 or 2026-03-01T14:30, got {text!r}") from None
    value = value.replace(tzinfo=value.tzinfo or datetime.UTC)
    if not 1970 <= value.year < 2200:
        raise FifthwheelError(f"expected a year from 1970 to 2199, got {value.year}")
    date: datetime.datetime = value.astimezone(datetime.UTC)
    return date


def _check_columns(path: str, columns: list[str]) -> None:
    if len(set(columns)) < len(columns):
        raise FifthwheelError(f"{path}: two columns have the same name; remove one")
    for column in columns:
        if column not in COLUMNS:
            raise FifthwheelError(f"{path}: column {column}: unknown; {suggestion(column, COLUMNS)}")
    for column in REQUIRED:
        if column not in columns:
            raise FifthwheelError(f"{path}: column {column}: missing; a manifest has {', '.join(COLUMNS)}")


def _csv_rows(path: str, data: bytes) -> Iterator[dict[str, Any]]:
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FifthwheelError(f"{path}: not a text in UTF-8 ({error}); save the manifest as CSV in UTF-8") from None
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    number = 0
    try:
        columns = [column.strip() for column in next(reader, [])]
        _check_columns(path, columns)
        for number, cells in enumerate(reader, start=1):
            if len(cells) > len(columns):
                raise FifthwheelError(f"{path}: row {number}: {len(cells)} cells, expected {len(columns)}")
            yield dict(zip(columns, cells, strict=False))
    except csv.Error as error:
        raise FifthwheelError(f"{path}: row {number + 1}: not CSV ({error}); correct it") from None


def _parquet_rows(path: str, data: bytes) -> Iterator[dict[str, Any]]:
    try:
        file = pq.ParquetFile(pa.BufferReader(data))
        _check_columns(path, list(file.schema_arrow.names))
        for batch in file.iter_batches(1000):
            batch.validate(full=True)
            yield from batch.to_pylist()
    except FifthwheelError:
        raise
    except (pa.ArrowException, OSError, ValueError, OverflowError) as error:
        raise FifthwheelError(f"{path}: a damaged Parquet file ({error}); write it again") from None
