"""Manifests of strangers: paths as written, limits, and errors that name row and column."""

import datetime

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from fifthwheel.apps.fleet import manifest
from fifthwheel.apps.fleet.manifest import read_manifest
from fifthwheel.base.errors import FifthwheelError

HEAD = "log,truck,trailer,vehicle,signals,load,date\n"


def read(folder, text):
    path = folder / "manifest.csv"
    path.write_text(text, encoding="utf-8")
    return read_manifest(str(path))


def test_relative_paths_belong_to_the_folder_of_the_manifest(tmp_path) -> None:
    (trip,) = read(tmp_path, HEAD + "a/run.csv,T1,A,/srv/truck.toml,map.toml,steel,2026-03-01T14:30\n")
    assert trip.log == str(tmp_path / "a" / "run.csv")
    assert trip.vehicle == "/srv/truck.toml"
    assert trip.signals == str(tmp_path / "map.toml")
    assert trip.date == datetime.datetime(2026, 3, 1, 14, 30, tzinfo=datetime.UTC)


def test_a_vehicle_of_the_catalogue_is_no_path(tmp_path) -> None:
    first, second = read(tmp_path, "log,truck,vehicle\nrun.csv,T1,cheng_cebon_2011\ncheng_cebon_2011,T1,truck.toml\n")
    assert (first.vehicle, first.date, first.load) == ("cheng_cebon_2011", None, "")
    assert (second.log, second.vehicle) == (str(tmp_path / "cheng_cebon_2011"), str(tmp_path / "truck.toml"))


def test_paths_count_as_written(tmp_path) -> None:
    for written in ("~/run.csv", "$HOME/run.csv", "*.csv", "{a,b}.csv"):
        (trip,) = read(tmp_path, f'log,truck,vehicle\n"{written}",T1,truck.toml\n')
        assert trip.log == str(tmp_path / written)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("log,truck\n", "column vehicle: missing"),
        ("log,truck,vehicle,lod\n", "column lod: unknown; did you mean 'load' or 'log'"),
        ("log,log,truck,vehicle\n", "same name"),
        (HEAD, "no rows"),
        (HEAD + "a.csv,T,A,v.toml,,,\n,T,A,v.toml,,,\n", "row 2, column log: empty"),
        (HEAD + "a.csv,T,A,v.toml,,,yesterday\n", "row 1, column date: expected a date such as 2026-03-01"),
        (HEAD + "a.csv,T,A,v.toml,,,0001-01-01\n", "row 1, column date: expected a year"),
        (HEAD + "a.csv,T,A,v.toml,,,1969-12-31\n", "row 1, column date: expected a year from 1970 to 2199, got 1969"),
        (HEAD + "a.csv,T,A,v.toml,,,2200-01-01\n", "row 1, column date: expected a year from 1970 to 2199, got 2200"),
        (HEAD + "http://x/a.csv,T,A,v.toml,,,\n", "row 1, column log: .*copy the file there"),
        (HEAD + "simplecache::s3://x/a.csv,T,A,v.toml,,,\n", "row 1, column log: expected a path"),
        (HEAD + "s3://,T,A,v.toml,,,\n", "row 1, column log"),
        (HEAD + "a.csv,T,A,v.toml,,,,,\n", "row 1: 9 cells, expected 7"),
        (HEAD + f"a.csv,{'T' * 1001},A,v.toml,,,\n", "row 1, column truck: 1001 characters"),
        (HEAD + "a.csv,\x1b[2J,A,v.toml,,,\n", "row 1, column truck: control characters"),
        (HEAD + 'a.csv,"T,A,v.toml,,,\n', "row 1: not CSV"),
        (HEAD + f"a.csv,{'T' * 200_000},A,v.toml,,,\n", "row 1: not CSV .*field larger"),
    ],
)
def test_errors_name_row_and_column(tmp_path, text, message) -> None:
    with pytest.raises(FifthwheelError, match=message):
        read(tmp_path, text)


def test_dates_are_in_utc(tmp_path) -> None:
    for written, expected in (
        (" 1970-01-01 ", datetime.datetime(1970, 1, 1)),
        ("2199-12-31T23:59:59", datetime.datetime(2199, 12, 31, 23, 59, 59)),
        ("2026-03-01T14:30+02:00", datetime.datetime(2026, 3, 1, 12, 30)),
        ("", None),
    ):
        (trip,) = read(tmp_path, HEAD + f"a.csv,T,A,v.toml,,,{written}\n")
        assert trip.date == (expected and expected.replace(tzinfo=datetime.UTC))


def test_limits(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(manifest, "MAX_TRIPS", 1)
    assert [trip.truck for trip in read(tmp_path, "log,truck,vehicle\na,T,v\n")] == ["T"]
    longest = "T" * manifest.MAX_CELL
    assert read(tmp_path, f"log,truck,vehicle\na, {longest} ,v\n")[0].truck == longest
    with pytest.raises(FifthwheelError, match="more than 1 rows"):
        read(tmp_path, "log,truck,vehicle\na,T,v\nb,T,v\n")
    monkeypatch.setattr(manifest, "MAX_SIZE", 10)
    with pytest.raises(FifthwheelError, match="larger than"):
        read(tmp_path, "log,truck,vehicle\na,T,v\n")


def test_parquet(tmp_path) -> None:
    path = tmp_path / "manifest.parquet"
    columns = {"log": ["a.csv"], "truck": ["T"], "vehicle": ["v.toml"], "date": [datetime.date(2026, 3, 1)]}
    pq.write_table(pa.table(columns), path)
    (trip,) = read_manifest(str(path))
    assert trip.date == datetime.datetime(2026, 3, 1, tzinfo=datetime.UTC)
    pq.write_table(pa.table({**columns, "truck": [7]}), path)
    with pytest.raises(FifthwheelError, match="row 1, column truck: expected a text, got 7"):
        read_manifest(str(path))
    path.write_bytes(b"PAR1" + b"\0" * 100)
    with pytest.raises(FifthwheelError, match="damaged Parquet"):
        read_manifest(str(path))
    with pytest.raises(FifthwheelError, match="not a regular file"):
        read_manifest("/dev/zero")
