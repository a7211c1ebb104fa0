"""The data set of a fleet: a folder, or a prefix of an object store, of Parquet tables.

    trips/           rows of trips: one file each as they end ("trip-..."), joined later ("part-...")
    trucks.parquet, trailers.parquet, history.parquet, changes.parquet
    fleet.json       settings of the run

Trips are only added. A log that has been processed again, with another vehicle file, settings or version, has several
rows, of which the last counts; so a log never counts twice.
"""

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from fifthwheel.errors import FifthwheelError
from fifthwheel.fleet import storage
from fifthwheel.fleet.trips import SCHEMA, write_table
from fifthwheel.input_files import MAX_JSON_SIZE

ROWS = 1000
"""Rows of a part."""
MAX_FILE = 2_000_000_000
"""Bytes of a table."""
BATCH = 500
"""Trips that are combined at a time: this bounds the memory of a worker."""
_KEYS = (
    *("log", "truck", "trailer", "load", "date", "error", "notes", "digest", "log_digest", "finished"),
    *("seconds", "duration", "doubts"),
)


@dataclass(frozen=True)
class TripDataset:
    """The data set at a path."""

    path: str

    @property
    def folder(self) -> str:
        """Of the rows of trips."""
        return storage.joined(self.path, "trips")

    def file(self, name: str) -> str:
        """The path of a file."""
        return storage.joined(self.path, name)

    def digests(self) -> Any:
        """Sorted digests of all rows, an array of bytes."""
        found = [d.encode() for table in self._tables(("digest",)) for d in table["digest"].to_pylist() if d]
        return np.array(sorted(found), dtype="S64")

    def index(self) -> pa.Table:
        """The rows that count, without their numbers, in the order of truck and date."""
        # tables of an older version have fewer columns
        tables = [SCHEMA.empty_table().select(_KEYS), *self._tables(_KEYS)]
        every = pa.concat_tables(tables, promote_options="default").sort_by("finished")
        last_of_log = {log: k for k, log in enumerate(every["log"].to_pylist())}
        contents = every["log_digest"].to_pylist()
        last_of_content = {contents[k] or f"row {k}": k for k in sorted(last_of_log.values())}
        last = pa.array(sorted(last_of_content.values()), pa.int64())
        return every.take(last).sort_by([("truck", "ascending"), ("date", "ascending")])

    def trips(self, digests: Iterable[str]) -> list[dict[str, Any]]:
        """Complete rows by their digests, in any order."""
        wanted = pa.array(list(digests), pa.string())
        rows = []
        for name in storage.names(self.folder, ".parquet"):
            path = storage.joined(self.folder, name)
            with _opened(path) as file:
                found = pa.compute.is_in(file.read(["digest"])["digest"], wanted)
                if pa.compute.any(found).as_py():
                    groups = _groups(file, found)
                    part = file.read_row_groups(groups)
                    rows += part.filter(pa.compute.is_in(part["digest"], wanted)).to_pylist()
        return rows

    def join(self) -> None:
        """Join the rows of single trips to parts; may be interrupted at any time."""
        single = [n for n in storage.names(self.folder, ".parquet") if n.startswith("trip-")]
        for begin in range(0, len(single), ROWS):
            names = single[begin : begin + ROWS]
            paths = [storage.joined(self.folder, name) for name in names]
            table = pa.concat_tables([_read(path) for path in paths], promote_options="default").sort_by("truck")
            key = hashlib.sha256("".join(names).encode() + str(table["finished"].to_pylist()).encode()).hexdigest()
            write_table(storage.joined(self.folder, f"part-{key[:40]}.parquet"), table)
            for path in paths:
                storage.remove(path)

    def write(self, name: str, rows: Sequence[Mapping[str, Any]], schema: pa.Schema) -> None:
        """Replace a table; its rows in the order of the labels."""
        table = pa.Table.from_pylist([dict(row) for row in rows], schema=schema)
        order = [(c, "ascending") for c in ("truck", "trailer", "load", "parameter", "date") if c in schema.names]
        write_table(self.file(f"{name}.parquet"), table.sort_by(order))

    def table(self, name: str) -> pa.Table:
        """A table that `write` wrote; FifthwheelError if there is none, or it is damaged."""
        with _of_a_run():
            return _read(self.file(f"{name}.parquet"))

    def write_settings(self, settings: Mapping[str, Any]) -> None:
        """Replace the settings."""
        storage.write_bytes(self.file("fleet.json"), (json.dumps(settings, indent=2) + "\n").encode())

    def settings(self) -> dict[str, Any]:
        """The settings of the last run; FifthwheelError if there are none."""
        with _of_a_run():
            text = storage.read_bytes(self.file("fleet.json"), MAX_JSON_SIZE)
        try:
            content = json.loads(text)
        except ValueError as error:
            raise FifthwheelError(f"{self.file('fleet.json')}: not JSON ({error}); run the fleet again") from None
        if not isinstance(content, dict):
            raise FifthwheelError(f"{self.file('fleet.json')}: not of a fleet; run the fleet again")
        return content

    def _tables(self, columns: Sequence[str]) -> Iterator[pa.Table]:
        for name in storage.names(self.folder, ".parquet"):
            yield _read(storage.joined(self.folder, name), columns)


def batches(index: pa.Table) -> Iterator[list[tuple[str, list[str]]]]:
    """Trucks with the digests of their trips without error, about `BATCH` trips at a time."""
    trucks: dict[str, list[str]] = {}
    for truck, digest, error in zip(*(index[c].to_pylist() for c in ("truck", "digest", "error")), strict=True):
        if not error:
            trucks.setdefault(truck, []).append(digest)
    batch, count = list[tuple[str, list[str]]](), 0
    for truck, digests in trucks.items():
        batch.append((truck, digests))
        count += len(digests)
        if count >= BATCH:
            yield batch
            batch, count = [], 0
    if batch:
        yield batch


def _groups(file: pq.ParquetFile, found: Any) -> list[int]:
    """The row groups with at least one of the found rows."""
    flags, groups, row = found.to_numpy(), [], 0
    for k in range(file.metadata.num_row_groups):
        count = file.metadata.row_group(k).num_rows
        if flags[row : row + count].any():
            groups.append(k)
        row += count
    return groups


@contextmanager
def _of_a_run() -> Iterator[None]:
    """Errors of a missing file with the cure."""
    try:
        yield
    except FifthwheelError as error:
        raise FifthwheelError(f"{error}; give the data set that `fifthwheel fleet run --out` wrote") from None


@contextmanager
def _opened(path: str) -> Iterator[pq.ParquetFile]:
    """A table of Parquet; its errors name the path."""
    try:
        buffer = pa.BufferReader(storage.read_bytes(path, MAX_FILE))
        with pq.ParquetFile(buffer, page_checksum_verification=True) as file:
            yield file
    except (pa.ArrowException, OSError, KeyError) as error:
        raise FifthwheelError(f"{path}: damaged ({error}); remove it, its trips are then processed again") from None


def _read(path: str, columns: Sequence[str] | None = None) -> pa.Table:
    with _opened(path) as file:
        return file.read(None if columns is None else list(columns))
