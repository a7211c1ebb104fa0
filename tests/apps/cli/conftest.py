"""Fixtures of the tests of the command line: logs and their identification, a result, a truck."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from fifthwheel.apps import cli
from fifthwheel.data.logs import write_record
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import get
from tests.estimate.observe.conftest import truck
from tests.results.report.conftest import result

__all__ = ["folder", "identified", "result", "truck"]


@pytest.fixture(scope="session")
def folder(tmp_path_factory) -> Path:
    """Logs of the article's truck."""
    place = tmp_path_factory.mktemp("logs")
    truck = get("cheng_cebon_2011")
    write_record(simulate(truck, count=2, seed=1), place / "first.csv")
    write_record(simulate(truck, count=2, seed=2), place / "second.parquet")
    write_record(simulate(truck, count=1, seed=3, roll=False), place / "flat.csv")
    return place


@pytest.fixture(scope="session")
def identified(folder, tmp_path_factory) -> tuple[Path, dict]:
    """One identification of two logs with a third predicted: the folder, and the JSON that was printed."""
    out = tmp_path_factory.mktemp("result") / "deep" / "out"
    logs = [folder / "first.csv", folder / "second.parquet"]
    arguments = ["identify", *logs, "-v", "cheng_cebon_2011", "-o", out, "--validate", folder / "flat.csv", "--json"]
    found = CliRunner().invoke(cli.app, [str(a) for a in arguments], catch_exceptions=False)
    assert found.exit_code == 0
    assert found.stderr == ""
    return out, json.loads(found.stdout)
