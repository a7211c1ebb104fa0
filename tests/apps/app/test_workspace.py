"""The files of a workbench: versions, tabs that do not overwrite each other, names that lead nowhere else."""

import itertools
import json
import os
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import pytest

from fifthwheel.apps.app import workspace as module
from fifthwheel.apps.app.serve import serve
from fifthwheel.apps.app.workspace import CHOICES, HIDDEN, SIGNALS, VEHICLE, StaleError, Workspace
from fifthwheel.base.atomic import result_folder
from fifthwheel.base.errors import FifthwheelError

MAP = '[signals]\nspeed = "v"\n'


def test_changes_are_undone_and_repeated(tmp_path):
    """Also after a restart of the server, until there is a new change."""
    workspace = Workspace(tmp_path)
    assert workspace.undo() is None
    assert workspace.undoable() == (None, None)
    workspace.write({SIGNALS: MAP}, "first")
    workspace.write({SIGNALS: MAP + '"steer.tractor.front" = "w"\n', VEHICLE: "# x\n"}, "second")
    assert workspace.undo() == "second"
    assert (workspace.read(SIGNALS), workspace.read(VEHICLE)) == (MAP, None)
    assert workspace.undoable() == ("first", "second")
    assert workspace.redo() == "second"
    assert workspace.read(VEHICLE) == "# x\n"
    assert [workspace.undo(), workspace.undo(), workspace.undo()] == ["second", "first", None]
    assert not (tmp_path / SIGNALS).exists()
    workspace.write({SIGNALS: "# other\n"}, "other")
    assert workspace.undoable() == ("other", None)
    assert Workspace(tmp_path).undo() == "other"


def test_a_stale_tab_changes_nothing(tmp_path):
    one, other = Workspace(tmp_path), Workspace(tmp_path)
    one.write({SIGNALS: MAP}, "first")
    assert other.stale
    with pytest.raises(StaleError, match="another tab"):
        other.write({SIGNALS: "# lost\n"}, "second")
    with pytest.raises(StaleError):
        other.undo()
    assert one.read(SIGNALS) == MAP
    reloaded = Workspace(tmp_path)
    reloaded.write({SIGNALS: "# kept\n"}, "second")
    assert reloaded.undo() == "second"


def test_what_another_program_wrote_is_not_overwritten(tmp_path):
    workspace = Workspace(tmp_path)
    workspace.write({SIGNALS: MAP}, "first")
    (tmp_path / SIGNALS).write_text("# by hand\n")
    with pytest.raises(StaleError):
        workspace.write({SIGNALS: "# lost\n"}, "change")
    with pytest.raises(FifthwheelError, match=r"signals\.toml: changed by another program"):
        Workspace(tmp_path).undo()
    assert (tmp_path / SIGNALS).read_text() == "# by hand\n"


def test_a_damaged_state_costs_only_undo(tmp_path):
    Workspace(tmp_path).write({SIGNALS: MAP}, "first")
    for state in ("", "[]", "{", json.dumps({"version": 1})):
        (tmp_path / HIDDEN / "state.json").write_text(state)
        workspace = Workspace(tmp_path)
        assert workspace.undo() is None
        assert workspace.read(SIGNALS) == MAP


def test_choices_are_a_file_of_toml(tmp_path):
    workspace = Workspace(tmp_path)
    workspace.write_choices(workspace.choices().with_log("run 1.csv", exclude=((1.0, 2.5),)), "exclude")
    assert Workspace(tmp_path).choices().of("run 1.csv").exclude == ((1.0, 2.5),)
    (tmp_path / CHOICES).write_text("[logs.a]\nusing = true\n")
    with pytest.raises(FifthwheelError, match=r"workspace\.toml: logs\.a\.using"):
        Workspace(tmp_path).choices()


KEPT = {
    "run.csv": "logs/run.csv",
    "../../etc/passwd": "logs/passwd",
    "..\\..\\run.csv": "logs/run.csv",
    "/tmp/run.csv": "logs/run.csv",
    ".hidden.csv": "logs/hidden.csv",
    "Truck.DBC": "databases/Truck.DBC",
    "<b>x</b>.csv": "logs/b>.csv",
    "a\x1b[2Jb.csv": "logs/a\\u001b[2Jb.csv",
    "x" * 500 + ".csv": "logs/" + "x" * 176 + ".csv",
    "\u8f66" * 90 + ".csv": "logs/" + "\u8f66" * 58 + ".csv",
}


def test_dropped_files_stay_in_the_workspace(tmp_path):
    workspace = Workspace(tmp_path)
    for name, kept in KEPT.items():
        place = workspace.place_for(name)
        assert place == workspace.folder / kept
        assert place.parent.parent == workspace.folder


def test_a_dropped_file_replaces_none(tmp_path):
    workspace = Workspace(tmp_path)
    for expected in ("run.csv", "run (2).csv", "run (3).csv"):
        place = workspace.place_for("run.csv")
        place.write_text("x")
        assert place.name == expected
    for name in ("", "/", "...", "../.."):
        with pytest.raises(FifthwheelError, match="no name"):
            workspace.place_for(name)


@pytest.mark.parametrize("killed_at", [0, 1, 2])
def test_a_change_of_two_documents_that_was_killed_is_completed(tmp_path, monkeypatch, killed_at):
    """One of 25 kills left one new document and one old one."""
    before, after = {SIGNALS: MAP, CHOICES: "a = 1"}, {SIGNALS: MAP + "# new", CHOICES: None}
    workspace = Workspace(tmp_path)
    workspace.write(before, "first")
    write, count = module.write_text, itertools.count()

    def killed(path, text):
        if path.parent == tmp_path and next(count) == killed_at:
            raise KeyboardInterrupt
        write(path, text)

    monkeypatch.setattr(module, "write_text", killed)
    with suppress(KeyboardInterrupt):
        workspace.write(after, "second")
    monkeypatch.undo()
    new = Workspace(tmp_path)
    assert {name: new.read(name) for name in after} == after
    assert new.undo() == "second"
    assert {name: new.read(name) for name in before} == before


def test_the_state_of_a_stranger_names_no_other_file(tmp_path):
    workspace = Workspace(tmp_path / "space")
    workspace.write({SIGNALS: MAP}, "first")
    file = tmp_path / "space" / HIDDEN / "state.json"
    pending = {"../outside.toml": "x", "logs/run.csv": "x", SIGNALS: "# new"}
    state = json.loads(file.read_text())
    for wrong in ({SIGNALS: 3}, [], "text", None):
        file.write_text(json.dumps(state | {"pending": wrong}))
        assert Workspace(tmp_path / "space").read(SIGNALS) == MAP
    file.write_text(json.dumps(state | {"pending": pending}))
    assert Workspace(tmp_path / "space").read(SIGNALS) == "# new"
    assert not (tmp_path / "outside.toml").exists()
    assert not (tmp_path / "space" / "logs" / "run.csv").exists()


def test_dropped_files_of_one_name_at_once_are_all_kept(tmp_path):
    """Of four at once, two were kept, one of them a mixture of two."""
    workspace = Workspace(tmp_path)
    contents = [bytes([65 + k]) * 100_000 for k in range(20)]

    def drop(content: bytes) -> Path:
        part = workspace.part()
        part.write_bytes(content)
        return workspace.keep(part, "run.csv")

    with ThreadPoolExecutor(8) as pool:
        paths = list(pool.map(drop, contents))
    assert len(set(paths)) == 20
    assert [path.read_bytes() for path in paths] == contents
    assert not list(workspace.uploads.iterdir())


def test_what_a_killed_process_left_of_a_dropped_file_is_removed(tmp_path):
    workspace = Workspace(tmp_path)
    old, new = workspace.part(), workspace.part()
    os.utime(old, (0, 0))
    workspace.discard_parts()
    assert list(workspace.uploads.iterdir()) == [new]


def test_names_of_pages_lead_nowhere_else(tmp_path):
    workspace = Workspace(tmp_path)
    (tmp_path / SIGNALS).write_text(MAP)
    for name in ("../signals.toml", "/etc/passwd", "", "..", "no.csv"):
        for find in (workspace.log, workspace.run):
            with pytest.raises(FifthwheelError, match="no such"):
                find(name)
    with pytest.raises(FifthwheelError, match="GB free"):
        workspace.require_space(10**15)


def test_other_computers_need_a_token(tmp_path):
    for host in ("0.0.0.0", "192.168.1.7", "::"):
        with pytest.raises(FifthwheelError, match="--token"):
            serve(tmp_path, host=host)
    with pytest.raises(FifthwheelError, match="at least 8 characters"):
        serve(tmp_path, token="short")


def test_runs_are_renamed_and_removed(tmp_path):
    workspace = Workspace(tmp_path / "w")
    for name in ("a", "b"):
        (workspace.folder / "runs" / name).mkdir()
        (workspace.folder / "runs" / name / "identification.json").write_text(name)
    workspace.rename_run("a", "lane change")
    assert (workspace.run("lane change") / "identification.json").read_text() == "a"
    with pytest.raises(FifthwheelError, match="b: there is a run of this name already"):
        workspace.rename_run("lane change", "b")
    workspace.remove_run("lane change")
    assert [path.name for path in workspace.runs()] == ["b"]
    for name in ("a", "../w", "..", ""):
        with pytest.raises(FifthwheelError, match="no such run in the workspace"):
            workspace.remove_run(name)


def test_a_run_that_is_being_written_is_kept(tmp_path):
    workspace = Workspace(tmp_path / "w")
    folder = workspace.folder / "runs" / "a"
    with result_folder(folder, "identify", ["x"], inputs=[], force=False) as temporary:
        (temporary / "x").write_text("x")
        for change in (lambda: workspace.remove_run("a"), lambda: workspace.rename_run("a", "b")):
            with pytest.raises(FifthwheelError, match="in use by process"):
                change()
    workspace.rename_run("a", "b")
    assert sorted(path.name for path in workspace.run("b").iterdir()) == ["run.json", "x"]
