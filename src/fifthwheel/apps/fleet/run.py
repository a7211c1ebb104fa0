"""A run over a fleet: every trip that is not done, then the combination of all trips."""

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from fifthwheel import __version__
from fifthwheel.apps.cluster import Lost, run_all
from fifthwheel.apps.fleet import storage
from fifthwheel.apps.fleet.dataset import TripDataset, TruckTrips, batches
from fifthwheel.apps.fleet.manifest import Trip, read_manifest
from fifthwheel.apps.fleet.tables import SCHEMAS, CombinationJob, Rows, combine_trucks, table_of
from fifthwheel.apps.fleet.trips import TripJob, TripOutcome, process_trip, write_failure
from fifthwheel.base.atomic import held
from fifthwheel.base.options import FleetSettings
from fifthwheel.estimate.identify import OneStage
from fifthwheel.estimate.identify.knowledge.changes import WINDOWS
from fifthwheel.estimate.identify.settings import Progress

SHOWN_ERRORS = 20
"""Errors that a summary keeps; all of them are in the table of trips."""
JOIN_AFTER = 2000
"""New trips after which their rows are joined during a run."""


@dataclass(kw_only=True)
class FleetRun:
    """What a run did."""

    path: str
    """Of the data set."""
    trips: int = 0
    """In the manifest."""
    new: int = 0
    unchanged: int = 0
    failed: int = 0
    """Trips without a result, also those that failed in an earlier run and were not tried again."""
    lost: int = 0
    """Trips that ended their worker again and again; the next run tries them once more."""
    hours: float = 0.0
    """Length of the new logs, h."""
    seconds: float = 0.0
    """CPU time of the workers for new trips, s."""
    changes: int = 0
    errors: list[tuple[str, str]] = field(default_factory=list)
    """The first errors: log or truck, and message."""

    def as_dict(self) -> dict[str, Any]:
        """All fields by name."""
        return {**vars(self), "errors": [list(pair) for pair in self.errors]}

    def count(self, trip: Trip, outcome: TripOutcome) -> None:
        """Add the outcome of a trip."""
        setattr(self, outcome.state, getattr(self, outcome.state) + 1)
        if outcome.state == "new":
            self.hours += outcome.duration / 3600
            self.seconds += outcome.seconds
        elif outcome.error and len(self.errors) < SHOWN_ERRORS:
            self.errors.append((trip.log, outcome.error))


def run(
    manifest: str | Path | Sequence[Trip],
    out: str | Path,
    *,
    settings: OneStage | None = None,
    fleet: FleetSettings | None = None,
    scheduler: str | None = None,
    jobs: int | None = None,
    retry: bool = False,
    progress: Progress = lambda *_: None,
) -> FleetRun:
    """Identify every trip of a manifest that the data set does not have, and combine all trips of each truck.

    A result in the data set is used if the content of the log, signal map, databases and vehicle file, the labels in
    the manifest, the settings and the version of this package are the same. The tables do not depend on earlier runs
    with these trips. Finished trips are kept when the run is interrupted or killed. An error of a trip is recorded in
    the table of trips and does not stop the run.

    Args:
        manifest: path of a CSV or Parquet file (`read_manifest`), or its trips.
        out: data set: a folder, or a prefix of an object store such as s3://bucket/fleet.
        settings: of the identification of each trip; by default `OneStage()`.
        fleet: of the combination.
        scheduler: address of a Dask scheduler, as of `fifthwheel.apps.cluster.connected`; by default, processes of
            this computer work.
        jobs: number of these processes, by default one per core; 1 computes in this process.
        retry: whether a failed trip is tried again although it, the limits of the readers and the installed packages
            are the same.
        progress: called while trips end.

    Raises:
        FifthwheelError: the manifest or the data set cannot be read or written, another run writes to the same folder,
            or no scheduler answers.
    """
    trips = read_manifest(str(manifest)) if isinstance(manifest, str | Path) else list(manifest)
    dataset, settings, fleet = TripDataset(storage.checked(str(out))), settings or OneStage(), fleet or FleetSettings()
    result = FleetRun(path=dataset.path, trips=len(trips))
    with ExitStack() as stack:
        if not storage.is_remote(dataset.path):
            Path(dataset.path).mkdir(parents=True, exist_ok=True)
            stack.enter_context(held(Path(dataset.path) / "fleet.lock", subject=Path(dataset.path)))
        execute = partial(run_all, jobs=jobs, scheduler=scheduler)
        dataset.join()
        done, failures = dataset.known()
        job = TripJob(folder=dataset.folder, settings=settings, done=done, failures={} if retry else failures)
        digests = dict[Trip, str]()
        for k, (trip, outcome) in enumerate(execute(process_trip, job, trips), start=1):
            if isinstance(outcome, Lost):
                outcome = replace(write_failure(job, trip, outcome.reason), state="lost")
            result.count(trip, outcome)
            digests[trip] = outcome.digest
            progress("trips", k, len(trips))
            if not k % JOIN_AFTER:
                dataset.join()
        dataset.join()
        counting = dataset.counting({trip.log: digests[trip] for trip in trips}, job.settings_digest)
        rows = _combined(dataset, list(batches(counting)), fleet, execute, progress)
        tables = {name: table_of(rows.tables[name], schema) for name, schema in SCHEMAS.items()}
        described = {"version": __version__, "fleet": fleet.as_dict(), "identification": settings.as_dict()}
        described |= {"not combined": rows.failed}
        dataset.write(tables | {"trips": counting}, described)
    result.changes = len(rows.tables["changes"])
    result.errors += rows.failed.items()
    return result


def _combined(
    dataset: TripDataset, groups: Sequence[TruckTrips], fleet: FleetSettings, execute: Any, progress: Progress
) -> Rows:
    count = sum(len(logs) for group in groups for _, logs in group)
    false_alarm = fleet.false_alarms / max(count * len(WINDOWS), 1)
    job = CombinationJob(path=dataset.path, settings=fleet, false_alarm=false_alarm)
    every = Rows()
    for k, (group, rows) in enumerate(execute(combine_trucks, job, groups), start=1):
        progress("combining", k, len(groups))
        if isinstance(rows, Lost):
            rows = Rows(failed={truck: rows.reason for truck, _ in group})
        for name, table in rows.tables.items():
            every.tables[name] += table
        every.failed.update(rows.failed)
    return every
