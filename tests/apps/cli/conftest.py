"""Fixtures of the tests of the command line: a command, logs and their identification, a result, a truck."""

import json
import re
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from fifthwheel.apps import cli
from fifthwheel.data.logs import write_record
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import get
from tests.estimate.observe.conftest import truck

__all__ = ["folder", "identified", "truck"]


TRUCK = "cheng_cebon_2011"
LINEAR = ("--tyres", "linear")
"""The tyres of the simulated truck; an identification with them takes a fifth of the time."""
FILES = ["identification.json", "knowledge.json", "report.html", "states.parquet", "vehicle.toml"]
ESTIMATED = [
    "tractor.front.cornering_stiffness",
    "tractor.drive.cornering_stiffness",
    "semitrailer.cornering_stiffness",
    "semitrailer.yaw_inertia",
    "semitrailer.payload.height",
]


class Outcome:
    """Exit code, standard output and standard error of a command."""

    def __init__(self, code: int, out: str, err: str) -> None:
        self.code, self.out, self.err = code, out, err

    def json(self) -> dict:
        return json.loads(self.out)


@pytest.fixture
def run(monkeypatch, capsys, tmp_path):
    """Run `fifthwheel ...` inside this process, in an empty folder."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")

    def main(*arguments: str | Path) -> Outcome:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(sys, "argv", ["fifthwheel", *map(str, arguments)])
            try:
                cli.main()
                code = 0
            except SystemExit as stop:
                code = stop.code if isinstance(stop.code, int) else 0 if stop.code is None else 1
        return Outcome(code, *capsys.readouterr())

    return main


def refused(outcome: Outcome, start: str) -> None:
    """Exit code 2, nothing on standard output, one line "error: ..." and no traceback."""
    assert outcome.code == 2, outcome.err
    assert outcome.out == ""
    lines = outcome.err.splitlines()
    assert [line.startswith("error: ") for line in lines].count(True) == 1, outcome.err
    assert lines[0].startswith("error: "), outcome.err
    assert re.match(start, lines[0].removeprefix("error: ")), outcome.err
    assert "Traceback" not in outcome.err


@pytest.fixture(scope="session")
def folder(tmp_path_factory) -> Path:
    """Logs of the article's truck."""
    place = tmp_path_factory.mktemp("logs")
    truck = get(TRUCK)
    write_record(simulate(truck, count=2, seed=1), place / "first.csv")
    write_record(simulate(truck, count=2, seed=2), place / "second.parquet")
    write_record(simulate(truck, count=1, seed=3, roll=False), place / "flat.csv")
    return place


@pytest.fixture(scope="session")
def identified(folder, tmp_path_factory) -> tuple[Path, dict]:
    """One identification of two logs with a third predicted and a note: the folder, and the JSON that was printed."""
    out = tmp_path_factory.mktemp("result") / "deep" / "out"
    logs = [folder / "first.csv", folder / "second.parquet"]
    arguments = ["identify", *logs, "-v", TRUCK, *LINEAR, "-o", out, "--validate", folder / "flat.csv", "--json"]
    arguments += ["--note", "40 t, dry", "--author", "J. Smith"]
    found = CliRunner().invoke(cli.app, [str(a) for a in arguments], catch_exceptions=False)
    assert found.exit_code == 0
    assert found.stderr == ""
    return out, json.loads(found.stdout)
