"""One trip: read once, identified, and kept as a row of numbers that later combinations need.

A row is written by the worker itself, as a file of its own in the data set: what has ended is never lost, and the
scheduler carries no numbers.
"""

import datetime
import hashlib
import importlib.metadata
import io
import json
import os
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from fifthwheel import __version__
from fifthwheel.apps.fleet import storage
from fifthwheel.apps.fleet.manifest import Trip
from fifthwheel.base.atomic import file_digest
from fifthwheel.base.errors import FifthwheelError, printable
from fifthwheel.base.input_files import MAX_TOML_SIZE
from fifthwheel.data.logs import SignalMap, read_log
from fifthwheel.data.logs.readers.child import DEFAULTS
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import Identification, OneStage, Verdict, identify
from fifthwheel.estimate.identify.given import missing_sensors
from fifthwheel.estimate.identify.knowledge.information import LogKnowledge, SharedInformation
from fifthwheel.estimate.identify.stored import restored, stored
from fifthwheel.truck import Vehicle, catalogue

MAX_ERROR = 2000
"""Characters of an error that are kept."""

DATE = pa.timestamp("us", tz="UTC")
Fields = list[tuple[str, pa.DataType]]


def texts(*names: str) -> Fields:
    """Columns of texts."""
    return [(name, pa.string()) for name in names]


def numbers(*names: str) -> Fields:
    """Columns of real numbers."""
    return [(name, pa.float64()) for name in names]


_ESTIMATE = pa.struct([*texts("name"), *numbers("value", "sigma"), *texts("unit", "verdict")])
_INFORMATION = pa.struct(
    [
        *((name, pa.list_(pa.string())) for name in ("names", "origins")),
        *((name, pa.list_(pa.bool_())) for name in ("logarithmic", "non_negative")),
        *((name, pa.list_(pa.float64())) for name in ("centre", "scale", "vector", "information", "score_covariance")),
        ("factors", pa.map_(pa.string(), pa.float64())),
    ]
)
"""The fields of `SharedInformation`."""
SCHEMA = pa.schema(
    [
        *texts("log", "truck", "trailer", "load"),
        ("date", DATE),
        *texts("vehicle", "signals", "error"),
        ("notes", pa.list_(pa.string())),
        *texts("digest", "log_digest", "version", "settings"),
        ("finished", DATE),
        *numbers("seconds", "duration"),
        *texts("tractor"),
        ("units", pa.map_(pa.string(), pa.string())),
        ("estimates", pa.list_(_ESTIMATE)),
        ("covariance_names", pa.list_(pa.string())),
        ("covariance", pa.list_(pa.float64())),
        ("sensors", pa.list_(_ESTIMATE)),
        ("doubts", pa.list_(pa.string())),
        ("information", _INFORMATION),
    ]
)
"""Columns of the table of trips, SI. `covariance` is row by row; of the matrices in `information`, one half is kept.
`seconds` is the CPU time of the worker, `duration` the length of the log; `error` and `notes` are about this log,
without its name. `digest` is that of all that determines the row, `settings` that of the settings and statements of the
run."""


@dataclass(frozen=True)
class TripOutcome:
    """What became of a trip: "new", "unchanged" or "failed", with the digest of its row and its error."""

    state: str
    digest: str
    error: str = ""
    duration: float = 0.0
    seconds: float = 0.0


@dataclass(frozen=True)
class TripJob:
    """What all trips of a run share; sent once to each worker."""

    folder: str  # of the rows
    settings: OneStage
    done: Any  # sorted digests of the trips that are done, an array of bytes
    failures: Mapping[str, str] = field(default_factory=dict)  # errors by digest of trips that are not tried again

    @property
    def settings_digest(self) -> str:
        """Digest of what the run states of every trip."""
        return _hash(self.settings.as_dict())


def process_trip(job: TripJob, trip: Trip) -> TripOutcome:
    """Process a trip and write its row, unless all that determines it is the same as in an earlier run.

    An error becomes part of the row. It is kept as long as the trip is the same and the process could read it no
    better: with the same limits of the readers and the same packages.
    """
    start, date = time.process_time(), trip.date
    digest = log_digest = ""
    try:
        with storage.local_file(trip.log) as path:
            log_digest = file_digest(path)
            vehicle_text = catalogue.text(trip.vehicle) if trip.vehicle in catalogue.names() else _text(trip.vehicle)
            map_text = _text(trip.signals) if trip.signals else ""
            digest = _digest(trip, job, log_digest, vehicle_text, map_text)
            place = int(np.searchsorted(job.done, digest.encode()))
            if place < len(job.done) and job.done[place] == digest.encode():
                return TripOutcome("unchanged", digest)
            if (failure := _hash(digest, environment())) in job.failures:
                return TripOutcome("failed", failure, job.failures[failure])
            record = read_log(path, _signal_map(trip.signals, map_text), name=storage.stem(trip.log))
        notes = [*record.notes, *missing_sensors(job.settings, record)]
        identification = identify([record], Vehicle.loads(vehicle_text), job.settings)
        content: dict[str, Any] = {"notes": notes, "date": date or _date(record, trip.log)} | trip_content(
            identification, record
        )
    except Exception as problem:  # whatever a log causes, it must not stop the others
        kind = "" if isinstance(problem, FifthwheelError) else f"{type(problem).__name__}: "
        error = f"{kind}{_without_name(printable(str(problem)), trip.log)}"[:MAX_ERROR]
        lasting = not isinstance(problem, OSError | MemoryError)  # others may be gone at the next run
        return write_failure(job, trip, error, digest=digest if lasting else "", log_digest=log_digest)
    seconds = time.process_time() - start
    write_row(job, trip, content | {"error": "", "digest": digest, "log_digest": log_digest, "seconds": seconds})
    return TripOutcome("new", digest, "", content["duration"], seconds)


def _without_name(message: str, log: str) -> str:
    """A message without the name of the log in front, which its row has."""
    for name in (log, log.rpartition("/")[2], storage.stem(log)):
        message = message.removeprefix(f"{name}: ")
    return message


def write_failure(job: TripJob, trip: Trip, error: str, *, digest: str = "", log_digest: str = "") -> TripOutcome:
    """Write the row of a trip without a result; without a `digest` of the trip it is tried again by every run."""
    failure = _hash(digest, environment()) if digest else _hash(trip.log, _labels(trip), log_digest, error)
    if failure not in job.failures:
        write_row(job, trip, {"date": trip.date, "error": error, "digest": failure, "log_digest": log_digest})
    return TripOutcome("failed", failure, error)


def write_row(job: TripJob, trip: Trip, content: Mapping[str, Any]) -> None:
    """Write the row of a trip as a file of its own."""
    row = {
        **{name: getattr(trip, name) for name in ("log", "truck", "trailer", "load", "vehicle", "signals")},
        "version": __version__,
        "settings": job.settings_digest,
        "finished": datetime.datetime.now(datetime.UTC),
        **content,
    }
    name = f"trip-{row['digest'][:40]}.parquet"
    storage.write_bytes(storage.joined(job.folder, name), parquet(pa.Table.from_pylist([row], schema=SCHEMA)))


def parquet(table: pa.Table) -> bytes:
    """A table as a file of Parquet."""
    sink = io.BytesIO()
    pq.write_table(table, sink, compression="zstd", write_page_checksum=True, row_group_size=100)
    return sink.getvalue()


def environment() -> list[Any]:
    """What else may let a trip fail: limits of the readers and installed packages."""
    return [{name: os.environ.get(name) for name in DEFAULTS}, _packages()]


@cache
def _packages() -> list[tuple[str, str]]:
    return sorted((package.name, package.version) for package in importlib.metadata.distributions())


def _digest(trip: Trip, job: TripJob, log_digest: str, vehicle_text: str, map_text: str) -> str:
    databases = []
    if trip.signals and not storage.is_remote(trip.signals):
        databases = [file_digest(Path(path)) for path in SignalMap.load(trip.signals).databases]
    date = trip.date or storage.modified(trip.log)  # of a log without a date of its own
    texts = [log_digest, vehicle_text, map_text, databases, str(date)]
    return _hash(texts, job.settings_digest, __version__, _labels(trip))


def _labels(trip: Trip) -> list[str]:
    return [trip.truck, trip.trailer, trip.load, str(trip.date)]


def _hash(*parts: Any) -> str:
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def _text(path: str) -> str:
    try:
        return storage.read_bytes(path, MAX_TOML_SIZE).decode()
    except UnicodeDecodeError as error:
        raise FifthwheelError(f"{path}: not a text in UTF-8 ({error})") from None


def _signal_map(path: str, text: str) -> SignalMap | None:
    if not path:
        return None
    if not storage.is_remote(path):
        return SignalMap.load(path)
    parsed = SignalMap.parse(text, source=path)
    if parsed.databases:
        raise FifthwheelError(f"{path}: names databases, which an object store does not give; use a local map")
    return parsed


def _date(record: Record, log: str) -> datetime.datetime:
    """The date of the first sample, if the log has one, else that of the file."""
    return record.started or datetime.datetime.fromtimestamp(storage.modified(log), datetime.UTC)


def trip_content(identification: Identification, record: Record) -> dict[str, Any]:
    """Estimates, covariance, findings and information of a trip as columns of `SCHEMA`."""
    if identification.knowledge is None:
        raise FifthwheelError(f"method: {identification.method} gives no information that combines; use one stage")
    log = identification.knowledge.logs[-1]
    information = log.information
    estimated = [e for e in identification.parameters if e.verdict is not Verdict.FIXED]
    names = [e.name for e in estimated if identification.covariance and e.name in identification.covariance.names]
    joint = identification.covariance.among(names).covariance if identification.covariance else np.zeros((0, 0))
    return {
        "duration": record.span[1] - record.span[0],
        "tractor": log.tractor,
        "units": list(log.units.items()),
        "estimates": [_estimate(e) for e in (*estimated, *identification.derived)],
        "covariance_names": names,
        "covariance": joint.ravel().tolist(),
        "sensors": [_estimate(e) for e in identification.sensors],
        "doubts": [
            f"{doubt.kind.value}: {', '.join(cause.name for cause in doubt.causes)}".removesuffix(": ")
            for doubt in identification.doubts
        ],
        "information": stored(SharedInformation, information) | {"factors": [*information.factors.items()]},
    }


def log_knowledge(row: Mapping[str, Any]) -> LogKnowledge:
    """The information of a trip on the truck, from its row."""
    information = row["information"]
    return LogKnowledge(
        name=row["log"],
        **{name: row[name] for name in ("date", "tractor", "trailer", "load", "digest")},
        units=dict(row["units"]),
        estimated=tuple(estimate["name"] for estimate in row["estimates"]),
        information=restored(SharedInformation, {**information, "factors": dict(information["factors"])}),
    )


def _estimate(estimate: Any) -> dict[str, Any]:
    """An estimate as a row; a sensor error has no verdict."""
    return {name: getattr(estimate, name, "") for name in _ESTIMATE.names}
