"""Files of a data set, local or in an object store, and the rows that it gives back."""

import datetime
import shutil

import pyarrow as pa
import pytest

from fifthwheel.apps.fleet import dataset, storage
from fifthwheel.apps.fleet.dataset import TripDataset, batches
from fifthwheel.apps.fleet.trips import SCHEMA, parquet
from fifthwheel.base.errors import FifthwheelError

START = datetime.datetime(2026, 1, 1, tzinfo=datetime.UTC)


class Store:
    """An object store: a folder without folders in it, whose listing is cached."""

    def __init__(self, folder):
        self.folder, self.listing = folder, None

    def _path(self, name):
        return self.folder / name.replace("/", "|")

    def size(self, name):
        return self._path(name).stat().st_size

    def get_file(self, name, target):
        shutil.copy(self._path(name), target)

    def cat_file(self, name, end):
        return self._path(name).read_bytes()[:end]

    def pipe_file(self, name, data):
        self._path(name).write_bytes(data)

    def invalidate_cache(self):
        self.listing = None

    def ls(self, name, detail):
        assert not detail
        self.listing = self.listing or [path.name.replace("|", "/") for path in self.folder.iterdir()]
        found = [path for path in self.listing if path.startswith(f"{name}/")]
        if not found:
            raise FileNotFoundError(name)
        return sorted(found, reverse=True)

    def exists(self, name):
        return self._path(name).exists()

    def rm_file(self, name):
        self._path(name).unlink()

    def modified(self, name):
        return datetime.datetime.fromtimestamp(self._path(name).stat().st_mtime, datetime.UTC)


@pytest.fixture(params=["local", "s3"])
def root(request, tmp_path, monkeypatch):
    """A folder, and a prefix of an object store."""
    if request.param == "local":
        return str(tmp_path / "data")
    (tmp_path / "store").mkdir()
    store = Store(tmp_path / "store")
    monkeypatch.setattr(storage, "filesystem", lambda path: (store, path.removeprefix("s3://")))
    return "s3://bucket/data"


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


def test_a_local_file_has_the_content_and_the_name(root, monkeypatch) -> None:
    path = storage.joined(root, "log.csv")
    storage.write_bytes(path, b"12345")
    monkeypatch.setattr(storage, "MAX_LOG_SIZE", 5)
    with storage.local_file(path) as local:
        assert (local.name, local.read_bytes()) == ("log.csv", b"12345")
    assert local.exists() != storage.is_remote(path), "a copy is removed"
    if storage.is_remote(path):
        monkeypatch.setattr(storage, "MAX_LOG_SIZE", 4)
        with pytest.raises(FifthwheelError, match="cut the log into trips"), storage.local_file(path):
            pass


@pytest.mark.parametrize("kind", ["botocore.exceptions", "other"])
def test_errors_of_an_object_store_name_the_path(monkeypatch, kind) -> None:
    """Others are faults of this package."""
    error = type("Refused", (Exception,), {"__module__": kind})

    def refuse(_):
        raise error("no rights")

    monkeypatch.setattr(storage, "filesystem", refuse)
    expected = FifthwheelError if kind != "other" else error
    with pytest.raises(expected, match="no rights") as caught:
        storage.read_bytes("s3://bucket/a", 1)
    assert ("s3://bucket/a: the object store refuses" in str(caught.value)) == (kind != "other")


@pytest.mark.parametrize(
    ("folder", "name", "expected"),
    [
        ("/data", "a.csv", "/data/a.csv"),
        ("/data", "/srv/a.csv", "/srv/a.csv"),
        ("/data", "s3://b/a.csv", "s3://b/a.csv"),
        ("s3://b/data/", "a.csv", "s3://b/data/a.csv"),
        ("s3://b/data", "/srv/a.csv", "/srv/a.csv"),
    ],
)
def test_joined_paths(folder, name, expected) -> None:
    assert storage.joined(folder, name) == expected
    assert storage.stem(expected) == "a"
    assert storage.parent(expected) == expected.removesuffix("/a.csv")


@pytest.mark.parametrize("path", ["a.csv", "/a:b.csv", "s3://b/a", "gs://b", "az://b/a"])
def test_paths_that_are_accepted(path) -> None:
    assert storage.checked(path) == path


@pytest.mark.parametrize("path", ["", "a\0b", "zip::s3://b/a", "s3://", "://a", "http://b/a"])
def test_paths_that_are_refused(path) -> None:
    with pytest.raises(FifthwheelError, match="expected a"):
        storage.checked(path)


def row(name, digest=None, *, at=0, log_digest=None, settings="s", **changes):
    finished = START + datetime.timedelta(seconds=at)
    known = {
        "log": name,
        "truck": "T",
        "date": START,
        "error": "",
        "digest": name if digest is None else digest,
        "finished": finished,
    }
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
    assert [(r["log"], r["digest"]) for r in counting] == [
        ("h", "h1"),
        ("a", "a1"),
        ("c", "c1"),
        ("copy of b", "b2"),
        ("d", "d1"),
        ("f", "f1"),
    ]
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
