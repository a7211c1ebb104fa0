"""Results are replaced as a whole, whenever their process is killed, and files of the user stay."""

import errno
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from fifthwheel.base.atomic import MANIFEST, atomic_write, one_run, recover, replaced_result, result_folder
from fifthwheel.base.errors import FifthwheelError

OLD = {"a.json": "old a", "b.toml": "old b", "figures/old/c.svg": "old c"}
NEW = {"a.json": "new a", "b.toml": "new b", "figures/new/d.svg": "new d"}
FOREIGN = {"signals.toml": "mine", "figures/mine.svg": "mine too", ".hidden": "mine as well"}

KILLED = """
import itertools, os, shutil, signal, sys
from pathlib import Path
from fifthwheel.base.atomic import result_folder

def run(folder, steps):
    def count(event, arguments):
        nonlocal steps
        if event in ("os.rename", "os.remove", "os.rmdir", "os.mkdir"):
            steps -= 1
            if steps < 0:
                os.kill(os.getpid(), signal.SIGKILL)
    sys.addaudithook(count)
    with result_folder(folder, "identify", [], inputs=[], force=False) as new:
        for name, text in FILES.items():
            (new / name).parent.mkdir(parents=True, exist_ok=True)
            (new / name).write_text(text)

root = Path(sys.argv[1])
for steps in itertools.count():
    shutil.copytree(root / "old", root / str(steps))
    if (child := os.fork()) == 0:
        run(root / str(steps), steps)
        os._exit(0)
    if os.waitpid(child, 0)[1] == 0:
        break
    assert steps < 100
"""


@pytest.fixture(scope="module")
def killed(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Folders of results whose next run was killed before its first, second, ... change of the file system."""
    if not hasattr(os, "fork"):
        pytest.skip("no SIGKILL")
    root = tmp_path_factory.mktemp("killed")
    write(root / "old", FOREIGN)
    run(root / "old", OLD)
    subprocess.run([sys.executable, "-c", KILLED.replace("FILES", repr(NEW)), root], check=True)
    return [root / str(k) for k in range(len(list(root.iterdir())) - 2)]


def write(folder: Path, files: dict[str, str]) -> None:
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)


def run(folder: Path, files: dict[str, str], **options: object) -> None:
    given = {"command": "identify", "names": ["a.json"], "inputs": [], "force": False} | options
    with result_folder(folder, **given) as new:  # type: ignore[arg-type]
        write(new, files)


def contents(folder: Path) -> dict[str, str]:
    """The text of every file besides the manifest."""
    files = {path.relative_to(folder).as_posix(): path for path in folder.rglob("*") if path.is_file()}
    return {name: path.read_text() for name, path in files.items() if name != MANIFEST}


@pytest.mark.slow
def test_a_run_killed_at_any_step_leaves_the_old_or_the_new_results(killed: list[Path], tmp_path: Path) -> None:
    outcomes = []
    for source in killed:
        folder = shutil.copytree(source, tmp_path / source.name)
        assert FOREIGN.items() <= contents(folder).items()
        if (folder / MANIFEST).exists():  # the promise to other programs
            assert contents(folder).items() >= (OLD if "figures/old/c.svg" in contents(folder) else NEW).items()
        recover(folder)
        found = {name: text for name, text in contents(folder).items() if not name.startswith(".fifthwheel")}
        assert found in (OLD | FOREIGN, NEW | FOREIGN)
        outcomes.append(found == NEW | FOREIGN)
        run(folder, OLD)
        assert contents(folder) == OLD | FOREIGN  # nor is anything hidden left
    assert outcomes == sorted(outcomes)
    assert 5 < sum(outcomes) < len(outcomes) - 5


def test_a_first_run_that_fails_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(TypeError):
        run(tmp_path / "out", NEW | {"z.json": None})  # type: ignore[dict-item]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["a.json", "run.json", "figures/new/d.svg"])
def test_files_of_the_user_are_replaced_only_with_force(name: str, tmp_path: Path) -> None:
    write(tmp_path, {name: "mine"})
    with pytest.raises(FifthwheelError, match=rf"{name}: not written by an earlier fifthwheel identify.*force=True"):
        run(tmp_path, NEW)
    assert contents(tmp_path) | {MANIFEST: (tmp_path / name).read_text()} == {name: "mine"} | {MANIFEST: "mine"}
    run(tmp_path, NEW, force=True)
    assert contents(tmp_path) == NEW


def test_a_result_that_was_edited_is_replaced_only_with_force(tmp_path: Path) -> None:
    run(tmp_path, OLD)
    write(tmp_path, {"b.toml": "edited", "figures/old/c.svg": "edited"})
    with pytest.raises(FifthwheelError, match=r"b\.toml: not written by .*, or changed since"):
        run(tmp_path, NEW)
    run(tmp_path, NEW, force=True)
    assert contents(tmp_path) == NEW | {"figures/old/c.svg": "edited"}  # not in the way, so not lost
    shutil.rmtree(tmp_path / "figures")
    run(tmp_path, OLD)  # nor is an edit during the run lost
    with pytest.raises(FifthwheelError, match=r"b\.toml: .*changed since"):
        run(tmp_path, {"../../b.toml": "edited", **NEW})
    assert contents(tmp_path) == OLD | {"b.toml": "edited"}


def test_an_edit_after_a_kill_is_not_lost(killed: list[Path], tmp_path: Path) -> None:
    source = next(folder for folder in killed if (folder / ".fifthwheel/commit.json").exists())
    folder = shutil.copytree(source, tmp_path / "out")
    write(folder, {"b.toml": "edited"})
    for step in (lambda: recover(folder), lambda: run(folder, NEW)):
        with pytest.raises(FifthwheelError, match=r"b\.toml: has changed since a run was killed"):
            step()
    assert contents(folder)["b.toml"] == "edited"
    (folder / "b.toml").unlink()
    recover(folder)
    assert contents(folder).items() >= NEW.items()


def test_results_of_another_command_are_replaced_only_with_force(tmp_path: Path) -> None:
    run(tmp_path, OLD)
    with pytest.raises(FifthwheelError, match=r"contains the results of fifthwheel identify; .*out.*force=True"):
        run(tmp_path, NEW, command="states")
    run(tmp_path, {"a.json": "of states"}, command="states", force=True)
    assert contents(tmp_path) == {"a.json": "of states"}


@pytest.mark.parametrize("link", ["", "symlink_to", "hardlink_to"])
def test_an_input_is_replaced_only_with_force(link: str, tmp_path: Path) -> None:
    run(tmp_path / "out", OLD)
    given = tmp_path / "out" / "b.toml"
    if link:
        getattr(tmp_path / "linked.toml", link)(given)
        given = tmp_path / "linked.toml"
    with pytest.raises(FifthwheelError, match=r"out/b\.toml: is an input of this command"):
        run(tmp_path / "out", NEW, inputs=[given])
    assert given.read_text() == "old b"
    run(tmp_path / "out", NEW, inputs=[tmp_path / "out/figures/old/c.svg", tmp_path / "absent"])  # only read: it stays
    assert contents(tmp_path / "out") == NEW | {"figures/old/c.svg": "old c"}


def test_one_run_at_a_time(tmp_path: Path) -> None:
    message = rf": in use by process {os.getpid()} on .*; wait until it ends"
    with (
        result_folder(tmp_path, "identify", [], inputs=[], force=False),
        pytest.raises(FifthwheelError, match=message),
    ):
        run(tmp_path, NEW)
    run(tmp_path, NEW)


@pytest.mark.parametrize("place", ["a.json", "figures"])
def test_what_cannot_be_replaced_is_refused_before_anything_changes(place: str, tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "out").mkdir()
    if place == "figures":
        (tmp_path / "out" / place).symlink_to(tmp_path / "elsewhere")  # leads out of the folder
    else:
        (tmp_path / "out" / place).mkdir()
    with pytest.raises(FifthwheelError, match=rf"{place}: .*folder; move it away"):
        run(tmp_path / "out", NEW, force=True)
    assert [path.name for path in (tmp_path / "out").iterdir()] == [place]
    assert list((tmp_path / "elsewhere").iterdir()) == []


def test_a_full_disk_names_the_file_and_leaves_the_old_results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(path: Path, *_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device", str(path))

    run(tmp_path, OLD)
    for call in ("write_text", "mkdir", "replace"):
        with monkeypatch.context() as patch:
            patch.setattr(Path, call, full)
            with (
                pytest.raises(OSError, match="No space left") as caught,
                result_folder(tmp_path, "identify", [], inputs=[], force=False) as new,
                atomic_write(new / "a.json") as temporary,
            ):
                temporary.write_text("new")
        assert caught.value.filename == str(tmp_path if call == "mkdir" else tmp_path / "a.json")
        assert contents(tmp_path) == OLD
    monkeypatch.setattr(os, "write", lambda *_: full(tmp_path))  # not even the name of the process fits
    with pytest.raises(OSError, match="No space left"):
        run(tmp_path / "out", NEW)
    assert contents(tmp_path) == OLD


def test_reading_files_of_one_run(tmp_path: Path) -> None:
    run(tmp_path, OLD)
    paths = (tmp_path / "a.json", tmp_path / "b.toml")
    with one_run(*paths):
        assert paths[0].read_text() == "old a"
    with pytest.raises(FifthwheelError, match="another run has replaced its results"), one_run(*paths):
        run(tmp_path, NEW)
    paths[1].write_text("edited")
    with (
        pytest.raises(FifthwheelError, match=r"b\.toml: has changed since fifthwheel identify wrote it"),
        one_run(*paths),
    ):
        pass
    (tmp_path / MANIFEST).unlink()
    with one_run(*paths):  # results of a version without manifests, or of Python
        pass


@contextmanager
def hostile_folder(folder: Path, journal: object) -> Iterator[Path]:
    (folder / ".fifthwheel" / "new").mkdir(parents=True)
    (folder / ".fifthwheel" / "commit.json").write_text(json.dumps(journal))
    yield folder / ".fifthwheel" / "new"


def test_a_journal_from_elsewhere_moves_nothing_out_of_the_folder_or_into_it(tmp_path: Path) -> None:
    write(tmp_path / "home", {"secret": "mine"})
    for k, (journal, link) in enumerate(
        [
            ({"replaces": {}, "removes": {"../home/secret": "?"}}, ""),
            ({"replaces": {"secret": None}, "removes": {}}, "new"),
            ({"replaces": {"home/key": None}, "removes": {}}, "home"),
            ({}, ""),
            ([], ""),
        ]
    ):
        with hostile_folder(tmp_path / str(k), journal) as new:
            if link == "new":
                new.rmdir()
                new.symlink_to(tmp_path / "home")
            elif link == "home":
                write(new, {"home/key": "not mine"})
                (tmp_path / str(k) / "home").symlink_to(tmp_path / "home")
        with pytest.raises(FifthwheelError, match=r"damaged; remove|expected a folder"):
            recover(tmp_path / str(k))
        assert contents(tmp_path / "home") == {"secret": "mine"}


def test_one_result_is_replaced_with_its_digest_unless_it_fails_or_has_changed(tmp_path: Path) -> None:
    run(tmp_path, OLD)
    with replaced_result(tmp_path / "a.json") as new:
        new.write_text("newer a")
    assert (tmp_path / "a.json").read_text() == "newer a"
    with one_run(tmp_path / "a.json", tmp_path / "b.toml"):
        pass
    assert json.loads((tmp_path / MANIFEST).read_text())["command"] == "identify"
    assert not (tmp_path / ".fifthwheel").exists()
    run(tmp_path, NEW)  # it counts as the run's own
    with suppress(ZeroDivisionError), replaced_result(tmp_path / "a.json") as new:
        new.write_text("half")
        raise ZeroDivisionError
    with one_run(tmp_path / "a.json"):
        assert (tmp_path / "a.json").read_text() == NEW["a.json"]
    assert not (tmp_path / ".fifthwheel").exists()
    with replaced_result(tmp_path / "other.json") as path:  # no result: written itself
        assert path == tmp_path / "other.json"
    (tmp_path / "a.json").write_text("mine")
    with (
        pytest.raises(FifthwheelError, match="changed since fifthwheel identify"),
        replaced_result(tmp_path / "a.json"),
    ):
        pytest.fail("not reached")
    assert (tmp_path / "a.json").read_text() == "mine"
