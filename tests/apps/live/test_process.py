"""The command as a process: Ctrl-C, kill -9 at any time, and restart."""

import json
import re
import resource
import signal
import subprocess
import sys
import time
from types import SimpleNamespace

import pyarrow.parquet as pq
import pytest
from mcap.reader import make_reader
from typer.testing import CliRunner

from fifthwheel.apps import cli
from fifthwheel.apps.live.node import Output
from fifthwheel.apps.live.outputs.journal import Journal
from fifthwheel.apps.live.outputs.recorder import BackgroundWriter
from fifthwheel.apps.live.status import LiveFault, NodeStatus
from fifthwheel.estimate.online import Learner
from tests.apps.live.truck_bus import driven, frames, write_candump, write_files


@pytest.fixture
def folder(tmp_path):
    write_files(tmp_path)
    write_candump(tmp_path / "run.log", frames(driven(8.0)))
    return tmp_path


def command(*options):
    files = ["--signals", "signals.toml", "--vehicle", "cheng_cebon_2011"]
    return [sys.executable, "-m", "fifthwheel", "live", *files, *options]


def start(folder, *options):
    """A process that has given its first states; its output is in two files."""
    log = folder / "process.log"
    with log.open("w") as file, (folder / "out").open("w") as out:
        process = subprocess.Popen(command(*options), cwd=folder, stdout=out, stderr=file)
    while " s  " not in log.read_text():
        assert process.poll() is None, log.read_text()
        time.sleep(0.02)
    return process


def run(folder, *options):
    """A run to its end, in this process."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        return CliRunner().invoke(cli.app, command(*options)[3:])


@pytest.mark.slow
def test_a_signal_ends_the_run_with_a_complete_record_and_a_summary(folder):
    process = start(folder, "--replay", "run.log", "--record", "run.parquet", "--page", "0")
    time.sleep(0.5)
    process.send_signal(signal.SIGINT)  # of Ctrl-C and of systemd
    assert process.wait(60) == 0
    assert 20 < pq.read_table(folder / "run.parquet").num_rows < 800
    assert not (folder / "run.parquet.parts").exists()
    assert " s of bus time, " in (folder / "out").read_text()


@pytest.mark.slow
def test_the_journal_and_the_summary_say_what_happened(folder):
    """Beside the record: the start, a change of status, what was learned, and the end; a later run appends.

    The summary at the end has the verdicts.
    """
    options = ("--replay", "run.log", "--rate", "max", "--record", "run.parquet", "--learn", "--force")
    for _ in range(2):
        done = run(folder, *options)
        assert done.exit_code == 0
        assert re.search(r"Parameter +Value +± % +Verdict", done.stdout.replace("+-", "±"))
    lines = [json.loads(line) for line in (folder / "run.parquet.events.jsonl").read_text().splitlines()]
    first = lines[: len(lines) // 2]
    assert [line["event"] for line in lines[len(first) :]] == [line["event"] for line in first]
    assert [line["event"] for line in (first[0], first[-1])] == ["start", "end"]
    assert first[0]["vehicle"] == "cheng_cebon_2011"
    assert first[0]["signals"]["speed"]
    statuses = [line["status"] for line in first if line["event"] == "status"]
    assert statuses[-1] == "OK"
    learned = [line for line in first if line["event"] == "learned"]
    assert learned[-1]["samples"] > 100
    assert len(learned[-1]["estimates"]["tractor.front.cornering_stiffness"]) == 3
    assert [line["at"] for line in lines] == sorted(line["at"] for line in lines)
    counts = [line["outputs"] for line in (*learned, first[-1])]
    assert sum(sum(count.values()) for count in counts) == 800
    assert not any(line["refused"] for line in (*learned, first[-1]))


def test_the_journal_counts_what_was_refused(tmp_path):
    """A gyro that freezes in the middle of a run is at fault at each output from 3 s later on."""
    writer = BackgroundWriter()
    journal = Journal(tmp_path / "events.jsonl", SimpleNamespace(writer=writer, learning=None, coach=None), {})
    problems = {"yaw_rate.tractor": LiveFault.FROZEN}
    for k in range(10):
        at = {"time": 0.01 * k, "bus_time": 0.01 * k, "problems": problems if k >= 3 else {}, "states": {}}
        journal.show(Output(status=NodeStatus.DEGRADED, faults=LiveFault.FROZEN, samples=(), **at))
    journal.close()
    writer.close()
    end = json.loads((tmp_path / "events.jsonl").read_text().splitlines()[-1])
    assert end["outputs"] == {"DEGRADED": 10}
    assert end["refused"] == {"yaw_rate.tractor: frozen": 7}


def test_a_replay_as_fast_as_possible_records_everything(folder):
    """Also the messages of ROS 2 beside the record; without a learner the summary has no verdicts."""
    options = ("--replay", "run.log", "--rate", "max", "--record", "run-%Y.parquet", "--send", "0x500")
    done = run(folder, *options, "--mcap", "run.mcap")
    assert done.exit_code == 0, done.stderr
    (record,) = folder.glob("run-2*.parquet")
    table = pq.read_table(record).to_pydict()
    assert len(table["status"]) == 800
    assert (folder / "fifthwheel-live.dbc").exists()
    with (folder / "run.mcap").open("rb") as file:
        count = sum(channel.topic == "/fifthwheel/velocity" for _, channel, _ in make_reader(file).iter_messages())
    assert count == sum(status in (0, 1, 8) for status in table["status"])
    assert re.search(r"^8\.0 s of bus time, 800 samples: \d+ % ok, [\d.]+ % settling\.$", done.stdout, re.MULTILINE)
    assert "Verdict" not in done.stdout


REPLAY = ("--replay", "run.log")
WRONG = (
    ((), "--bus or --replay"),
    (("--bus", "virtual:a", *REPLAY), "--bus or --replay"),
    (("--replay", "none.log"), "no such file"),
    ((*REPLAY, "--rate", "fast"), "--rate fast"),
    ((*REPLAY, "--send", "high"), "--send high"),
    ((*REPLAY, "--send", "0xFF"), "id of a mapped message"),
    ((*REPLAY, "--state", "x.json"), "--learn"),
    ((*REPLAY, "--record", "old.parquet"), "exists"),
    ((*REPLAY, "--learn", "-i", "out"), "without --learn"),
    ((*REPLAY, "--record", "x.csv"), "no format"),
    ((*REPLAY, "--record", "other.mcap"), "end the name in .parquet"),
    ((*REPLAY, "--coach"), "--coach: is for --learn; add it"),
    ((*REPLAY, "--learn", "--target", "semitrailer.yaw_inertia=5%"), "--target: is for --coach; add it"),
)


def test_wrong_options_are_refused_with_the_cure(folder, capsys, monkeypatch):
    monkeypatch.chdir(folder)
    (folder / "old.parquet").touch()
    for options, message in WRONG:
        monkeypatch.setattr(sys, "argv", ["fifthwheel", *command(*options)[3:]])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        assert ended.value.code == 2
        assert message in " ".join(capsys.readouterr().err.split())


@pytest.mark.slow
def test_a_killed_process_loses_at_most_ten_seconds(folder):
    write_candump(folder / "run.log", frames(driven(40.0)))  # of which several pieces are recorded
    options = ["--replay", "run.log", "--learn", "--state", "truck.json", "--trailer", "a", "--record", "run.parquet"]
    options += ["--rate", "4"]
    state, parts = folder / "truck.json", folder / "run.parquet.parts"
    process = start(folder, *options)
    began = time.monotonic()
    while not (state.exists() and len(list(parts.glob("0*"))) >= 2):
        assert time.monotonic() - began < 40
        time.sleep(0.1)
    process.kill()
    process.wait()
    age = time.time() - state.stat().st_mtime
    assert age < 10
    learner = Learner.load(state)
    before = learner["semitrailer.cornering_stiffness"]
    pieces = sorted(parts.glob("0*"))
    assert all(pq.read_table(piece).num_rows == 1000 for piece in pieces)
    assert not (folder / "run.parquet").exists()
    again = run(folder, *options[:-1], "0")
    assert again.exit_code == 0, again.stderr
    assert pq.read_table(folder / "run.parquet").num_rows == 4000 + 1000 * len(pieces)
    assert Learner.load(state)["semitrailer.cornering_stiffness"].sigma < before.sigma


@pytest.mark.slow
def test_a_file_that_cannot_be_written_is_said_and_the_states_go_on(folder):
    """A limit of the size of files stands for a full disk."""
    done = subprocess.run(
        command("--replay", "run.log", "--rate", "0", "--record", "run.parquet"),
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (2_000, 2_000)),
    )
    assert done.returncode == 2, done.stderr
    assert "not recorded" in done.stderr
    assert "File too large" in done.stderr
    assert not (folder / "run.parquet").exists()


def test_a_page_is_announced_only_after_the_bus_is_open(folder):
    done = run(folder, "--bus", "socketcan:none7", "--page", "0")
    assert done.exit_code != 0
    assert "cannot be opened" in str(done.exception)
    assert "Page:" not in done.stderr
