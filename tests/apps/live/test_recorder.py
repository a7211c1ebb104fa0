"""The record: pieces and the whole file, a full disk, and a process that was killed."""

import pyarrow.parquet as pq
import pytest

from fifthwheel.apps.live.outputs import recorder
from fifthwheel.apps.live.outputs.recorder import PIECE, RECORD, BackgroundWriter, Recorder
from fifthwheel.base.errors import FifthwheelError


def row(k):
    roll = float("nan") if k < 5 else 0.1
    return {"time": 0.01 * k, "bus_time": 1.7e9 + 0.01 * k, "status": 0.0, "roll.tractor": roll}


def times(path):
    return pq.read_table(path)["time"].to_pylist()


def test_a_run_gives_one_file(tmp_path):
    """Columns that come later are empty before."""
    record = Recorder(path := tmp_path / "run.parquet", writer := BackgroundWriter())
    for k in range(2 * PIECE + 10):
        record.add(row(k) | ({"more": 1.0} if k >= PIECE else {}))
    record.close()
    writer.close()
    assert not writer.errors
    assert times(path) == [row(k)["time"] for k in range(2 * PIECE + 10)]
    assert pq.read_table(path)["more"].to_pylist() == [None] * PIECE + [1.0] * (PIECE + 10)
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_pieces_of_a_killed_run_are_readable_and_the_next_run_adds_to_them(tmp_path):
    path = tmp_path / "run.parquet"
    first = Recorder(path, writer := BackgroundWriter())
    for k in range(PIECE + 500):
        first.add(row(k))
    writer.close()  # the last 500 rows are lost, as with kill -9
    assert not path.exists()
    (piece,) = first.parts.iterdir()
    assert len(times(piece)) == PIECE
    again = Recorder(path, writer := BackgroundWriter())
    again.add(row(5000))
    again.close()
    writer.close()
    assert times(path) == [*(row(k)["time"] for k in range(PIECE)), 50.0]


def test_a_full_disk_is_survived_and_said(tmp_path, monkeypatch):
    writer, path = BackgroundWriter(), tmp_path / "run.parquet"
    record = Recorder(path, writer)

    def full(rows, path):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(record, "_write", full)
    record.add(row(0))
    record.flush()
    writer._jobs.put(("other", lambda: None))
    while not writer._jobs.empty():
        pass
    assert "No space left" in writer.errors[RECORD]
    monkeypatch.undo()
    record.add(row(1))
    record.close()
    writer.close()
    assert "rows that are not recorded: 1 (" in writer.errors[RECORD]  # at the end too, when the disk has space again
    assert "No space left" in writer.errors[RECORD]
    assert times(path) == [0.01]


def test_files_of_the_user_are_not_touched(tmp_path):
    path = tmp_path / "run.parquet"
    path.write_text("mine")
    with pytest.raises(FifthwheelError, match="no format"):
        Recorder(tmp_path / "run.csv", None)
    other = Recorder(path, writer := BackgroundWriter())
    (other.parts / "notes.txt").write_text("mine too")
    other.add(row(0))
    other.close()
    writer.close()
    assert (other.parts / "notes.txt").exists()
    assert recorder.PIECE == 1000
