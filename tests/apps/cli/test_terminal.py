"""What the command line prints of names that others have chosen."""

import io
import sys

import pytest

from fifthwheel.apps.cli import common
from tests.apps.cli.test_cli import TRUCK, run  # noqa: F401 - a fixture

HOSTILE = "x\x1b[2J[/bold]\udcff"


def test_a_path_cannot_control_the_terminal(run):  # noqa: F811
    outcome = run("identify", f"missing {HOSTILE}.csv", "-v", TRUCK)
    assert outcome.code == 2
    assert outcome.err.startswith(r"error: missing x\u001b[2J[/bold]\udcff.csv: cannot be read")
    outcome = run("simulate", f"no folder {HOSTILE}/run.csv")
    assert outcome.code == 2
    assert r"no folder x\u001b[2J" in outcome.err
    assert "\x1b" not in outcome.err


def test_a_title_cannot_control_the_progress_bar(monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    shown = Terminal()
    monkeypatch.setattr(sys, "stderr", shown)
    monkeypatch.setenv("COLUMNS", "200")
    with common.progress_bar(quiet=False) as progress:
        progress(f"reading {HOSTILE}", 1, 2)
    assert r"x\u001b[2J[/bold]\udcff" in shown.getvalue()
    assert "\x1b[2J" not in shown.getvalue()


@pytest.mark.parametrize("option", ["--signals", "--identification", "--vehicle"])
def test_devices_are_refused(run, option):  # noqa: F811
    given = ["states", "run.csv", "-v", TRUCK] if option != "--vehicle" else ["states", "run.csv"]
    outcome = run(*given, option, "/dev/zero")
    assert outcome.code == 2
    assert outcome.err.startswith("error: /dev/zero")
    outcome = run("identify", "/dev/zero", "-v", TRUCK)
    assert outcome.err.startswith("error: /dev/zero: cannot be read, it is not a regular file")
