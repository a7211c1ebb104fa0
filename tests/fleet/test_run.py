"""A run over a small fleet in this process: results, what is done again, damaged trips, the page."""

import pyarrow.parquet as pq
import pytest

import fifthwheel as fw
from fifthwheel.errors import FifthwheelError
from fifthwheel.fleet import FleetSettings, report, run
from fifthwheel.fleet.dataset import TripDataset
from tests.fleet.make import DRIVE, FAST, TRUCK, make_fleet, write_manifest


def rows(path, name):
    return pq.read_table(path / f"{name}.parquet").to_pylist()


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


def test_a_trip_that_is_done_is_not_done_again(fleet, tmp_path) -> None:
    folder, manifest, _ = fleet
    before = TripDataset(str(folder / "out")).index()
    again = run(manifest, folder / "out", settings=FAST, jobs=1)
    assert (again.new, again.unchanged) == (0, 6)
    assert TripDataset(str(folder / "out")).index().equals(before)


def test_other_settings_replace_a_trip_and_never_count_it_twice(tmp_path) -> None:
    manifest, out = make_fleet(tmp_path, trucks=1, trips=2), tmp_path / "out"
    run(manifest, out, settings=FAST, jobs=1)
    first = rows(out, "trucks")
    other = run(manifest, out, settings=fw.OneStage(**{**vars(FAST), "prior": 0.31}), jobs=1)
    assert other.new == 2
    assert len(TripDataset(str(out)).index()) == 2
    assert rows(out, "trucks")[0]["trips"] == 2
    assert rows(out, "trucks")[0]["sigma"] == pytest.approx(first[0]["sigma"], rel=0.02)


def test_damaged_trips_are_recorded_and_stop_nothing(tmp_path) -> None:
    manifest, out = make_fleet(tmp_path, trucks=1, trips=2), tmp_path / "out"
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
    assert (result.new, result.failed) == (1, 3)
    messages = [f"{subject.rpartition('/')[2]}: {message}" for subject, message in result.errors]
    assert "cut short or damaged" in " ".join(messages)
    for name in ("bad.parquet", "none.csv"):
        assert sum(message.count(name) for message in messages) == 1, "a log is named once"
    findings = [item.text for item in report(out, tmp_path / "fleet.html") if item.kind == "not processed"]
    assert [text.partition(";")[0] for text in findings] == ["1 trip was not processed"] * 3, "each kind is named"
    errors = [row["error"] for row in TripDataset(str(out)).index().to_pylist() if row["error"]]
    assert len(errors) == 3
    (tmp_path / "none.csv").write_bytes((tmp_path / given[0]["log"]).read_bytes())
    again = run(manifest, out, settings=FAST, jobs=1)
    assert again.unchanged + again.new == 4 - again.failed
    assert again.failed == 0, "a missing log is tried again, a damaged one is not"


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


def test_load_height_beyond_a_limit(tmp_path) -> None:
    manifest, out = make_fleet(tmp_path, trucks=1, trips=1), tmp_path / "out"
    settings = fw.OneStage(consider={})
    run(manifest, out, settings=settings, fleet=FleetSettings(height_limit=0.5), jobs=1)
    (finding,) = report(out, tmp_path / "fleet.html")
    assert finding.kind == "load height"
    assert "steel" in finding.text
    assert "above 0.50 m" in finding.text


def test_no_data_set(tmp_path) -> None:
    with pytest.raises(FifthwheelError, match="give the data set"):
        report(tmp_path, tmp_path / "fleet.html")


@pytest.mark.parametrize("wrong", [{"tyre_walk": -1}, {"false_alarms": 0}, {"wear": 2}, {"height_limit": 0}])
def test_settings_are_checked(wrong) -> None:
    with pytest.raises(FifthwheelError, match=f"{next(iter(wrong))}: expected"):
        FleetSettings(**wrong)


def test_a_fleet_without_trips(tmp_path):
    assert run([], tmp_path, jobs=1).changes == 0
    assert TripDataset(str(tmp_path)).index().num_rows == 0
    assert report(tmp_path, tmp_path / "fleet.html") == []
