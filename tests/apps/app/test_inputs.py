"""The inputs of a workspace as data: logs that are read once, proposals, evidence, excluded windows."""

import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from fifthwheel import read_log
from fifthwheel.apps.app import inputs
from fifthwheel.apps.app.workspace import SIGNALS, Workspace
from fifthwheel.base.atomic import try_lock
from fifthwheel.base.errors import FifthwheelError, SignalError
from fifthwheel.data.logs import SignalMap

LOG = Path(__file__).parents[3] / "examples" / "lane_changes.csv"
NAME = LOG.name


@pytest.fixture
def workspace(tmp_path):
    found = Workspace(tmp_path)
    shutil.copy(LOG, found.place_for(NAME))
    return found


def test_the_record_is_that_of_the_file(workspace):
    record, direct = inputs.record(workspace.folder, NAME), read_log(LOG)
    assert record.name == direct.name
    np.testing.assert_array_equal(record.time, direct.time)
    for signal, values in direct.signals.items():
        np.testing.assert_array_equal(record.signals[signal], values)


def test_a_log_is_read_once_and_again_when_it_or_a_database_changes(workspace):
    titles = []
    store = lambda: inputs.store(workspace.folder, NAME, lambda title, done, total: titles.append(title))  # noqa: E731
    store()
    assert inputs.is_stored(workspace, NAME)
    assert f"reading {NAME}" in titles
    titles.clear()
    store()
    assert not titles
    path = workspace.log(NAME)
    os.utime(path, ns=(1, 1))
    assert not inputs.is_stored(workspace, NAME)
    store()
    workspace.place_for("truck.dbc").write_text('VERSION ""\n')
    assert not inputs.is_stored(workspace, NAME)
    store()
    assert len(list((workspace.folder / ".workbench" / "logs").iterdir())) == 1


def test_a_log_that_cannot_be_read_leaves_nothing(workspace):
    workspace.place_for("broken.csv").write_bytes(b"\x00\x01" * 5000)
    with pytest.raises(SignalError, match=r"broken\.csv"):
        inputs.store(workspace.folder, "broken.csv")
    assert not inputs.is_stored(workspace, "broken.csv")
    assert not list((workspace.folder / ".workbench" / "logs").iterdir())
    with pytest.raises(SignalError, match="not read yet"):
        inputs.opened(workspace, "broken.csv")


def test_a_long_log_is_proposed_and_compared_by_its_steered_part(workspace, monkeypatch):
    text = inputs.propose(workspace.folder, NAME)
    monkeypatch.setattr(inputs, "EVIDENCE_SPAN", 13.0)
    assert SignalMap.parse(inputs.propose(workspace.folder, NAME)) == SignalMap.parse(text)
    workspace.write({SIGNALS: text}, "propose")
    evidence = inputs.evidence(workspace.folder, NAME)
    assert np.ptp(evidence.time) <= 13.0
    assert evidence.channels["yaw_rate.semitrailer"].explained > 0.9


def test_excluded_windows_are_left_out_and_unused_logs_too(workspace):
    workspace.write_choices(workspace.choices().with_log(NAME, exclude=((3.0, 5.0),)), "exclude")
    (record,) = inputs.records(workspace.folder)
    assert not ((record.time >= 3.0) & (record.time <= 5.0)).any()
    assert record.span == (0.0, 17.0)
    workspace.write_choices(workspace.choices().with_log(NAME, use=False), "leave out")
    with pytest.raises(FifthwheelError, match="no log is used"):
        inputs.records(workspace.folder)


def test_a_removed_log_takes_its_samples_along(workspace):
    inputs.store(workspace.folder, NAME)
    workspace.remove_log(NAME)
    assert not list((workspace.folder / ".workbench" / "logs").iterdir())
    assert not workspace.logs()


def test_only_the_leftovers_of_killed_processes_are_removed(workspace):
    folder = workspace.folder / ".workbench" / "logs"
    for name in ("killed.part", "running.part"):
        (folder / name).mkdir(parents=True)
        (folder / name / "column0").write_text("x")
    lock = try_lock(folder / "running.part" / "lock")
    try:
        inputs.store(workspace.folder, NAME)
    finally:
        os.close(lock)
    names = {path.name for path in folder.iterdir()}
    assert "running.part" in names
    assert "killed.part" not in names
    assert len(names) == 2
