"""A note on an identification: its file, who wrote it and when, and its words in a list."""

import datetime
import json
from pathlib import Path
from typing import Any

from fifthwheel.apps.app import runs
from fifthwheel.apps.app.workspace import Workspace
from fifthwheel.apps.workflow.start import Note
from fifthwheel.base.options import IdentifyOptions
from fifthwheel.estimate.identify import Identification
from tests.apps.cli.test_cli import run

__all__ = ["run"]

EXAMPLES = Path(__file__).parents[3] / "examples"


def test_a_result_keeps_the_note(run: Any, tmp_path: Path) -> None:
    log, truck = EXAMPLES / "lane_changes.csv", EXAMPLES / "truck.toml"
    words = ("--method", "article", "--passes", "1", "--note", "New <tyres>, 8 bar", "--author", "A. Driver")
    outcome = run("identify", log, "-v", truck, "--out", "w/runs/first", *words)
    assert outcome.code == 0, outcome.err
    file = tmp_path / "w" / "runs" / "first" / "identification.json"
    today = datetime.datetime.now().astimezone().date().isoformat()
    kept = {"text": "New <tyres>, 8 bar", "author": "A. Driver", "date": today}
    assert json.loads(file.read_text())["note"] == kept
    assert Identification.load(file).method == "two-stage"
    workspace = Workspace(tmp_path / "w")
    assert runs.labels(workspace) == {"first": f"first: New <tyres>, 8 bar (A. Driver, {today})"}


def test_without_a_note_nothing_is_kept(tmp_path: Path) -> None:
    assert Note.of(IdentifyOptions()) is None
    for text in ("{}", "[]", "no JSON", '{"note": null}', '{"note": 3}'):
        (tmp_path / "identification.json").write_text(text)
        assert Note.read(tmp_path / "identification.json") is None
    assert Note.read(tmp_path / "missing.json") is None


def test_the_words_of_a_note() -> None:
    assert str(Note(text="wet", author="B", date="2026-01-02")) == "wet (B, 2026-01-02)"
    assert str(Note(text="wet", date="2026-01-02")) == "wet (2026-01-02)"
    assert str(Note(author="B", date="2026-01-02")) == "B, 2026-01-02"
