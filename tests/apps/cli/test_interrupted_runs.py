"""Commands that are refused, killed, terminated, or run out of disk: no file is lost, and results do not mix."""

import errno
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from fifthwheel.base.atomic import MANIFEST
from fifthwheel.data.logs import write_record
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import get
from tests.apps.cli.conftest import ESTIMATED, FILES, TRUCK, refused


@pytest.fixture
def place(run, tmp_path):
    """The working folder with a log and a vehicle file."""
    write_record(simulate(get(TRUCK), count=1, seed=1), tmp_path / "log.csv")
    get(TRUCK).save(tmp_path / "truck.toml")
    return tmp_path


REPLACING = (
    "signals log.csv --out log.csv",
    "signals log.csv --out link.csv",
    "signals log.csv --out truck.toml",
    "signals log.csv --signals map.toml --save log.csv",
    "simulate log.csv",
    "check log.csv -v truck.toml --plot truck.toml",
    "weigh log.csv -v truck.toml --out truck.toml",
    "design -v truck.toml --out log.csv",
    "identify log.csv -v truck.toml --out .",
    "states log.csv -v truck.toml --out .",
)


def test_files_are_replaced_only_with_force(place, run):
    (place / "link.csv").symlink_to("log.csv")
    for name in ("mine.png", "vehicle.toml", "report.html"):
        (place / name).write_text("mine")
    (place / "map.toml").write_text("[signals]\nspeed = 'speed'\n")
    before = {path.name: path.read_bytes() for path in place.iterdir()}
    for command in REPLACING:
        outcome = run(*command.split())
        refused(outcome, r".*: (exists; |not written by an earlier)")
        assert "--force" in outcome.err
        assert {path.name: path.read_bytes() for path in place.iterdir()} == before, command
    assert run("signals", "log.csv", "--out", "map.toml", "--force").code == 0
    assert (place / "map.toml").read_bytes() != before["map.toml"]


def test_results_are_replaced_by_the_same_command_only(place, run):
    states = ("states", "log.csv", "-v", "truck.toml", "-o", "out")
    for _ in range(2):
        assert run(*states).code == 0
    manifest = json.loads((place / "out" / MANIFEST).read_text())
    assert manifest["command"] == "states"
    assert sorted(manifest["files"]) == ["report.html", "states.json", "states.parquet"]
    (place / "out" / "notes.txt").write_text("mine")
    refused(run("identify", *states[1:]), r"out: contains the results of fifthwheel states; ")
    (place / "out" / "report.html").write_text("edited")
    refused(run(*states), r"out/report\.html: not written by an earlier fifthwheel states, or changed since")
    assert (place / "out" / "notes.txt").read_text() == "mine"


@pytest.mark.slow
def test_an_identification_and_a_vehicle_of_different_runs_are_refused(place, run):
    outcome = run("identify", "log.csv", "-v", "truck.toml", "-o", "out", "--tyres", "linear")
    assert outcome.code == 0
    for name in (*ESTIMATED, "semitrailer.cog_height", "semitrailer.roll_inertia", *FILES):
        assert name in outcome.out
    assert sorted(path.name for path in (place / "out").iterdir()) == sorted([*FILES, MANIFEST])
    both = ("log.csv", "-v", "out/vehicle.toml", "-i", "out/identification.json")
    refused(run("states", *both, "-o", "out"), r"out: contains the results of fifthwheel identify")
    refused(run("identify", *both[:3], "-o", "out"), r"out/vehicle\.toml: is an input of this command")
    (place / "out" / "vehicle.toml").write_text((place / "truck.toml").read_text())
    refused(run("states", *both), r"out/vehicle\.toml: has changed since fifthwheel identify wrote it")
    assert run("states", *both[:3]).code == 0  # alone it is any vehicle file


@pytest.mark.slow
def test_a_full_disk(place, run, monkeypatch):
    """The error names the file that is too large, and nothing is left of it."""
    write_bytes, states = Path.write_bytes, ("states", "log.csv", "-v", "truck.toml", "-o", "out")

    def full(path: Path, data: bytes) -> int:
        if "report.html" in path.name:
            write_bytes(path, data[:1000])
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write_bytes(path, data)

    monkeypatch.setattr(Path, "write_bytes", full)
    message = r"out/report\.html: No space left on device; check path, permissions and free space"
    refused(run(*states), message)
    assert not (place / "out").exists()
    monkeypatch.undo()
    monkeypatch.chdir(place)
    assert run(*states).code == 0
    before = {path.name: path.read_bytes() for path in (place / "out").iterdir()}
    monkeypatch.setattr(Path, "write_bytes", full)
    refused(run(*states), message)
    assert {path.name: path.read_bytes() for path in (place / "out").iterdir()} == before


def started(code: str, place: Path, *arguments: str) -> subprocess.Popen[str]:
    """A process of its own session that runs the command line after some code, when it has printed a line."""
    (place / "program.py").write_text(f"{code}\nif __name__ == '__main__':\n    main()\n")
    command = [sys.executable, "program.py", *arguments]
    process = subprocess.Popen(
        command, cwd=place, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    assert process.stdout is not None
    assert process.stdout.readline().strip() == "ready"
    return process


WRITING = """
import time
from fifthwheel.apps.cli import main
from fifthwheel.estimate.observe import states
import fifthwheel.apps.workflow.results as results

def write_states(*arguments):
    states.write_states(*arguments)
    print("ready\\n", end="", flush=True)  # in one piece, because several processes may print
    time.sleep(60)

results.write_states = write_states
"""


@pytest.mark.parametrize(
    ("number", "code"), [pytest.param(signal.SIGINT, 130, marks=pytest.mark.slow), (signal.SIGTERM, 143)]
)
def test_a_signal_removes_temporary_files(number, code, place):
    process = started(WRITING, place, "states", "log.csv", "-v", "truck.toml", "-o", "out")
    assert (place / "out/.fifthwheel/new/states.parquet").exists()
    process.send_signal(number)
    out, err = process.communicate(timeout=30)
    assert (process.returncode, out) == (code, "")
    assert err == "interrupted; files written before the interrupt are complete\n"
    assert sorted(path.name for path in place.iterdir()) == ["log.csv", "program.py", "truck.toml"]
