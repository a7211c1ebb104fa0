"""What needs attention, and the page of a fleet, for tables that are chosen."""

import datetime
import re
from importlib import import_module

import pyarrow as pa
import pytest

from fifthwheel.apps.fleet import FleetSettings, attention, report
from fifthwheel.apps.fleet.attention import find_attention
from fifthwheel.apps.fleet.dataset import KEYS, TripDataset
from fifthwheel.apps.fleet.tables import SCHEMAS, table_of
from fifthwheel.apps.fleet.trips import SCHEMA

PAGE = import_module("fifthwheel.apps.fleet.report")
TYRE, HEIGHT, GYRO = "tractor.drive.cornering_stiffness", "semitrailer.payload.height", "yaw_rate.tractor.gain"


def day(k):
    return datetime.datetime(2026, 1, k, tzinfo=datetime.UTC)


def trip(k, **changes):
    row = {"log": f"{k}.csv", "truck": "T", "trailer": "A", "load": "steel", "date": day(k), "error": "", "notes": []}
    return row | {"doubts": []} | changes


def latest(parameter, value, first, **changes):
    row = {"truck": "T", "trailer": "A", "load": "steel", "parameter": parameter, "value": value, "first_value": first}
    row |= {"sigma": 0.01 * value, "unit": "m" if parameter == HEIGHT else "N/rad", "date": day(9), "trips": 8}
    return row | {"excited_trips": 8, "limited_by": [], "limited_fraction": 0.0} | changes


def change(kind, subject, parameter=TYRE, **changes):
    row = {"truck": "T", "trailer": "A", "kind": kind, "subject": subject, "date": day(7), "after": day(5)}
    row |= {"probability": 0.9, "parameter": parameter, "before": 2.0, "value": 1.7, "sigma": 0.1, "log": "7.csv"}
    return row | {"statistic": 40.0, "threshold": 20.0} | changes


def past(k, **changes):
    row = {"truck": "T", "trailer": None, "load": None, "date": day(k), "log": f"{k}.csv", "parameter": TYRE}
    row |= {"value": 4e5, "sigma": 1e4, "unit": "N/rad", "p_value": 0.5, "outlier": False}
    return row | {"trip_value": 3.9e5, "trip_sigma": 2e4} | changes


def found(settings=None, uncombined=None, **tables):
    tables = {name: [] for name in ("trips", "trucks", "trailers", "changes")} | tables
    return [(a.kind, a.text) for a in find_attention(tables, settings or FleetSettings(), uncombined or {})]


CHANGES = (
    (change("tyres", "tractor.drive"), "tyres changed", "The tyres of the drive axle changed between 2026-01-05 and "),
    (
        change("load", "A", HEIGHT),
        "load changed",
        "The load of A changed between 2026-01-05 and 2026-01-07 (Trailer payload, height −15 %). "
        "Give the trips from 2026-01-07 on another load name. Probability 90 %.",
    ),
    (
        change("sensor", "yaw_rate.tractor", GYRO),
        "sensor",
        "The sensor of the yaw rate of the tractor changed between 2026-01-05 and 2026-01-07. Check its "
        "mounting and calibration. Probability 90 %.",
    ),
    (
        change("outlier", "7.csv"),
        "outlier",
        "The trip of 2026-01-07 (7.csv) differs from those before and after it; look at its log.",
    ),
)


def test_a_change_states_what_when_and_what_to_do() -> None:
    for row, kind, text in CHANGES:
        ((actual, described),) = found(changes=[row])
        assert actual == kind
        assert described.startswith(text), described


def test_tyres_need_attention_beyond_the_limit_of_wear() -> None:
    """In both directions; a parameter of another kind drifts with the load."""
    drifts = (0.84, 0.86, 1.14, 1.16)
    rows = [latest(TYRE, 4e5 * drift, 4e5, truck=f"{drift}") for drift in drifts]
    tables = {"trucks": [*rows, latest(HEIGHT, 2.0, 1.0)], "trailers": [latest(TYRE, 1e5, None)], "trips": []}
    findings = find_attention({**tables, "changes": []}, FleetSettings(wear=0.15), {})
    assert [(a.truck, a.kind) for a in findings] == [("0.84", "tyre wear"), ("1.16", "tyre wear")]
    assert "drifted by −16 %" in findings[0].text
    assert "drifted by 16 %" in findings[1].text
    assert "in 8 trips" in findings[1].text


def test_loads_above_the_limit_of_height() -> None:
    rows = [latest(HEIGHT, 1.5, 1.0, load=""), latest(HEIGHT, 1.6, 1.0), latest(TYRE, 1e5, 1e5)]
    assert found(trailers=rows) == []
    ((kind, text),) = found(FleetSettings(height_limit=1.5), trailers=rows)
    assert kind == "load height"
    assert "of load 'steel' on trailer 'A' is 1.600" in text
    assert "above 1.50 m." in text
    unnamed = found(FleetSettings(height_limit=1.4), trailers=rows[:1])[0][1]
    assert "height on trailer 'A'" in unnamed


def test_a_sensor_needs_attention_from_the_second_trip_with_the_same_doubt() -> None:
    """By the most likely cause; a doubt of the vehicle file is none of a sensor."""
    doubt, other = f"sensor: {GYRO}, tractor.mass", f"assumption: tractor.mass, {GYRO}"
    once = [trip(1, doubts=[doubt]), trip(2), trip(3, doubts=None), trip(4, doubts=[other]), trip(5, doubts=[other])]
    assert found(trips=once) == []
    assert found(trips=[*once, trip(6, truck="another", doubts=[doubt])]) == []
    ((kind, text),) = found(trips=[*once, trip(6, doubts=[doubt])])
    assert kind == "sensor"
    assert "unusual in 2 trips; check this sensor" in text


def test_lost_data_needs_attention_once_for_each_kind() -> None:
    """Other notes are on formats; a log that was not processed has a finding of its own."""
    lost = "3 rows left out"
    rows = [
        trip(1, notes=[lost, "12 rows left out", "starts at 12:00"]),
        trip(2, notes=["12 rows left out", "broken after 3 s"]),
        trip(3, notes=[lost], truck="another"),
        trip(4, notes=[lost], error="no speed"),
        trip(5, error="no 'speed' in row 3"),
        trip(6, error="no 'steer' in row 4"),
        trip(7, notes=None, error="x" * 400),
    ]
    tables = {"trips": rows, "trucks": [], "trailers": [], "changes": []}
    findings = find_attention(tables, FleetSettings(), {"T": "no date"})
    cure = "Check the logger, or leave the log out."
    assert [(a.truck, a.kind, a.text) for a in findings] == [
        ("T", "damaged log", f"2 logs are damaged, the rest is used; 1.csv: 3 rows left out. {cure}"),
        ("T", "damaged log", f"1 log is damaged, the rest is used; 2.csv: broken after 3 s. {cure}"),
        ("T", "not combined", "None of its trips count: no date"),
        ("T", "not processed", "1 trip was not processed; 4.csv: no speed"),
        ("T", "not processed", "2 trips were not processed; 5.csv: no 'speed' in row 3"),
        ("T", "not processed", f"1 trip was not processed; 7.csv: {'x' * attention.MAX_MESSAGE}"),
        ("another", "damaged log", f"1 log is damaged, the rest is used; 3.csv: 3 rows left out. {cure}"),
    ]


@pytest.fixture
def data(tmp_path):
    """Writes a data set of chosen rows, and gives its page as text."""

    def written(trips=(), **tables):
        dataset, out = TripDataset(str(tmp_path / "data")), tmp_path / "fleet.html"
        rows = [{"digest": r["log"], "duration": 9.0, **r} for r in trips]
        every = {name: table_of(tables.get(name, ()), schema) for name, schema in SCHEMAS.items()}
        every["trips"] = pa.Table.from_pylist(rows, schema=SCHEMA).select(KEYS)
        dataset.write(every, {"fleet": FleetSettings().as_dict(), "not combined": {}})
        report(dataset.path, out)
        return out.read_text()

    return written


def test_the_headline_counts_trucks_trips_and_findings(data) -> None:
    trips = [trip(1), trip(2), trip(3, truck="U"), trip(4, error="no speed")]
    text = data(trips)
    assert "2 trucks, 3 trips: 1 finding in 1 truck." in text
    assert "a false change in the whole fleet is at most 5" in text
    assert "Trips that were not processed" in text
    clean = data(trips[:3])
    assert "2 trucks, 3 trips: nothing needs attention." in clean
    assert "Needs attention" not in clean
    assert "Trips that were not processed" not in clean


def test_the_first_trucks_and_rows_are_shown(data, monkeypatch) -> None:
    """The page states how many the tables have; a truck that needs attention is drawn first."""
    rows = [latest(TYRE, 4e5, 4e5, truck=name) for name in "TUV"]
    tables = {"trucks": rows, "history": [past(k, truck=name) for name in "TUV" for k in (1, 2)]}
    tables["changes"] = [change("tyres", "tractor.drive", truck="V")]
    hints = ("trucks are drawn", "rows; trucks.parquet")
    whole = data(**tables)
    assert not any(hint in whole for hint in hints)
    monkeypatch.setattr(PAGE, "MAX_HISTORIES", 3)
    monkeypatch.setattr(PAGE, "MAX_ROWS", 3)
    assert data(**tables) == whole
    monkeypatch.setattr(PAGE, "MAX_HISTORIES", 2)
    monkeypatch.setattr(PAGE, "MAX_ROWS", 2)
    short = data(**tables)
    assert "2 of 3 trucks are drawn; history.parquet has all." in short
    assert "The first 2 rows; trucks.parquet and trailers.parquet have all." in short
    assert re.findall(r"<h3>(\w)", whole) == ["V", "T", "U"]
    assert re.findall(r"<h3>(\w)", short) == ["V", "T"]
    assert re.findall(r"<h3>(\w) <span", whole) == ["V"]
