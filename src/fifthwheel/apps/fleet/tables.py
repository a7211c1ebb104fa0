"""The tables of a fleet: trucks, trailers, histories and changes, as rows of numbers in SI."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pyarrow as pa

from fifthwheel.apps.fleet.dataset import TripDataset, TruckTrips
from fifthwheel.apps.fleet.trips import DATE, log_knowledge, numbers, texts
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.options import FleetSettings
from fifthwheel.estimate.identify.knowledge.combination import Combined, combine, date_of
from fifthwheel.estimate.identify.knowledge.information import OUTLIER, Owned
from fifthwheel.estimate.identify.verdict import Verdict
from fifthwheel.results.diagnose.thresholds import DOMINANT_FRACTION
from fifthwheel.truck import unit_of

_LATEST = [
    *texts("parameter"),
    *numbers("value", "sigma"),
    *texts("unit"),
    ("date", DATE),
    ("trips", pa.int64()),
    *numbers("first_value"),
    ("excited_trips", pa.int64()),
    ("limited_by", pa.list_(pa.string())),
    *numbers("limited_fraction"),
]
SCHEMAS: Mapping[str, pa.Schema] = {
    "trucks": pa.schema([*texts("truck"), *_LATEST]),
    "trailers": pa.schema([*texts("truck", "trailer", "load"), *_LATEST]),
    "history": pa.schema(
        [
            *texts("truck", "trailer", "load"),
            ("date", DATE),
            *texts("log", "parameter"),
            *numbers("value", "sigma"),
            *texts("unit"),
            *numbers("trip_value", "trip_sigma", "p_value"),
            ("outlier", pa.bool_()),
        ]
    ),
    "changes": pa.schema(
        [
            *texts("truck", "trailer", "kind", "subject"),
            ("date", DATE),
            ("after", DATE),
            *numbers("probability"),
            *texts("parameter"),
            *numbers("before", "value", "sigma", "statistic", "threshold"),
            *texts("log"),
        ]
    ),
}
"""Columns. `date` of a change is that of the first trip with it, `after` that of the last trip without. `value` of a
history is the estimate at this date from all trips, `trip_value` that of the trip alone. `excited_trips` are those that
determine the parameter alone; `limited_fraction` of the variance would go if the numbers `limited_by` were exact."""


def table_of(rows: Sequence[Mapping[str, Any]], schema: pa.Schema) -> pa.Table:
    """A table of rows in the order of the labels."""
    order = [(c, "ascending") for c in ("truck", "trailer", "load", "parameter", "date") if c in schema.names]
    return pa.Table.from_pylist(list(rows), schema=schema).sort_by(order)


@dataclass(frozen=True, kw_only=True)
class CombinationJob:
    """What all combinations share; sent once to each worker."""

    path: str  # of the data set
    settings: FleetSettings
    false_alarm: float  # probability of a false alarm in one test


@dataclass(frozen=True)
class Rows:
    """Rows of the tables by name, and trucks that could not be combined with the reason."""

    tables: dict[str, list[dict[str, Any]]] = field(default_factory=lambda: {name: [] for name in SCHEMAS})
    failed: dict[str, str] = field(default_factory=dict)


def combine_trucks(job: CombinationJob, batch: TruckTrips) -> Rows:
    """The rows of the trucks of a batch."""
    trips = {row["digest"]: row for row in TripDataset(job.path).trips(d for _, logs in batch for d in logs)}
    result = Rows()
    for truck, logs in batch:
        try:
            rows = [trips[digest] | {"log": log} for digest, log in logs.items()]
            combined = combine(
                [log_knowledge(row) for row in rows], tyre_walk=job.settings.tyre_walk, false_alarm=job.false_alarm
            )
        except Exception as error:  # one truck must not stop the others
            kind = "" if isinstance(error, FifthwheelError) else f"{type(error).__name__}: "
            result.failed[truck] = f"{kind}{error}"
            continue
        estimates = {row["digest"]: row["estimates"] for row in rows}
        for name, table in _tables(truck, combined, estimates).items():
            result.tables[name] += table
    return result


def _tables(
    truck: str, combined: Combined, estimates: Mapping[str, Sequence[Mapping[str, Any]]]
) -> dict[str, list[dict[str, Any]]]:
    """The rows of a truck; with the estimates of each trip alone by its digest."""
    history = list(_history(truck, combined, estimates))
    tables: dict[str, list[dict[str, Any]]] = {"trucks": [], "trailers": [], "history": history}
    excited = [{e["name"] for e in estimates[log.digest] if e["verdict"] == Verdict.CONVERGED} for log in combined.logs]
    for unknown, trips in combined.trips_with.items():
        limited_by, limited_fraction = _limit(combined, unknown)
        value, sigma = combined.estimate(trips[-1], unknown)
        row = {
            "truck": truck,
            "parameter": unknown.name,
            "value": value,
            "sigma": sigma,
            "unit": unit_of(unknown.name),
            "date": date_of(combined.observations[trips[-1]]),
            "trips": len(trips),
            "first_value": combined.estimate(_since_change(combined, unknown, trips), unknown)[0],
            "excited_trips": sum(unknown.name in excited[k] for k in trips),
            "limited_by": limited_by,
            "limited_fraction": limited_fraction,
        }
        if unknown.of("trailer") is None:
            tables["trucks"].append(row)
        else:
            tables["trailers"].append(row | {"trailer": unknown.of("trailer"), "load": unknown.of("load") or ""})
    return tables | {"changes": [*_changes(truck, combined)]}


def _limit(combined: Combined, unknown: Owned) -> tuple[list[str], float]:
    """Up to three numbers that limit a parameter, and by what fraction its variance would fall if they were exact."""
    P, i = combined.last.P, combined.layout.unknowns[unknown]
    places = {j: u.name for u, j in combined.layout.unknowns.items() if u not in combined.layout.estimated}

    def fraction(chosen: list[int]) -> float:
        return float(P[i, chosen] @ np.linalg.lstsq(P[np.ix_(chosen, chosen)], P[chosen, i])[0] / P[i, i])

    chosen: list[int] = []
    while len(chosen) < min(3, len(places)) and not (chosen and fraction(chosen) > DOMINANT_FRACTION):
        chosen.append(max(places.keys() - set(chosen), key=lambda j: fraction([*chosen, j])))
    return [places[j] for j in chosen], fraction(chosen) if chosen else 0.0


def _since_change(combined: Combined, unknown: Owned, trips: list[int]) -> int:
    place = combined.layout.unknowns[unknown]
    changed = [c.trip for c in combined.changes if c.kind.name != OUTLIER and place in c.kind.members]
    return next(k for k in trips if k >= max(changed, default=0))


def _history(
    truck: str, combined: Combined, estimates: Mapping[str, Sequence[Mapping[str, Any]]]
) -> Iterator[dict[str, Any]]:
    outliers = {change.trip for change in combined.changes if change.kind.name == OUTLIER}
    for k, log in enumerate(combined.logs):
        alone = {e["name"]: (e["value"], e["sigma"]) for e in estimates[log.digest]}
        for unknown in combined.parameters(k):
            value, sigma = combined.estimate(k, unknown)
            trip_value, trip_sigma = alone.get(unknown.name, (None, None))
            yield {
                "truck": truck,
                "trailer": unknown.of("trailer"),
                "load": unknown.of("load"),
                "date": date_of(combined.observations[k]),
                "log": log.name,
                "parameter": unknown.name,
                "value": value,
                "sigma": sigma,
                "unit": unit_of(unknown.name),
                "trip_value": trip_value,
                "trip_sigma": trip_sigma,
                "p_value": combined.p_values[k],
                "outlier": k in outliers,
            }


def _changes(truck: str, combined: Combined) -> Iterator[dict[str, Any]]:
    """A row for each change, with the parameter that it altered most in its sigmas."""
    for change in combined.changes:
        k, previous = change.trip, max(change.trip - 1, 0)
        present = {u for j in (k, previous) for u in combined.parameters(j)}
        moved = [
            (abs(after - before) / sigma, u.name, before, after, sigma)
            for u in present
            if combined.layout.unknowns[u] in change.kind.members
            for (before, _), (after, sigma) in [(combined.estimate(previous, u), combined.estimate(k, u))]
        ]
        _, name, before, after, sigma = max(moved, default=(0.0, None, None, None, None))
        log = combined.logs[k]
        yield {
            "truck": truck,
            "trailer": log.trailer,
            "kind": change.kind.name,
            "subject": change.kind.subject,
            "date": date_of(combined.observations[k]),
            "after": date_of(combined.observations[previous]),
            "probability": change.probability,
            "parameter": name,
            "before": before,
            "value": after,
            "sigma": sigma,
            "statistic": change.statistic,
            "threshold": change.threshold,
            "log": log.name,
        }
