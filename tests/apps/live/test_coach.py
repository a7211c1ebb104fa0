"""The coach in a live session: advice, obstacles, terminal, journal, page and summary."""

import json
import math
import re
from dataclasses import replace

import pytest
from typer.testing import CliRunner

from fifthwheel.apps.cli import app
from fifthwheel.apps.live import coach as coaching
from fifthwheel.apps.live.checkpoint import make_learning
from fifthwheel.apps.live.coach import Coach
from fifthwheel.apps.live.node import Output
from fifthwheel.apps.live.outputs.recorder import BackgroundWriter
from fifthwheel.apps.live.page.snapshots import Snapshots
from fifthwheel.apps.live.session import Session
from fifthwheel.apps.live.setup import completed_map, make_node
from fifthwheel.apps.live.status import LiveFault, NodeStatus
from fifthwheel.apps.live.summary import Summary
from fifthwheel.base.errors import FifthwheelError
from tests.apps.live.truck_bus import SIGNALS, TRUCK, driven, frames, write_candump, write_files

pytestmark = pytest.mark.slow

FRONT, INERTIA = "tractor.front.cornering_stiffness", "semitrailer.yaw_inertia"
FEW = replace(coaching.DRIVEN, speeds=(88 / 3.6,), frequencies=(0.4,), accelerations=(1.0,))


@pytest.fixture(autouse=True)
def few_candidates(monkeypatch):
    monkeypatch.setattr(coaching, "DRIVEN", FEW)


@pytest.fixture
def session(tmp_path):
    """A session with a coach, which has two targets."""
    learning = make_learning(TRUCK, SIGNALS)
    node = make_node(completed_map(write_files(tmp_path)), learning)
    coach = Coach(learning, {FRONT: 0.1, INERTIA: 0.02})
    return Session(node=node, writer=BackgroundWriter(), learning=learning, coach=coach)


def output(now, status=NodeStatus.OK, speed=20.0, problems=None):
    sample = {"time": now, "speed": speed}
    rest = {"faults": LiveFault.NONE, "problems": problems or {}, "states": {"learning": 0.0}, "samples": (sample,)}
    return Output(time=now, bus_time=now, status=status, **rest)


def test_the_advice_follows_a_drive(session):
    """Lane changes, as asked: the first target is reached, the second one is not within reach."""
    snapshots, summary, coach = Snapshots(session), Summary(session), session.coach
    session.views = [snapshots, summary]
    assert coach.advice.next.startswith("88 km/h: ")
    assert " to the left" in coach.advice.next
    assert [p.reached for p in coach.advice.progress] == [False, False]
    seen, done_at = [], math.inf
    for frame in frames(driven(64.0)):
        if coach.advice.done:
            done_at = min(done_at, frame.time)
        if frame.time > done_at + 1:
            break
        for result in session.node.receive(frame):
            session.handle(result)
            if coach.advice not in seen[-1:]:
                seen.append(coach.advice)
    assert seen[-1].done
    assert sorted({advice.manoeuvres for advice in seen}) == list(range(seen[-1].manoeuvres + 1))
    assert 2 <= seen[-1].manoeuvres <= 8
    assert any(" to the right" in advice.next for advice in seen if advice.manoeuvres == 1)
    assert seen[-1].driven == pytest.approx(8 * seen[-1].manoeuvres, abs=2)
    left = [advice.worthwhile for advice in seen]
    assert left[0] > left[-1]
    assert seen[0].remaining == 8.0 * left[0]
    first, second = seen[-1].progress
    assert first.reached
    assert first.sigma <= 0.1
    assert not second.reached
    assert second.note.startswith("limited by the ")
    shown = json.loads(snapshots.history()[1])[-1]["coach"]
    assert shown["headline"] == "done: 1 min; more driving does not help"
    assert [target["reached"] for target in shown["targets"]] == [True, False]
    assert shown["targets"][1]["ratio"] == pytest.approx(second.sigma / 0.02, rel=1e-5)
    texts = str(summary.document())
    assert "Coach: done: 1 min; more driving does not help (1 of 2 targets" in texts
    assert "Trailer, yaw inertia: " in texts
    session.close()


OBSTACLES = (
    ({}, ""),
    ({"status": NodeStatus.TOO_SLOW, "speed": 0.0}, "standing"),
    ({"status": NodeStatus.TOO_SLOW, "speed": 3.0}, "too slow for the model"),
    ({"status": NodeStatus.INPUT_MISSING, "speed": math.nan}, "speed or steer angle missing"),
    ({"problems": {"Tractor.yaw": LiveFault.SIGNAL_MISSING}}, "Tractor.yaw: signal missing"),
)


def test_obstacles(session):
    """One after the other, each of which ends."""
    coach = session.coach
    for k, (given, obstacle) in enumerate(OBSTACLES):
        coach.update(output(3.0 * k + 1.0, **given))
        assert coach.advice.obstacle == obstacle
        assert coach.advice.headline == (obstacle or coach.advice.next)
        coach.update(output(3.0 * k + 2.5))
        assert coach.advice.obstacle == "", obstacle
    learning, obstacles = session.learning, set()
    for k in range(3000, 3400):
        steer = 0.0 if k < 3100 else 0.15
        learning.push({"time": 0.01 * k} | dict.fromkeys(SIGNALS, 0.0) | {"speed": 22.0, "steer.tractor.front": steer})
        coach.update(output(0.01 * k))
        obstacles.add(coach.advice.obstacle)
    assert "steer less: the lateral acceleration is too large for the model" in obstacles


def test_targets():
    """One that is reached ends the coaching at once; wrong ones are refused."""
    learning = make_learning(TRUCK, SIGNALS)
    coach = Coach(learning, {FRONT: 0.5})
    assert coach.advice.done
    assert coach.advice.next.startswith("done")
    for targets, message in (
        ({"semitrailer.mass": 0.05}, "semitrailer.mass: not a parameter that is learned; did you mean 'semi"),
        ({"nothing": 0.05}, "nothing: not a parameter that is learned; available: tractor.front.cornering_stiffness"),
        ({FRONT: 0.0}, "expected a sigma above 0, got 0; give one such as 5%"),
    ):
        with pytest.raises(FifthwheelError, match=message):
            Coach(learning, targets)


@pytest.fixture
def live(tmp_path, monkeypatch):
    """The command, in a folder with a trace of two lane changes."""
    write_files(tmp_path)
    write_candump(tmp_path / "run.log", frames(driven(16.0)))
    monkeypatch.chdir(tmp_path)
    files = ["live", "--signals", "signals.toml", "--vehicle", "cheng_cebon_2011", "--replay", "run.log", "--rate", "0"]
    return lambda *options: CliRunner().invoke(app, [*files, *options])


def test_the_command_says_what_to_drive(live, tmp_path):
    done = live("--learn", "--coach", "--target", f"{INERTIA}=4%", "--max-speed", "80", "--record", "run.parquet")
    assert done.exit_code == 0, done.output
    assert "80 km/h: " in done.stderr
    assert re.search(r"\(0 of 1 target, 0 manoeuvres driven, at least \d+ left, \d+ s\)", done.stderr)
    assert "1 manoeuvre driven" in done.stderr
    assert "Coach: " in done.stdout
    lines = [json.loads(line) for line in (tmp_path / "run.parquet.events.jsonl").read_text().splitlines()]
    advice = [line["advice"] for line in lines if line["event"] == "advice"]
    assert len(advice) == len(set(advice)) > 1


def test_refused_options(live):
    for options, message in (
        (("--target", "semitrailer.yaw_inertias=5%"), "did you mean 'semitrailer.yaw_inertia'"),
        (("--max-speed", "10km/h"), "--max-speed: expected road speeds of 18 to 144 km/h"),
        (("--target", f"{INERTIA}=5"), "below 100%, got 5, which is 500%; write 5% or 0.05"),
    ):
        done = live("--learn", "--coach", *options)
        assert done.exit_code != 0
        assert message in " ".join(f"{done.output} {done.exception}".split())
