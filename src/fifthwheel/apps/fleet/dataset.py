"""The data set of a fleet: a folder, or a prefix of an object store, of Parquet tables.

    trips/           rows of all trips ever processed: one file each as they end ("trip-..."), joined later ("part-...")
    trips.parquet    the trips that count, without their numbers
    trucks.parquet, trailers.parquet, history.parquet, changes.parquet
    fleet.json       settings of the run, and the digests of the tables that belong to it

A row in trips/ is a result that another run uses if all that it depends on is the same (`trips.process_trip`). The last
run decides which of them count; a log never counts twice.
"""

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from fifthwheel.apps.fleet import storage
from fifthwheel.apps.fleet.trips import SCHEMA, parquet
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.input_files import MAX_JSON_SIZE

ROWS = 1000
"""Rows of a part."""
MAX_FILE = 2_000_000_000
"""Bytes of a table."""
BATCH = 500
"""Trips that are combined at a time: this bounds the memory of a worker."""
KEYS = (
    *("log", "truck", "trailer", "load", "date", "error", "notes", "digest", "log_digest", "settings", "finished"),
    *("seconds", "duration", "doubts"),
)
"""Columns of trips.parquet."""
_OTHER_SETTINGS = "processed with other settings than the last run; list it in the manifest and run again"


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

    def known(self) -> tuple[Any, dict[str, str]]:
        """Sorted digests of the trips with a result, an array of bytes; and the errors of the others by digest."""
        good, failed = list[bytes](), dict[str, str]()
        for table in self._tables(("digest", "error")):
            for digest, error in zip(table["digest"].to_pylist(), table["error"].to_pylist(), strict=True):
                if error and digest:
                    failed[digest] = error
                elif digest:
                    good.append(digest.encode())
        return np.array(sorted(good), dtype="S64"), failed

    def counting(self, listed: Mapping[str, str], settings: str) -> pa.Table:
        """The rows of trips that count after a run, in the order of truck and date.

        Of a log that another run listed that of this run; of a log that no finished run listed the last one. Left out
        are logs with the same samples as a later one, and failed trips that are not listed and have no log.

        Args:
            listed: digests of the trips of this run by log.
            settings: digest of its settings; trips that are not listed and have others count as failed.
        """
        every = pa.concat_tables([SCHEMA.empty_table().select(KEYS), *self._tables(KEYS)]).sort_by("finished")
        log, error, digest, samples, settings_of = (
            every[name].to_pylist() for name in ("log", "error", "digest", "log_digest", "settings")
        )
        place = {each: k for k, each in enumerate(digest)}
        wanted = dict(zip(log, digest, strict=True)) | self._counting_before() | dict(listed)
        order = (*sorted(wanted.keys() - listed.keys()), *listed)
        rows = {name: place[wanted[name]] for name in order if wanted[name] in place}
        errors = {
            name: error[k] or (_OTHER_SETTINGS if name not in listed and settings_of[k] != settings else "")
            for name, k in rows.items()
        }
        good = {samples[k]: name for name, k in rows.items() if not errors[name]}
        kept = [
            name
            for name, k in rows.items()
            if good.get(samples[k]) == name
            or (errors[name] and (name in listed or (samples[k] and samples[k] not in good)))
        ]
        table = every.take(pa.array([rows[name] for name in kept], pa.int64()))
        for column, values in (("log", kept), ("error", [errors[name] for name in kept])):
            table = table.set_column(KEYS.index(column), column, pa.array(values, pa.string()))
        return table.sort_by([(column, "ascending") for column in ("truck", "date", "log")])

    def _counting_before(self) -> dict[str, str]:
        """Digests of the trips that counted after the last run, by log."""
        if "trips.parquet" not in storage.names(self.path, ".parquet"):
            return {}
        table = _read(self.file("trips.parquet"), ("log", "digest"))
        return dict(zip(table["log"].to_pylist(), table["digest"].to_pylist(), strict=True))

    def trips(self, digests: Iterable[str]) -> list[dict[str, Any]]:
        """Complete rows by their digests, in any order."""
        wanted = pa.array(list(digests), pa.string())
        rows = []
        for name in storage.names(self.folder, ".parquet"):
            path = storage.joined(self.folder, name)
            with _opened(path) as file:
                found = pc.is_in(file.read(["digest"])["digest"], wanted)
                if pc.any(found).as_py():
                    groups = _groups(file, found)
                    part = file.read_row_groups(groups)
                    rows += part.filter(pc.is_in(part["digest"], wanted)).to_pylist()
        return rows

    def join(self) -> None:
        """Join the rows of single trips to parts; may be interrupted at any time."""
        single = [n for n in storage.names(self.folder, ".parquet") if n.startswith("trip-")]
        for begin in range(0, len(single), ROWS):
            names = single[begin : begin + ROWS]
            paths = [storage.joined(self.folder, name) for name in names]
            table = pa.concat_tables(map(_read, paths)).sort_by("truck")
            key = hashlib.sha256("".join(names).encode() + str(table["finished"].to_pylist()).encode()).hexdigest()
            storage.write_bytes(storage.joined(self.folder, f"part-{key[:40]}.parquet"), parquet(table))
            for path in paths:
                storage.remove(path)

    def write(self, tables: Mapping[str, pa.Table], settings: Mapping[str, Any]) -> None:
        """Replace all tables and the settings that they belong to; `read` refuses those that a killed run has mixed."""
        files = {name: parquet(table) for name, table in tables.items()}
        for name, data in files.items():
            storage.write_bytes(self.file(f"{name}.parquet"), data)
        digests = {name: hashlib.sha256(data).hexdigest() for name, data in files.items()}
        text = json.dumps({**settings, "tables": digests}, indent=2) + "\n"
        storage.write_bytes(self.file("fleet.json"), text.encode())

    def read(self, names: Iterable[str]) -> tuple[dict[str, Any], dict[str, list[dict[str, Any]]]]:
        """The settings of the last run and the rows of some tables.

        Raises:
            FifthwheelError: there are none, they are damaged, or they do not belong together.
        """
        path = self.file("fleet.json")
        with _of_a_run():
            text = storage.read_bytes(path, MAX_JSON_SIZE)
        try:
            content = json.loads(text)
            digests = {name: str(content["tables"][name]) for name in names}
        except (ValueError, KeyError, TypeError) as error:
            raise FifthwheelError(f"{path}: not of a fleet of this version ({error}); run the fleet again") from None
        with _of_a_run():
            tables = {name: _read(self.file(f"{name}.parquet"), digest=digests[name]) for name in digests}
        return content, {name: table.to_pylist() for name, table in tables.items()}

    def _tables(self, columns: Sequence[str]) -> Iterator[pa.Table]:
        for name in storage.names(self.folder, ".parquet"):
            yield _read(storage.joined(self.folder, name), columns)


TruckTrips = list[tuple[str, dict[str, str]]]
"""Trucks with the logs of their trips by digest."""


def batches(trips: pa.Table) -> Iterator[TruckTrips]:
    """All trips without error, about `BATCH` at a time."""
    trucks: dict[str, dict[str, str]] = {}
    for truck, digest, log, error in zip(
        *(trips[c].to_pylist() for c in ("truck", "digest", "log", "error")), strict=True
    ):
        if not error:
            trucks.setdefault(truck, {})[digest] = log
    batch, count = TruckTrips(), 0
    for truck, digests in trucks.items():
        batch.append((truck, digests))
        count += len(digests)
        if count >= BATCH:
            yield batch
            batch, count = [], 0
    if batch:
        yield batch


def _groups(file: pq.ParquetFile, found: Any) -> list[int]:
    ends = np.cumsum([file.metadata.row_group(k).num_rows for k in range(file.metadata.num_row_groups)])
    return [k for k, flags in enumerate(np.split(found.to_numpy(), ends[:-1])) if flags.any()]


@contextmanager
def _of_a_run() -> Iterator[None]:
    """Errors of a missing file with the cure."""
    try:
        yield
    except FifthwheelError as error:
        raise FifthwheelError(f"{error}; give the data set that `fifthwheel fleet run --out` wrote") from None


@contextmanager
def _opened(path: str, digest: str | None = None) -> Iterator[pq.ParquetFile]:
    """A table of Parquet with this digest, or any; its errors name the path."""
    data = storage.read_bytes(path, MAX_FILE)
    if digest not in (None, hashlib.sha256(data).hexdigest()):
        raise FifthwheelError(
            f"{path}: not of the run of fleet.json, because a run was killed or replaces the tables now; run the fleet "
            "again"
        )
    try:
        with pq.ParquetFile(pa.BufferReader(data), page_checksum_verification=True) as file:
            yield file
    except (pa.ArrowException, OSError, KeyError) as error:
        raise FifthwheelError(f"{path}: damaged ({error}); remove it and list its trips in a manifest again") from None


def _read(path: str, columns: Sequence[str] | None = None, *, digest: str | None = None) -> pa.Table:
    with _opened(path, digest) as file:
        return file.read(columns)
