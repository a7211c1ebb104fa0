"""Files of a data set and the rows that it gives back; `test_cluster.py` has an object store."""

import datetime

import pyarrow as pa
import pytest

from fifthwheel.apps.fleet import dataset, storage
from fifthwheel.apps.fleet.dataset import TripDataset, batches
from fifthwheel.apps.fleet.trips import SCHEMA, parquet
from fifthwheel.base.errors import FifthwheelError

START = datetime.datetime(2026, 1, 1, tzinfo=datetime.UTC)


@pytest.fixture
def root(tmp_path):
    return str(tmp_path / "data")


def test_files_are_written_listed_read_and_removed(root) -> None:
    first, second = storage.joined(root, "b.parquet"), storage.joined(root, "a.parquet")
    assert storage.names(root, ".parquet") == []
    storage.write_bytes(first, b"12345")
    assert storage.names(root, ".parquet") == ["b.parquet"]
    storage.write_bytes(second, b"67")
    storage.write_bytes(storage.joined(root, "a.json"), b"")
    assert storage.names(root, ".parquet") == ["a.parquet", "b.parquet"]
    assert storage.read_bytes(first, 5) == b"12345"
    with pytest.raises(FifthwheelError, match=r"b.parquet: larger than .* MB; check the path"):
        storage.read_bytes(first, 4)
    assert abs(storage.modified(first) - datetime.datetime.now(datetime.UTC).timestamp()) < 60
    for _ in range(2):
        storage.remove(first)
    assert storage.names(root, ".parquet") == ["a.parquet"]
    with pytest.raises(FifthwheelError, match=r"(?i)b.parquet: cannot be read .*no such file"):
        storage.read_bytes(first, 5)


def test_a_local_file_is_no_copy(root) -> None:
    path = storage.joined(root, "log.csv")
    storage.write_bytes(path, b"12345")
    with storage.local_file(path) as local:
        assert (str(local), local.read_bytes()) == (path, b"12345")
    assert local.exists()


def test_errors_of_an_object_store_name_the_path(monkeypatch) -> None:
    """Others are faults of this package."""
    for kind in ("botocore.exceptions", "other"):
        error = type("Refused", (Exception,), {"__module__": kind})
        monkeypatch.setattr(storage, "filesystem", lambda _, error=error: (_ for _ in ()).throw(error("no rights")))
        with pytest.raises(error if kind == "other" else FifthwheelError, match="no rights") as caught:
            storage.read_bytes("s3://bucket/a", 1)
        assert ("s3://bucket/a: the object store refuses" in str(caught.value)) == (kind != "other")


def test_paths() -> None:
    for folder, name, expected in (
        ("/data", "a.csv", "/data/a.csv"),
        ("/data", "/srv/a.csv", "/srv/a.csv"),
        ("/data", "s3://b/a.csv", "s3://b/a.csv"),
        ("s3://b/data/", "a.csv", "s3://b/data/a.csv"),
        ("s3://b/data", "/srv/a.csv", "/srv/a.csv"),
    ):
        assert storage.joined(folder, name) == expected
        assert storage.stem(expected) == "a"
        assert storage.parent(expected) == expected.removesuffix("/a.csv")
    for path in ("a.csv", "/a:b.csv", "s3://b/a", "gs://b", "az://b/a"):
        assert storage.checked(path) == path
    for path in ("", "a\0b", "zip::s3://b/a", "s3://", "://a", "http://b/a"):
        with pytest.raises(FifthwheelError, match="expected a"):
            storage.checked(path)


def row(name, digest=None, *, at=0, log_digest=None, settings="s", **changes):
    finished = START + datetime.timedelta(seconds=at)
    known = {"log": name, "truck": "T", "date": START, "error": "", "digest": name if digest is None else digest}
    known |= {"finished": finished}
    return known | {"log_digest": log_digest or f"samples of {name}", "settings": settings} | changes


def write(data, name, rows):
    table = pa.Table.from_pylist(list(rows), schema=SCHEMA)
    storage.write_bytes(storage.joined(data.folder, name), parquet(table))


def test_rows_of_trips_by_digest(root) -> None:
    """From a part with several row groups, from single trips, and each once."""
    data = TripDataset(root)
    write(data, "part-1.parquet", [row(f"{k:03}") for k in range(250)])
    write(data, "trip-1.parquet", [row("single")])
    for wanted in (["000", "099"], ["100"], ["249", "single", "120", "000"], ["none"], []):
        assert sorted(r["digest"] for r in data.trips(wanted)) == sorted(d for d in wanted if d != "none")


def test_known_trips_and_those_that_failed(root) -> None:
    data = TripDataset(root)
    write(data, "trip-1.parquet", [row("b", "2" * 64)])
    write(data, "trip-2.parquet", [row("a", "1" * 64), row("c", "3" * 64, error="damaged")])
    write(data, "trip-3.parquet", [row("d", "", error="missing"), row("e", "")])
    done, failed = data.known()
    assert done.tolist() == [b"1" * 64, b"2" * 64]
    assert failed == {"3" * 64: "damaged"}


def test_joined_rows_are_those_of_the_single_trips(root, monkeypatch) -> None:
    """In parts of at most ROWS trips each."""
    monkeypatch.setattr(dataset, "ROWS", 3)
    data = TripDataset(root)
    data.join()
    for k in range(7):
        write(data, f"trip-{k}.parquet", [row(f"{k}", truck="TU"[k % 2])])
    data.join()
    names = storage.names(data.folder, ".parquet")
    assert len(names) == 3
    assert all(name.startswith("part-") and len(name) == len("part-.parquet") + 40 for name in names)
    assert sorted(r["digest"] for r in data.trips(map(str, range(7)))) == [str(k) for k in range(7)]
    data.join()
    assert storage.names(data.folder, ".parquet") == names


def test_which_rows_count(root) -> None:
    """Of a listed log that of this run, of another the last one; the same samples count once."""
    data = TripDataset(root)
    rows = [
        row("a", "a1", at=1),
        row("a", "a2", at=2),
        row("b", "b1", at=3),
        row("copy of b", "b2", at=4, log_digest="samples of b"),
        row("c", "c1", at=5, settings="other"),
        row("d", "d1", at=6, settings="other", error="damaged"),
        row("e", "e1", at=7, error="no log", log_digest=""),
        row("f", "f1", at=8, error="no log", log_digest=""),
        row("g", "g1", at=9, error="damaged", log_digest="samples of b"),
        row("h", "h1", at=10, error="damaged", truck="S"),
    ]
    write(data, "part-1.parquet", [r | {"log_digest": ""} if r["log"] in "ef" else r for r in rows])
    counting = data.counting({"a": "a1", "f": "f1"}, "s").to_pylist()
    expected = [("h", "h1"), ("a", "a1"), ("c", "c1"), ("copy of b", "b2"), ("d", "d1"), ("f", "f1")]
    assert [(r["log"], r["digest"]) for r in counting] == expected
    errors = {r["log"]: r["error"] for r in counting if r["error"]}
    assert errors.pop("c").startswith("processed with other settings")
    assert errors == {"d": "damaged", "f": "no log", "h": "damaged"}


def test_batches_are_of_whole_trucks(monkeypatch) -> None:
    """About BATCH trips at a time, without those that failed."""
    monkeypatch.setattr(dataset, "BATCH", 3)
    rows = [
        {"truck": truck, "digest": f"{truck}{k}", "log": f"{k}.csv", "error": ""} for truck in "TUV" for k in (1, 2)
    ]
    rows += [{"truck": "W", "digest": "W1", "log": "1.csv", "error": "damaged"}]
    found = list(batches(pa.Table.from_pylist(rows)))
    assert [[truck for truck, _ in batch] for batch in found] == [["T", "U"], ["V"]]
    assert found[0][0] == ("T", {"T1": "1.csv", "T2": "2.csv"})
    assert [[truck for truck, _ in batch] for batch in batches(pa.Table.from_pylist(rows[:4]))] == [["T", "U"]]
    assert list(batches(pa.Table.from_pylist(rows[6:]))) == []


def test_a_damaged_table_is_named(tmp_path) -> None:
    data = TripDataset(str(tmp_path))
    write(data, "part-1.parquet", [row("a")])
    path = storage.joined(data.folder, "part-1.parquet")
    content = bytearray(storage.read_bytes(path, 1_000_000))
    content[10] ^= 255
    storage.write_bytes(path, bytes(content))
    with pytest.raises(FifthwheelError, match=r"part-1.parquet: damaged"):
        data.trips(["a"])
