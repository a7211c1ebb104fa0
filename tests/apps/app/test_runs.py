"""What the pages compute of a workspace, and what they say of it."""

import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from fifthwheel import read_log
from fifthwheel.apps.app import runs
from fifthwheel.apps.app.layout import typed_number
from fifthwheel.apps.app.pages import identify as page
from fifthwheel.apps.app.pages.identify import plain_name
from fifthwheel.apps.app.pages.signals import objections
from fifthwheel.apps.app.workspace import Choices, LogChoice, Workspace
from fifthwheel.apps.workflow.new_vehicle import QUESTIONS
from fifthwheel.base.atomic import try_lock
from fifthwheel.base.errors import FifthwheelError, SignalError
from fifthwheel.base.pages import Plots
from fifthwheel.data.logs import SignalMap, write_record
from fifthwheel.estimate.identify import Identification, OneStage, identify
from fifthwheel.estimate.identify.knowledge.knowledge import Knowledge
from fifthwheel.estimate.time_bases.evidence import signal_evidence
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import get

pytestmark = pytest.mark.slow

TRUCK = get("cheng_cebon_2011")
FRONT = "tractor.front.cornering_stiffness"


@pytest.fixture
def workspace(tmp_path) -> Workspace:
    """Two logs and a vehicle."""
    made = Workspace(tmp_path / "w")
    for seed, name in enumerate(("first", "second")):
        write_record(simulate(TRUCK, count=1, seed=seed), made.folder / "logs" / f"{name}.csv")
    made.write({"vehicle.toml": TRUCK.to_toml()}, "a truck")
    return made


@dataclass
class ReachedError(Exception):
    """Ends an identification when its inputs are known."""

    records: object
    truck: object
    settings: object
    validate: object
    knowledge: object
    occasion: object


@pytest.fixture
def identified(workspace, monkeypatch):
    """What `runs.identify` would identify with some choices."""

    def stop(starts, records, *, validate, progress):
        (start,) = starts
        used = [records[path] for path in start.logs]
        raise ReachedError(used, start.vehicle, start.settings, validate, start.knowledge, start.occasion)

    monkeypatch.setattr(runs, "run_loads", stop)

    def inputs_of(choices):
        workspace.write_choices(choices, "choose")
        with pytest.raises(ReachedError) as reached:
            runs.identify(workspace.folder, "run-1", lambda *_: None)
        return reached.value

    return inputs_of


def test_excluded_windows_and_unused_logs_are_honoured(identified):
    choices = Choices(logs={"first.csv": LogChoice(exclude=((2.0, 4.0),)), "second.csv": LogChoice(use=False)})
    found = identified(choices)
    (record,) = found.records
    assert record.name == "first"
    assert not ((record.time >= 2.0) & (record.time <= 4.0)).any()
    assert found.validate == []


def test_the_settings_are_those_of_the_options(workspace, identified):
    found = identified(
        Choices(
            identify={"statements": [f"{FRONT}=exact", "roll_stiffness=+- 5 %"], "validate": ["second.csv"], "old": 1}
        )
    )
    assert [record.name for record in (*found.records, *found.validate)] == ["first", "second"]
    assert runs.results(workspace) == []  # a failed run leaves none
    assert runs.next_name(workspace) == "run-1"
    assert found.settings.given[FRONT] == "exact"
    path = "semitrailer.roll_stiffness"
    assert found.truck.stated[path] == pytest.approx(0.05 * found.truck.parameters()[path])


def test_a_cancelled_run_leaves_only_what_the_user_put_there(workspace):
    for name in ("new", "own"):
        work = workspace.folder / "runs" / name / ".fifthwheel" / "new"
        work.mkdir(parents=True)
        (work / "states.parquet").write_text("half")
    (workspace.folder / "runs" / "own" / "notes.txt").write_text("mine")
    for name in ("new", "own", "none"):
        runs.discard_empty(workspace.folder, name)
    assert [path.name for path in workspace.runs()] == ["own"]


def test_a_number_in_a_field():
    numbers = {"0,054": 0.054, "0.054": 0.054, " -1,5e-3 ": -1.5e-3, "7": 7.0, ",5": 0.5, "\u22122": -2.0, "": None}
    for text, number in numbers.items():
        assert typed_number(text) == number
    for text in ("1.234,5", "1,234,567", "0,054 m", "nan", "inf", "1e999", "--1", "5 4"):
        with pytest.raises(FifthwheelError, match="expected a number without separators of thousands"):
            typed_number(text)
    for question in QUESTIONS:
        assert question.choices or question.parse(question.example)


def test_what_speaks_against_a_map(workspace):
    record = simulate(TRUCK, count=2, seed=1)
    trailer = "yaw_rate.semitrailer"
    columns = {name: name for name in ("speed", "steer.tractor.front", "yaw_rate.tractor", trailer)}
    signal_map = SignalMap(signals=columns | {"roll_rate.semitrailer": "roll_rate.semitrailer"})

    def against(record, signal_map=signal_map):
        return objections(signal_evidence(record, TRUCK), signal_map, TRUCK)

    assert against(record) == ([], [])
    assert against(record.with_signals({trailer: record.signals[trailer] / 18})) == ([], [trailer])
    late = np.interp(record.time - 0.16, record.time, record.signals[trailer])
    assert against(record.with_signals({trailer: late})) == ([], [trailer])
    missing, _ = against(record, SignalMap(signals={"yaw_rate.tractor": "r"}))
    assert [text.partition(":")[0] for text in missing] == [
        "speed", "steer.tractor.front", "yaw_rate.semitrailer or articulation.semitrailer", "roll_rate.semitrailer",
    ]  # fmt: skip


def test_what_is_refused(workspace, tmp_path):
    with pytest.raises(FifthwheelError, match="no log to identify on"):
        runs.logs(workspace, Choices(identify={"validate": ["first.csv", "second.csv"]}))
    with pytest.raises(FifthwheelError, match="page Truck"):
        runs.vehicle(Workspace(tmp_path / "empty"))
    with pytest.raises((FifthwheelError, SignalError), match="no such log"):
        runs.record(workspace.folder, "../vehicle.toml")
    for name in ("", " ", "..", "../up", "a/b", "a\\b", ".hidden", "x" * 81):
        with pytest.raises(FifthwheelError, match="name: expected"):
            plain_name(name)


def test_the_command_line_of_a_run(workspace):
    choices = Choices(
        logs={"first.csv": LogChoice(exclude=((2.0, 4.0),))},
        identify={"statements": [f"{FRONT}=exact"], "method": "two-stage", "validate": ["second.csv"], "check": False},
    )
    assert runs.command(workspace, choices, "a b") == [
        "identify", "logs/first.csv", "--vehicle", "vehicle.toml", "--out", "runs/a b", "--validate=logs/second.csv",
        "--exclude=first=2..4", "--method=two-stage", f"--set={FRONT}=exact", "--no-check",
    ]  # fmt: skip


QUICK = OneStage(given={"truck": "exact", FRONT: "free"}, tyres="linear")


@pytest.fixture(scope="module")
def result() -> Identification:
    return identify([simulate(TRUCK, count=1, seed=5)], TRUCK, QUICK)


@pytest.fixture
def known(workspace, result) -> str:
    """A result of another log in the workspace."""
    result.save(workspace.folder / "runs" / "before")
    return "before"


def test_an_identification_begins_with_the_knowledge_of_a_result(workspace, identified, known):
    found = identified(Choices(identify={"knowledge": known, "trailer": "T 17", "load": ["steel"]}))
    assert len(found.knowledge.logs) == 1
    assert (found.occasion.trailer, found.occasion.load) == ("T 17", "steel")
    assert found.occasion.date is not None
    assert runs.command(workspace, workspace.choices(), "b")[-3:] == [
        "--knowledge=runs/before", "--trailer=T 17", "--load=steel",
    ]  # fmt: skip


def test_the_history_of_the_truck_in_a_result(workspace, known):
    (workspace.folder / "runs" / "old").mkdir()
    (workspace.folder / "runs" / "old" / "identification.json").write_text("{}")
    assert runs.known_results(workspace) == [known]
    assert not [block for block in runs.history(workspace.folder, known).blocks if isinstance(block, Plots)]
    earlier = Knowledge.load(workspace.run(known) / "knowledge.json")
    later = identify([simulate(TRUCK, count=1, seed=6)], TRUCK, QUICK, knowledge=earlier)
    later.save(workspace.folder / "runs" / "later")
    blocks = runs.history(workspace.folder, "later").blocks
    (plots,) = [block.plots for block in blocks if isinstance(block, Plots)]
    assert [plot.plot.title for plot in plots] == ["Front tyres, cornering stiffness (truck)"]


def test_a_check_begins_with_the_knowledge(workspace, known):
    alone = runs.check(workspace.folder, lambda *_: None)
    workspace.write_choices(Choices(identify={"knowledge": known}), "choose")
    found = runs.check(workspace.folder, lambda *_: None)
    (before,), (after,) = ([p.sigma for p in a.parameters if p.name == FRONT] for a in (alone, found))
    assert after < before
    workspace.write({"vehicle.toml": TRUCK.to_toml().replace('"tractor"', '"lorry"')}, "another truck")
    with pytest.raises(FifthwheelError, match="truck whose first unit is tractor"):
        runs.check(workspace.folder, lambda *_: None)


def test_results_side_by_side_and_over_a_log(workspace, result):
    for name in ("a", "b"):
        result.save(workspace.folder / "runs" / name)
    (workspace.folder / "runs" / "killed").mkdir()
    assert sorted(runs.results(workspace)) == ["a", "b"]
    assert runs.interrupted(workspace) == ["killed"]
    found = runs.comparison(workspace.folder, ["b", "a"])
    assert found.runs == ("b", "a")
    plot = runs.overlay(workspace.folder, ["b", "a"], "first.csv")
    assert [item.name for item in plot.panels[0].items] == ["measured", "b", "a"]
    with pytest.raises(FifthwheelError, match="no such run"):
        runs.comparison(workspace.folder, ["a", "../runs/a"])


def test_a_run_is_that_of_the_command_line(workspace):
    """The same numbers as `fifthwheel identify` in the folder, from the command that the report shows."""
    few = {"statements": ["truck=exact", f"{FRONT}=free"], "tyres": "linear"}
    choices = Choices(identify=few, logs={"first.csv": LogChoice(exclude=((6.5, 7.5),))})
    workspace.write_choices(choices, "choose")
    runs.identify(workspace.folder, "page", lambda *_: None)
    command = runs.command(workspace, choices, "line")
    subprocess.run(
        [sys.executable, "-m", "fifthwheel", *command], cwd=workspace.folder, check=True, capture_output=True
    )
    page, line = (Identification.load(workspace.run(name)) for name in ("page", "line"))
    assert page.to_json() == line.to_json()
    assert sorted(path.name for path in workspace.run("page").iterdir() if path.name[0] != ".") == [
        "identification.json", "knowledge.json", "report.html", "run.json", "states.parquet", "vehicle.toml",
    ]  # fmt: skip


LOG = Path(__file__).parents[3] / "examples" / "lane_changes.csv"
NAME = LOG.name


@pytest.fixture
def one_log(tmp_path):
    found = Workspace(tmp_path)
    shutil.copy(LOG, found.place_for(NAME))
    return found


def test_a_log_is_read_once_and_again_when_it_or_a_database_changes(one_log):
    titles = []
    store = lambda: runs.store(one_log.folder, NAME, lambda title, done, total: titles.append(title))  # noqa: E731
    store()
    assert runs.is_stored(one_log, NAME)
    assert f"reading {NAME}" in titles
    record, direct = runs.record(one_log.folder, NAME), read_log(LOG)
    assert record.name == direct.name
    for signal, values in {"time": direct.time, **direct.signals}.items():
        np.testing.assert_array_equal(record.time if signal == "time" else record.signals[signal], values)
    titles.clear()
    store()
    assert not titles
    path = one_log.log(NAME)
    os.utime(path, ns=(1, 1))
    assert not runs.is_stored(one_log, NAME)
    store()
    one_log.place_for("truck.dbc").write_text('VERSION ""\n')
    assert not runs.is_stored(one_log, NAME)
    store()
    assert len(list((one_log.folder / ".workbench" / "logs").iterdir())) == 1


def test_a_log_that_cannot_be_read_leaves_nothing_and_one_that_is_removed_too(one_log):
    runs.store(one_log.folder, NAME)
    one_log.remove_log(NAME)
    assert not one_log.logs()
    one_log.place_for("broken.csv").write_bytes(b"\x00\x01" * 5000)
    with pytest.raises(SignalError, match=r"broken\.csv"):
        runs.store(one_log.folder, "broken.csv")
    assert not runs.is_stored(one_log, "broken.csv")
    assert not list((one_log.folder / ".workbench" / "logs").iterdir())
    with pytest.raises(SignalError, match="not read yet"):
        runs.opened(one_log, "broken.csv")


def test_only_the_leftovers_of_killed_processes_are_removed(one_log):
    folder = one_log.folder / ".workbench" / "logs"
    for name in ("killed.part", "running.part"):
        (folder / name).mkdir(parents=True)
        (folder / name / "column0").write_text("x")
    lock = try_lock(folder / "running.part" / "lock")
    try:
        runs.store(one_log.folder, NAME)
    finally:
        os.close(lock)
    names = {path.name for path in folder.iterdir()}
    assert "running.part" in names
    assert "killed.part" not in names
    assert len(names) == 2


def test_truck_sensors_statements_and_settings_are_sentences(tmp_path):
    """The numbers of truck, road and sensors can be stated."""
    mapped = Workspace(tmp_path / "w")
    signals = '[signals]\nspeed = "v"\n[signals."yaw_rate.tractor"]\ncolumn = "w"\nsensor = "mems"\n'
    mapped.write({"signals.toml": signals}, "a map")
    assert page.of_truck_and_sensors(mapped, TRUCK) == [
        "Truck: cheng_cebon_2011; no number is assumed.",
        "Tractor, yaw rate: a sensor of the class mems.",
        "All other sensors: the usual errors and noise of their kind.",
    ]
    statements = ["semitrailer.mass=33.4 t +- 0.5 %", "tractor.yaw_inertia=free", "road.friction=wet"]
    choices = Choices(identify={"statements": statements, "any_load": True, "form": "output-error"})
    assert list(page.stated_numbers(mapped, choices).values()) == [
        "Trailer, mass: 33.4 t ± 0.5 %.",
        "Tractor, yaw inertia: unknown; only the logs determine it.",
        "Road, friction: wet.",
    ]
    assert page.changed_settings(choices) == [
        "Load of any shape: yes.",
        "Compare the logs with: Free-running model: robust to model error.",
    ]
    numbers = page.numbers(mapped, TRUCK)
    assert {"semitrailer.yaw_inertia", "road.friction", "yaw_rate.tractor.gain", "road.bank"} <= set(numbers)
    assert "yaw_rate.semitrailer.gain" not in numbers  # the signal map has no such sensor
    for name, words in (
        ("time_base", "Time base, rate"),
        ("yaw_rate.tractor.misalignment", "Tractor, yaw rate misalignment"),
        ("semitrailer.mass", "Trailer, mass"),
        ("semitrailer.wheelbase", "Trailer, wheelbase"),
    ):
        assert numbers[name] == f"{words} ({name})"
