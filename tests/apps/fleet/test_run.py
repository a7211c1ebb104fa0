"""A run over a small fleet in this process: results, what is done again, damaged trips, the page."""

import datetime
import os
import shutil
from dataclasses import replace
from importlib import import_module

import numpy as np
import pyarrow.parquet as pq
import pytest

import fifthwheel as fw
from fifthwheel.apps.cluster import Lost
from fifthwheel.apps.fleet import FleetSettings, Trip, read_manifest, report, run, storage, trips
from fifthwheel.apps.fleet.dataset import TripDataset
from fifthwheel.apps.fleet.report import limit
from fifthwheel.apps.fleet.tables import SCHEMAS, Rows
from fifthwheel.apps.fleet.trips import TripJob, log_knowledge
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.data.record import Record
from fifthwheel.data.record.timestamps import DATES
from fifthwheel.estimate.identify.knowledge.changes import WINDOWS
from tests.apps.fleet.make import DRIVE, FAST, OTHER, TRUCK, make_fleet, write_manifest

pytestmark = pytest.mark.slow

RUN = import_module("fifthwheel.apps.fleet.run")


def rows(path, name):
    return pq.read_table(path / f"{name}.parquet").to_pylist()


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """A fleet of one truck with two trips, which are identified."""
    folder = tmp_path_factory.mktemp("done")
    run(make_fleet(folder, trucks=1, trips=2), folder / "out", settings=FAST, jobs=1)
    return folder


@pytest.fixture
def copied(done, tmp_path):
    """Manifest and data set of a copy of that fleet, whose trips are known."""
    shutil.copytree(done, tmp_path / "fleet")
    return tmp_path / "fleet" / "manifest.csv", tmp_path / "fleet" / "out"


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fleet")
    manifest = make_fleet(folder, trucks=1, trips=6, changed_from=3)
    result = run(manifest, folder / "out", settings=FAST, jobs=1)
    return folder, manifest, result


def test_estimates_and_the_change_of_tyres(fleet) -> None:
    folder, _, result = fleet
    assert (result.new, result.failed, result.changes) == (6, 0, 1)
    for row in rows(folder / "out", "trucks"):
        true = TRUCK.parameters()[row["parameter"]] * (0.85 if row["parameter"] == DRIVE else 1.0)
        assert abs(row["value"] - true) < 3 * row["sigma"]
        assert row["trips"] == 6
    for change in rows(folder / "out", "changes"):
        assert (change["kind"], change["subject"]) == ("tyres", "tractor.drive")
        assert f"{change['after']:%d} {change['date']:%d}" == "05 07"
    assert len(rows(folder / "out", "history")) == 6 * 2


def test_the_row_of_a_trip_has_its_estimates_and_its_information(fleet) -> None:
    """As the identification of its log gives them."""
    folder, manifest, _ = fleet
    trip = read_manifest(str(manifest))[4]
    data = TripDataset(str(folder / "out"))
    (row,) = data.trips(r["digest"] for r in rows(folder / "out", "trips") if r["log"] == trip.log)
    record, vehicle = fw.read_log(trip.log, name=storage.stem(trip.log)), fw.Vehicle.load(folder / "truck.toml")
    result = fw.identify([record], vehicle, FAST)
    estimated = [e for e in result.parameters if e.verdict is not fw.Verdict.FIXED]
    expected = [(e.name, e.value, e.sigma, e.unit, e.verdict) for e in (*estimated, *result.derived)]
    assert [tuple(e.values()) for e in row["estimates"]] == expected
    names = [e.name for e in estimated]
    assert row["covariance_names"] == names
    assert row["covariance"] == result.covariance.among(names).covariance.ravel().tolist()
    assert [(e["name"], e["value"]) for e in row["sensors"]] == [(e.name, e.value) for e in result.sensors]
    labels = {"truck": "truck 0", "trailer": "A", "load": "steel", "tractor": "tractor", "error": "", "date": trip.date}
    assert row | labels == row
    assert row["duration"] == record.time[-1] - record.time[0]
    assert 0 < row["seconds"] < 60
    known, own = log_knowledge(row), result.knowledge.logs[-1]
    assert known.estimated == tuple(e.name for e in (*estimated, *result.derived))
    assert known.information == own.information


def test_finished_trips_are_joined_now_and_then(tmp_path, monkeypatch) -> None:
    """Before the trips, after every JOIN_AFTER of them, and at the end; a lost trip is tried again by the next run."""
    logs = [Trip(log=str(tmp_path / f"{k}.csv"), truck="T", vehicle="v.toml") for k in range(5)]
    joined, steps = [], []
    monkeypatch.setattr(RUN, "JOIN_AFTER", 2)
    monkeypatch.setattr(TripDataset, "join", lambda _: joined.append(len(steps)))

    def run_all(function, job, tasks, **_):
        for k, task in enumerate(tasks):
            yield task, Lost("no memory") if k == 1 else function(job, task)

    monkeypatch.setattr(RUN, "run_all", run_all)
    result = run(logs, tmp_path / "out", jobs=1, progress=lambda *step: steps.append(step))
    assert steps == [("trips", k, 5) for k in range(1, 6)]
    assert joined == [0, 2, 4, 5]
    assert (result.trips, result.failed, result.lost) == (5, 4, 1)
    assert result.errors[1] == (logs[1].log, "no memory")


def test_all_tests_of_a_fleet_share_the_probability_of_a_false_alarm() -> None:
    """Of each window at each trip; a batch that is lost is named for each of its trucks."""
    groups, steps, jobs = [[("T", {"1": "a", "2": "b"})], [("U", {"3": "c"}), ("V", {})]], [], []

    def execute(function, job, batches):
        jobs.append(job)
        assert function is RUN.combine_trucks
        tables = {name: [{"truck": "T"}] if name == "trucks" else [] for name in SCHEMAS}
        yield batches[0], Rows(tables=tables, failed={"T": "no date"})
        yield batches[1], Lost("no memory")

    data = TripDataset("out")
    found = RUN._combined(data, groups, FleetSettings(false_alarms=0.3), execute, lambda *step: steps.append(step))
    assert jobs[0].false_alarm == pytest.approx(0.3 / (3 * len(WINDOWS)))
    assert found.failed == {"T": "no date", "U": "no memory", "V": "no memory"}
    assert found.tables["trucks"] == [{"truck": "T"}]
    assert steps == [("combining", 1, 2), ("combining", 2, 2)]


def test_the_date_of_a_log(tmp_path) -> None:
    """Of its first sample if that is a date, else of the file; a date of the manifest has priority."""
    path = tmp_path / "log.csv"
    path.write_text("")
    os.utime(path, (1.7e9, 1.7e9))
    for first, expected in ((1.75e9, 1.75e9), (DATES[0], DATES[0]), (DATES[0] - 1, 1.7e9), (0.0, 1.7e9)):
        record = Record(time=[first, first + 1], signals={"speed": [20.0, 20.0]})
        assert trips._date(record, str(path)) == datetime.datetime.fromtimestamp(expected, datetime.UTC)


def test_what_determines_the_row_of_a_trip(tmp_path, monkeypatch) -> None:
    """Each change gives another digest: of labels, log, vehicle, signal map, databases, settings, version and date."""
    (tmp_path / "a.dbc").write_text("1")
    (tmp_path / "map.toml").write_text('databases = ["a.dbc"]\n[signals]\nspeed = "v"\n')
    log = tmp_path / "a.csv"
    log.write_text("")
    labels = {"truck": "T", "trailer": "A", "load": "steel"}
    trip = Trip(log=str(log), vehicle="v.toml", signals=str(tmp_path / "map.toml"), **labels)
    job = TripJob(folder=str(tmp_path), settings=FAST, done=np.array([], dtype="S64"))

    def digest(trip=trip, job=job, texts=("log", "vehicle", "map")):
        return trips._digest(trip, job, *texts)

    assert digest() == digest()
    others = [digest(replace(trip, **{n: "other"})) for n in ("truck", "trailer", "load")]
    others += [digest(replace(trip, date=datetime.datetime(2026, 1, 1, tzinfo=datetime.UTC)))]
    others += [digest(texts=texts) for texts in (("x", "vehicle", "map"), ("log", "x", "map"), ("log", "vehicle", "x"))]
    others += [digest(job=replace(job, settings=fw.OneStage())), digest(replace(trip, signals=""))]
    before = digest()
    (tmp_path / "a.dbc").write_text("2")
    others += [before, digest()]
    os.utime(log, (1.7e9, 1.7e9))
    others += [digest()]
    monkeypatch.setattr(trips, "__version__", "other")
    others += [digest()]
    assert len(set(others)) == len(others)


def test_a_trip_is_done_again_only_with_other_settings_and_never_counted_twice(copied) -> None:
    manifest, out = copied
    known, first = [row["digest"] for row in rows(out, "trips")], rows(out, "trucks")
    again = run(manifest, out, settings=FAST, jobs=1)
    assert (again.new, again.unchanged) == (0, 2)
    assert [row["digest"] for row in rows(out, "trips")] == known
    earlier = (out / "fleet.json").read_bytes()
    assert run(manifest, out, settings=OTHER, jobs=1).new == 2
    assert len(rows(out, "trips")) == rows(out, "trucks")[0]["trips"] == 2
    assert rows(out, "trucks")[0]["sigma"] == pytest.approx(first[0]["sigma"], rel=0.02)
    (out / "fleet.json").write_bytes(earlier)
    with pytest.raises(FifthwheelError, match=r"parquet: not of the run of fleet.json.*run the fleet again"):
        report(out, out.parent / "fleet.html")


def test_damaged_trips_are_recorded_and_stop_nothing(copied) -> None:
    manifest, out = copied
    tmp_path = manifest.parent
    (tmp_path / "bad.parquet").write_bytes(b"PAR1 damaged")
    (tmp_path / "wrong.toml").write_text("[[unit]]\nname = 3\n")
    lines = manifest.read_text().splitlines()
    columns = lines[0].split(",")
    given = [dict(zip(columns, line.split(","), strict=True)) for line in lines[1:]]
    given += [given[0] | {"log": "bad.parquet"}, given[0] | {"log": "none.csv"}, given[1] | {"vehicle": "wrong.toml"}]
    given[-1]["log"] = given[1]["log"]
    given = given[:1] + given[2:]
    write_manifest(manifest, given)
    result = run(manifest, out, settings=FAST, jobs=1)
    assert (result.unchanged, result.failed) == (1, 3)
    messages = [f"{subject.rpartition('/')[2]}: {message}" for subject, message in result.errors]
    assert "cut short or damaged" in " ".join(messages)
    for name in ("bad.parquet", "none.csv"):
        assert sum(message.count(name) for message in messages) == 1, "a log is named once"
    findings = [item.text for item in report(out, tmp_path / "fleet.html") if item.kind == "not processed"]
    assert [text.partition(";")[0] for text in findings] == ["1 trip was not processed"] * 3, "each kind is named"
    assert sum(bool(row["error"]) for row in rows(out, "trips")) == 3
    (tmp_path / "none.csv").write_bytes((tmp_path / given[0]["log"]).read_bytes())
    again = run(manifest, out, settings=FAST, jobs=1)
    assert (again.new, again.unchanged, again.failed) == (0, 2, 2), "the log that was missing has known samples"


def test_failed_trips_are_tried_again_when_they_may_succeed(tmp_path, monkeypatch) -> None:
    manifest, out = make_fleet(tmp_path, trucks=1, trips=1), tmp_path / "out"
    log = tmp_path / "logs/truck0_0.parquet"
    good = log.read_bytes()
    log.write_bytes(good[:1000])
    read = []
    monkeypatch.setattr("fifthwheel.apps.fleet.trips.read_log", lambda *a, **k: read.append(1) or fw.read_log(*a, **k))

    def result(**arguments):
        read.clear()
        found = run(manifest, out, settings=FAST, jobs=1, **arguments)
        assert len(found.errors) == found.failed, "a trip that is not tried again is reported again"
        return found.failed, len(read)

    assert result() == (1, 1)
    assert result() == (1, 0)
    assert result(retry=True) == (1, 1)
    monkeypatch.setenv("FIFTHWHEEL_READER_SECONDS", "61")
    assert result() == (1, 1), "limits of the readers have changed"
    monkeypatch.setattr("fifthwheel.apps.fleet.trips._packages", lambda: [("asammdf", "8.0")])
    assert result() == (1, 1), "a package was installed"
    assert result() == (1, 0)
    log.write_bytes(good)
    assert result() == (0, 1)

    def full(*_, **__):
        read.append(1)
        raise OSError("No space left on device")

    monkeypatch.setattr("fifthwheel.apps.fleet.trips.identify", full)
    other = {"settings": OTHER, "jobs": 1}
    assert [run(manifest, out, **other).failed for _ in range(2)] == [1, 1]
    assert len(read) == 5, "the disk may have space again"


def test_trips_of_several_manifests(copied) -> None:
    """Trips of earlier manifests stay; they do not count with other settings, and each loss is reported."""
    manifest, out = copied
    header, first, second = manifest.read_text().splitlines()

    def findings(*lines, settings=FAST):
        manifest.write_text("\n".join([header, *lines]))
        run(manifest, out, settings=settings, jobs=1)
        return [item.text for item in report(out, out.parent / "fleet.html")]

    assert findings(first) == []
    assert findings(second) == []
    assert rows(out, "trucks")[0]["trips"] == 2
    (text,) = findings(second, settings=OTHER)
    assert "truck0_0.parquet: processed with other settings" in text
    assert rows(out, "trucks")[0]["trips"] == 1
    assert findings(second) == []
    assert rows(out, "trucks")[0]["trips"] == 2


def test_a_log_that_was_moved_has_its_new_name(copied, monkeypatch) -> None:
    """And a truck that cannot be combined needs attention."""
    manifest, out = copied
    logs = manifest.parent / "logs"
    shutil.move(logs / "truck0_0.parquet", logs / "moved.parquet")
    manifest.write_text(manifest.read_text().replace("truck0_0", "moved"))
    assert run(manifest, out, settings=FAST, jobs=1).unchanged == 2
    for table in ("trips", "history"):
        assert {row["log"].rpartition("/")[2] for row in rows(out, table)} == {"moved.parquet", "truck0_1.parquet"}

    def refuse(*_, **__):
        raise FifthwheelError("two names of one unit")

    monkeypatch.setattr("fifthwheel.apps.fleet.tables.combine", refuse)
    assert run(manifest, out, settings=FAST, jobs=1).errors == [("truck 0", "two names of one unit")]
    (finding,) = report(out, out.parent / "fleet.html")
    assert (finding.truck, finding.kind) == ("truck 0", "not combined")
    assert "two names of one unit" in finding.text


def test_logs_that_are_read_in_part_need_attention(tmp_path) -> None:
    manifest, out = make_fleet(tmp_path, trucks=1, trips=2), tmp_path / "out"
    for name in ("truck0_0", "truck0_1"):
        path = tmp_path / "logs" / f"{name}.csv"
        fw.write_record(fw.read_log(path.with_suffix(".parquet")), path)
        lines = path.read_text().splitlines()
        path.write_text("\n".join([*lines[:100], "1,2", *lines[100:]])[:-3])
    manifest.write_text(manifest.read_text().replace(".parquet", ".csv"))
    result = run(manifest, out, settings=FAST, jobs=1)
    assert (result.new, result.failed) == (2, 0)
    short, uneven = report(out, tmp_path / "fleet.html")
    assert {short.kind, uneven.kind} == {"damaged log"}
    assert "2 logs are damaged" in short.text
    assert "may be cut short" in short.text
    assert "1 lines left out" in uneven.text


def test_the_page_escapes_names_and_lists_what_needs_attention(tmp_path) -> None:
    manifest, out = make_fleet(tmp_path, trucks=1, trips=2), tmp_path / "out"
    text = manifest.read_text().replace("truck 0", "<script>alert(1)</script>").replace(",A,", ",<b>A</b>,")
    manifest.write_text(text + text.splitlines()[-1].replace("truck0_1", "<img>") + "\n")
    run(manifest, out, settings=FAST, fleet=FleetSettings(wear=0.001), jobs=1)
    attention = report(out, tmp_path / "fleet.html")
    assert {"not processed", "tyre wear"} <= {item.kind for item in attention}
    page = (tmp_path / "fleet.html").read_text()
    assert "<script>alert" not in page
    assert "&lt;script&gt;alert" in page
    assert "<b>A" not in page
    assert "<img" not in page


def test_why_a_band_does_not_narrow() -> None:
    row = {"value": 5e5, "sigma": 5e4, "trips": 9, "excited_trips": 9, "limited_by": ["mass_scale"]}
    common, more = "70 % of the variance comes from the {}, common to the trips: measure {}.", "More trips narrow it."
    masses = "scale of all masses"
    for changes, text in (
        ({}, common.format(masses, "it")),
        ({"excited_trips": 1}, "Excitation: 1 of 9 trips determines it."),
        ({"excited_trips": 2}, "Excitation: 2 of 9 trips determine it."),
        ({"excited_trips": 3, "limited_fraction": 0.4}, more),
        ({"excited_trips": 2, "trips": 2, "limited_fraction": 0.4}, more),
        ({"sigma": 1e3}, ""),
        ({"limited_by": ["mass_scale", "road.bank"]}, common.format(f"{masses} and the bank of the road", "them")),
        ({"limited_by": [], "limited_fraction": 0.0}, more),
    ):
        assert limit(row | {"limited_fraction": 0.7} | changes) == text


def test_a_fleet_without_trips_and_wrong_settings(tmp_path):
    with pytest.raises(FifthwheelError, match="give the data set"):
        report(tmp_path, tmp_path / "fleet.html")
    assert run([], tmp_path, jobs=1).changes == 0
    assert rows(tmp_path, "trips") == []
    assert report(tmp_path, tmp_path / "fleet.html") == []
    for name, wrong in (("tyre_walk", -1), ("false_alarms", 0), ("wear", 2), ("height_limit", 0)):
        with pytest.raises(FifthwheelError, match=f"{name}: expected"):
            FleetSettings(**{name: wrong})
