"""Files that appear complete or not at all."""

import errno
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from fifthwheel.base import atomic
from fifthwheel.base.atomic import atomic_write, reserved
from fifthwheel.base.errors import FifthwheelError


def test_a_file_appears_when_the_block_ends_and_an_error_leaves_the_old_one(tmp_path: Path) -> None:
    path, absent = tmp_path / "result.json", tmp_path / "absent" / "result.json"
    with atomic_write(path) as temporary:
        temporary.write_text("old")
        assert not path.exists()
    with pytest.raises(UnicodeEncodeError), atomic_write(path) as temporary:
        temporary.write_text("half\ud800", encoding="utf-8")
    with pytest.raises(OSError, match="No space") as caught, atomic_write(path):
        raise OSError(errno.ENOSPC, "No space left on device")  # as write() raises it
    assert caught.value.filename == str(path)
    with pytest.raises(OSError, match="absent") as caught, atomic_write(absent) as temporary:
        temporary.write_text("new")
    assert caught.value.filename == str(absent)  # not the temporary one
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_two_writers_of_one_file_do_not_collide(tmp_path: Path) -> None:
    """Both write at the same time; the file holds the text of one of them."""
    path, both, failures = tmp_path / "result.json", threading.Barrier(2), []

    def write(text: str) -> None:
        try:
            with atomic_write(path) as temporary:
                temporary.write_text(text[:1000])
                both.wait()
                temporary.write_text(text)
                both.wait()
        except BaseException as error:
            failures.append(error)
            raise

    threads = [threading.Thread(target=write, args=(letter * 2000,)) for letter in "ab"]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failures
    assert path.read_text() in ("a" * 2000, "b" * 2000)
    assert list(tmp_path.iterdir()) == [path]


def test_the_next_writer_removes_what_a_killed_one_left(tmp_path: Path) -> None:
    code = (
        "import os, sys, pathlib; from fifthwheel.base.atomic import *\n"
        "with reserved(pathlib.Path(sys.argv[1]), force=False):\n"
        "    with atomic_write(sys.argv[1]) as part: part.write_text('half'); os.kill(os.getpid(), 9)"
    )
    path = tmp_path / "log [1].csv"
    subprocess.run([sys.executable, "-c", code, path], check=False)
    assert len(list(tmp_path.iterdir())) == 2  # a temporary file and a lock
    with reserved(path, force=False), atomic_write(path) as live, atomic_write(path) as other:
        live.write_text("live")
        other.write_text("other")
    assert list(tmp_path.iterdir()) == [path]
    assert path.read_text() == "live"


def test_a_lock_that_ends_between_two_looks_is_taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its owner removed the file before its name could be read: one of two writers failed."""
    answers = [None, atomic.try_lock]

    def busy_once(path: Path) -> int | None:
        answer = answers.pop(0)
        return answer(path) if answer else None

    monkeypatch.setattr(atomic, "try_lock", busy_once)
    with atomic.held(tmp_path / "lock", subject=tmp_path):
        assert (tmp_path / "lock").exists()
    assert not answers


def test_a_name_is_reserved_for_one_writer_and_not_for_a_file_that_exists(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    in_use = pytest.raises(FifthwheelError, match=r"log\.csv: in use by process")
    with reserved(path, None, force=False), in_use, reserved(path, force=True):
        pass
    path.symlink_to("nowhere")
    with pytest.raises(FifthwheelError, match=r"log\.csv: exists; .*force=True"), reserved(path, force=False):
        pass
    with reserved(path, force=True):
        assert len(list(tmp_path.iterdir())) == 2
    assert list(tmp_path.iterdir()) == [path]
    with pytest.raises(FileNotFoundError) as caught, reserved(tmp_path / "absent" / "log.csv", force=False):
        pass
    assert caught.value.filename == str(tmp_path / "absent" / "log.csv")
