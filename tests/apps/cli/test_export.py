"""`fifthwheel export c`: the folder of an observer or a learner, and options that contradict each other."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from fifthwheel.apps.cli import app
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.estimate.online import Learner
from fifthwheel.results.export import FILES, LEARNER_FILES
from fifthwheel.truck import Vehicle
from tests.apps.fleet.make import FAST

VEHICLE = ("export", "c", "-v", "cheng_cebon_2011", "--signal", "speed", "--signal", "steer.tractor.front")
SIGNALS = (*VEHICLE, "--signal", "yaw_rate.tractor")


@pytest.mark.slow
@pytest.mark.parametrize(("options", "files"), [((), FILES), (("--learner", "--passes", "0"), LEARNER_FILES)])
def test_the_files(
    options: tuple[str, ...], files: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def small(vehicle: Vehicle, signals: list[str], _: object, *, passes: int, **__: object) -> Learner:
        assert passes == 0
        return Learner(vehicle, signals, FAST)

    monkeypatch.setattr("fifthwheel.apps.workflow.runs.exported_learner", small)
    done = CliRunner().invoke(app, [*SIGNALS, *options, "--out", str(tmp_path / "c"), "--json"])
    assert done.exit_code == 0, done.output
    assert {path.name for path in (tmp_path / "c").iterdir()} >= {*files}
    described = json.loads(done.stdout)
    assert described["measured"] == ["yaw_rate.tractor"]
    assert ("estimated" in described) == bool(options)


def test_contradicting_options(tmp_path: Path) -> None:
    learner = ("--learner", "--bank"), ("--learner", "--friction", "0.3"), ("--learner", "--half-track", "0.92")
    for options in (*learner, ("--passes", "2"), ("--segment", "100")):
        done = CliRunner().invoke(app, [*SIGNALS, *options, "--out", str(tmp_path / "c")])
        assert isinstance(done.exception, FifthwheelError)
        assert "omit" in str(done.exception)
    assert not (tmp_path / "c").exists()
