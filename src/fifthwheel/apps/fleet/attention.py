"""What in a fleet needs attention, from its tables."""

import datetime
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from fifthwheel.base.formatting import fixed, percent, with_sigma
from fifthwheel.base.names import PAYLOAD_HEIGHT, ParameterPath, ends_with
from fifthwheel.base.options import FleetSettings
from fifthwheel.data.channels import is_sensor_error
from fifthwheel.estimate.identify.knowledge.information import OUTLIER
from fifthwheel.truck.spoken_names import named, named_axle, spoken

REPEATED = 2
"""Trips with a doubt about the same sensor from which it needs attention."""

_DAMAGE = re.compile(r"^broken|cut short|\b(line|row|sample|message)s?\b.* left out|are no numbers")
"""Notes of the readers on data that is lost; other notes are on formats, such as a start time or channels left out."""
_VARIABLE = re.compile(r"'[^']*'|\d[\d.]*")
"""What differs between messages of one kind."""
MAX_MESSAGE = 300
"""Characters of a message in a finding."""

Row = Mapping[str, Any]


@dataclass(frozen=True)
class Attention:
    """One thing that needs attention."""

    truck: str
    kind: str
    """"tyres changed", "load changed", "sensor", "outlier", "tyre wear", "load height", "damaged log",
    "not processed" or "not combined"."""
    date: datetime.datetime | None
    text: str
    """What was found, and what to do."""


def find_attention(
    tables: Mapping[str, Sequence[Row]], settings: FleetSettings, uncombined: Mapping[str, str]
) -> list[Attention]:
    """What needs attention, by truck, from the rows of "trips", "trucks", "trailers" and "changes", and from the errors
    of trucks whose trips are not combined."""
    found = [
        *map(_change, tables["changes"]),
        *_wear([*tables["trucks"], *tables["trailers"]], settings.wear),
        *_heights(tables["trailers"], settings.height_limit),
        *_sensors(tables["trips"]),
        *_damaged(tables["trips"]),
        *_failed(tables["trips"]),
        *(Attention(truck, "not combined", None, f"None of its trips count: {e}") for truck, e in uncombined.items()),
    ]
    return sorted(found, key=lambda item: (item.truck, item.kind))


def _change(row: Row) -> Attention:
    kind, subject, day = row["kind"], row["subject"], f"{row['date']:%Y-%m-%d}"
    if kind == OUTLIER:
        text = f"The trip of {day} ({row['log']}) differs from those before and after it; look at its log."
        return Attention(row["truck"], "outlier", row["date"], text)
    moved = f"{spoken(row['parameter'])} {percent(row['value'] / row['before'] - 1)}" if row["before"] else subject
    when = f"between {row['after']:%Y-%m-%d} and {day}"
    path, of, trailer = subject.partition(" of ")
    whose = f"{of}{trailer}"
    axle = f"{named_axle(path)}{whose}"
    cure = {
        "tyres": f"The tyres of the {axle} changed {when} ({moved}). "
        "If nobody replaced them, check pressure and tread.",
        "load": f"The load of {subject} changed {when} ({moved}). Give the trips from {day} on another load name.",
        "sensor": f"The sensor of {named(path)}{whose} changed {when}. Check its mounting and calibration.",
    }
    title = "sensor" if kind == "sensor" else f"{kind} changed"
    return Attention(row["truck"], title, row["date"], f"{cure[kind]} Probability {percent(row['probability'])}.")


def _wear(rows: Sequence[Row], limit: float) -> Iterator[Attention]:
    for row in rows:
        if ParameterPath.of(row["parameter"]).quantity != "cornering_stiffness" or not row["first_value"]:
            continue
        change = row["value"] / row["first_value"] - 1
        if abs(change) > limit:
            now = with_sigma(row["value"], row["sigma"], row["unit"])
            text = (
                f"{spoken(row['parameter'])} drifted by {percent(change)} to {now} in {row['trips']} trips; "
                "check tread and pressure."
            )
            yield Attention(row["truck"], "tyre wear", row["date"], text)


def _heights(rows: Sequence[Row], limit: float | None) -> Iterator[Attention]:
    for row in rows:
        if limit is None or not ends_with(row["parameter"], PAYLOAD_HEIGHT) or row["value"] <= limit:
            continue
        of_load = f" of load {row['load']!r}" if row["load"] else ""
        text = (
            f"{spoken(row['parameter'])}{of_load} on trailer {row['trailer']!r} is"
            f" {with_sigma(row['value'], row['sigma'], row['unit'])}, above {fixed(limit, 2)} m."
        )
        yield Attention(row["truck"], "load height", row["date"], text)


def _sensors(trips: Sequence[Row]) -> Iterator[Attention]:
    counts: Counter[tuple[str, str]] = Counter()
    last: dict[tuple[str, str], datetime.datetime] = {}
    for trip in trips:
        for doubt in trip["doubts"] or ():
            _, _, causes = doubt.partition(": ")
            if is_sensor_error(causes.partition(", ")[0]):  # the most likely cause
                key = (trip["truck"], causes)
                counts[key] += 1
                last[key] = trip["date"]
    for (truck, cause), count in counts.items():
        if count >= REPEATED:
            names = " or ".join(map(spoken, cause.split(", ")))
            text = f"{names}: unusual in {count} trips; check this sensor and the signal map."
            yield Attention(truck, "sensor", last[truck, cause], text)


def _damaged(trips: Sequence[Row]) -> Iterator[Attention]:
    """Logs of which a part was lost; those that were not processed have a finding of their own."""
    notes = ((t, note) for t in trips if not t["error"] for note in t["notes"] or () if _DAMAGE.search(note))
    for first, note, count in _kinds(notes):
        logs = f"{count} logs are" if count > 1 else "1 log is"
        text = f"{logs} damaged, the rest is used; {first['log']}: {note}. Check the logger, or leave the log out."
        yield Attention(first["truck"], "damaged log", first["date"], text)


def _failed(trips: Sequence[Row]) -> Iterator[Attention]:
    for first, error, count in _kinds((trip, trip["error"]) for trip in trips if trip["error"]):
        were = f"{count} trips were" if count > 1 else "1 trip was"
        text = f"{were} not processed; {first['log']}: {error}"
        yield Attention(first["truck"], "not processed", first["date"], text)


def _kinds(messages: Iterable[tuple[Row, str]]) -> Iterator[tuple[Row, str, int]]:
    """For each truck and kind of message: the first trip, its message, and the number of trips."""
    found: dict[tuple[str, str], list[tuple[Row, str]]] = {}
    for trip, message in messages:
        found.setdefault((trip["truck"], _VARIABLE.sub("", message)), []).append((trip, message))
    for same in found.values():
        yield same[0][0], same[0][1][:MAX_MESSAGE], len({trip["log"] for trip, _ in same})
