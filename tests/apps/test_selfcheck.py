"""The checks of an installation find what is broken, and name the cure."""

import json
import os
import time
from pathlib import Path

import pytest
from typer.testing import CliRunner

from fifthwheel.apps import selfcheck
from fifthwheel.apps.cli import app
from fifthwheel.apps.live.setup import LiveOptions, _require_working
from fifthwheel.apps.selfcheck import STORED, self_check
from fifthwheel.base.errors import FifthwheelError


def found(folder: Path) -> dict[str, str]:
    """Text of the checks that fail, by name."""
    return {check.name: check.text for check in self_check(folder) if not check.passed}


def test_a_good_installation_passes_and_leaves_nothing(tmp_path: Path) -> None:
    assert not found(tmp_path)
    assert not list(tmp_path.iterdir())


def test_wrong_machine_code_is_found_and_stops_a_node(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    name = "roll.semitrailer"
    monkeypatch.setitem(selfcheck.STORED, name, STORED[name] * (1 + 1e-8))
    assert set(found(tmp_path)) == {"machine code"}
    assert name in found(tmp_path)["machine code"]
    with pytest.raises(FifthwheelError, match="selfcheck, machine code"):
        _require_working(LiveOptions(replay=Path("x")), print)


def test_a_cache_of_others_a_full_disk_and_a_wrong_clock_are_found_and_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shared = tmp_path / "shared"
    shared.mkdir()
    shared.chmod(0o777)
    monkeypatch.setenv("FIFTHWHEEL_CACHE", str(shared))
    monkeypatch.setattr(selfcheck, "LEAST_SPACE", 1e18)
    monkeypatch.setattr(time, "time", lambda: 0.0)
    checks = found(tmp_path)
    assert set(checks) == {"cache", "disk", "clock"}
    assert "chmod 700" in checks["cache"]
    assert "delete files" in checks["disk"]
    assert "1970-01-01" in checks["clock"]
    said: list[str] = []
    _require_working(LiveOptions(replay=Path("x")), said.append)
    assert [line.split(":")[0] for line in said] == ["selfcheck, cache", "selfcheck, disk", "selfcheck, clock"]


@pytest.mark.skipif(not hasattr(os, "getuid") or os.getuid() == 0, reason="the superuser may write everywhere")
def test_a_folder_that_cannot_be_written_is_found(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    assert "Permission" in found(tmp_path)["disk"]


def test_a_clock_that_jumps_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    times = iter([1.9e9, 1.9e9 + 30.0])
    monkeypatch.setattr(time, "time", lambda: next(times))
    assert "moved by" in found(tmp_path)["clock"]


def test_the_command_says_what_it_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    good = CliRunner().invoke(app, ["selfcheck", str(tmp_path)])
    assert good.exit_code == 0
    assert [line.split(":")[0] for line in good.output.splitlines()] == [
        "ok     cache",
        "ok     machine code",
        "ok     disk",
        "ok     clock",
    ]
    monkeypatch.setattr(selfcheck, "LEAST_SPACE", 1e18)
    bad = CliRunner().invoke(app, ["selfcheck", str(tmp_path), "--json"])
    assert bad.exit_code == 1
    contents = json.loads(bad.output)
    assert not contents["passed"]
    assert [check["name"] for check in contents["checks"] if not check["passed"]] == ["disk"]
