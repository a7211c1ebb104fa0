"""Files that appear complete or not at all."""

import threading
from pathlib import Path

import pytest

from fifthwheel._atomic import atomic_write


def test_a_file_appears_when_the_block_ends(tmp_path: Path) -> None:
    path = tmp_path / "result.json"
    with atomic_write(path) as temporary:
        temporary.write_text("new")
        assert not path.exists()
    assert path.read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]


def test_an_error_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "result.json"
    path.write_text("old")
    with pytest.raises(UnicodeEncodeError), atomic_write(path) as temporary:
        temporary.write_text("half\ud800", encoding="utf-8")
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


def test_an_error_names_the_file_and_not_the_temporary_one(tmp_path: Path) -> None:
    with (
        pytest.raises(OSError, match="absent") as caught,
        atomic_write(tmp_path / "absent" / "result.json") as temporary,
    ):
        temporary.write_text("new")
    assert caught.value.filename == str(tmp_path / "absent" / "result.json")
