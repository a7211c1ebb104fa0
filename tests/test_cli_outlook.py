"""`fifthwheel check` and `fifthwheel design`: what they print, their files and their exit codes."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fifthwheel.identify.plan import plan
from fifthwheel.logs import read, write
from fifthwheel.simulate import simulate
from fifthwheel.vehicle import get

from .test_cli import SOUGHT, TRUCK, refused, run  # noqa: F401 - a fixture

HEIGHT, INERTIA = SOUGHT[-1], SOUGHT[-2]
FAST = ("--speed", "80km/h")


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    place = tmp_path_factory.mktemp("logs")
    write(simulate(get(TRUCK), count=2, seed=1), place / "drive.csv")
    write(simulate(get(TRUCK), manoeuvre="straight", duration=12), place / "straight.csv")
    return place


def line_of(out: str, name: str) -> str:
    """The first line that begins with a name."""
    return next(line for line in out.splitlines() if line.startswith(name))


def test_check_tells_every_parameter(folder, run):  # noqa: F811
    outcome = run("check", folder / "drive.csv", "-v", TRUCK)
    assert (outcome.code, outcome.err) == (0, "")
    assert outcome.out.startswith("drive can tell 5 of 5 parameters, 1 of them roughly.")
    for name in SOUGHT:
        assert re.search(r"\+-30 %|\+-81 %", line_of(outcome.out, name))
        assert re.search(r"can be told|roughly", line_of(outcome.out, name))
    told = line_of(outcome.out, f"- {HEIGHT}: ")
    assert re.match(rf"- {HEIGHT}: \d+ % -> \d+ % if semitrailer\.roll_axis_height were known \(--hold\), ->", told)
    assert "Wrong with the logs" not in outcome.out
    assert list(Path().iterdir()) == []


def test_check_in_80_columns(folder, run, monkeypatch):  # noqa: F811
    monkeypatch.setenv("COLUMNS", "80")
    outcome = run("check", folder / "drive.csv", "-v", TRUCK)
    assert max(map(len, outcome.out.splitlines())) <= 80
    assert outcome.out.isascii()
    assert all(line_of(outcome.out, name).endswith(("can be told", "roughly    ")) for name in SOUGHT)


def test_check_of_a_straight_drive(folder, run):  # noqa: F811
    """Nothing to be told is an answer, not an error."""
    outcome = run("check", folder / "straight.csv", "-v", TRUCK)
    assert (outcome.code, outcome.err) == (0, "")
    assert outcome.out.startswith("straight can tell no parameter: the truck is not moved enough.")
    for name in SOUGHT:
        assert line_of(outcome.out, name).rstrip().endswith("not excited")
        assert re.match(rf"- {name}: not told -> [\d.]+ % with one more lane change", line_of(outcome.out, f"- {name}"))
    assert "at 88 km/h" in outcome.out


def test_check_as_json(folder, run):  # noqa: F811
    logs = folder / "drive.csv", folder / "straight.csv"
    told = run("check", *logs, "-v", TRUCK, "--json", "--hold", SOUGHT[0], "--free", "tractor.yaw_inertia").json()
    assert [p["name"] for p in told["parameters"]] == [*SOUGHT[1:], "tractor.yaw_inertia"]
    assert told["logs"] == ["drive", "straight"]
    assert told["findings"] == []
    assert set(told["noise"]) == {"drive", "straight"}
    for p in told["parameters"]:
        assert {"value", "prior", "sigma", "alone", "verdict", "confused_with", "remedies", "unit"} <= p.keys()


def test_check_lists_what_is_wrong(folder, run):  # noqa: F811
    """All of it at once: in the page where a fit could go on, as the error where none could."""
    record = read(folder / "drive.csv")
    name = "yaw_rate.semitrailer"
    hole = record.signals["roll_rate.tractor"].copy()
    hole[300:420] = np.nan
    bad = record.with_signals({name: -record.signals[name], "roll_rate.tractor": hole})
    write(bad, "bad.csv")
    outcome = run("check", "bad.csv", "-v", TRUCK)
    assert outcome.code == 0
    assert "Something is wrong with the data" in outcome.out.replace("\n", " ")
    assert outcome.out.index(f"bad: {name}: goes against") < outcome.out.index("Parameter")
    assert outcome.out.index("Beware") < outcome.out.index("bad: roll_rate.tractor: 8% missing")
    severities = [f["severity"] for f in run("check", "bad.csv", "-v", TRUCK, "--json").json()["findings"]]
    assert severities == ["error", "warning"]
    write(bad.with_signals({"speed": np.zeros(len(bad))}), "rest.csv")
    outcome = run("check", "rest.csv", "-v", TRUCK)
    refused(outcome, r"speed: at most 0\.0 m/s")
    assert "roll_rate.tractor: 8% missing" in outcome.err


def test_check_refuses(folder, run):  # noqa: F811
    log = folder / "drive.csv"
    refused(run("check", "nothing.csv", "-v", TRUCK), r"nothing\.csv: cannot be read")
    refused(run("check", log, "-v", "lorry"), r"lorry: no such file")
    refused(run("check", log, log, "-v", TRUCK), r"logs: .*given more than once")
    refused(run("check", log, "-v", TRUCK, "--hold", "tractor.colour"), r"tractor\.colour: no such parameter")
    refused(run("check", log, "-v", TRUCK, "--free", "tractor.colour"), r"tractor\.colour: no such parameter")
    refused(run("check", "-v", TRUCK), r".*")
    record = read(log)
    kept = {name: values for name, values in record.signals.items() if name != "yaw_rate.semitrailer"}
    write(replace(record, signals=kept), "blind.csv")
    refused(run("check", "blind.csv", "-v", TRUCK), r"yaw_rate\.semitrailer: in none of the logs")


def test_design_proposes_a_drive(run):  # noqa: F811
    outcome = run("design", "-v", TRUCK, "--want", f"{INERTIA}=5%", *FAST, "--out", "drive.csv")
    assert (outcome.code, outcome.err) == (0, "")
    assert re.match(r"\d+ s of driving tell all that is wanted\.", outcome.out)
    assert re.search(r"- \d+ x lane change of 0\.\d Hz.*, at a steady 80 km/h\.", outcome.out)
    assert re.search(r"\+-5 % .*can be told", line_of(outcome.out, INERTIA))
    assert "Written: drive.csv" in outcome.out
    record = read("drive.csv")
    assert set(record.signals) == {"speed", "steer.tractor.front"}
    assert record.signals["speed"] == pytest.approx(80 / 3.6)
    expected = plan(get(TRUCK), {INERTIA: 0.05}).best
    assert 0 < np.abs(record.signals["steer.tractor.front"]).max() < 0.1
    assert record.span[1] + 0.01 >= expected.duration - 1e-6  # other speeds may do it faster


def test_design_says_why_not(run):  # noqa: F811
    outcome = run("design", "-v", TRUCK, "--want", f"{HEIGHT}=2%", "--speed", "80")
    assert outcome.code == 0
    assert outcome.out.startswith("No drive tells all that is wanted, 1 of 1 fall short")
    assert re.search(
        rf"- {HEIGHT}: \d+ %, 2 % wanted; -> \d+ % if semitrailer\.roll_[a-z]+ were known \(--hold\)",
        outcome.out.replace("roll_axis_height", "roll_axis"),
    )
    told = run(
        "design", "-v", TRUCK, "--want", f"{HEIGHT}=2%", *FAST, "--json",
        "--channels", "yaw_rate.tractor,articulation.semitrailer",
    ).json()  # fmt: skip
    assert told["met"] is False
    assert told["unmet"][0]["remedies"][0]["channel"] == "roll_rate.semitrailer"


def test_design_as_json(run):  # noqa: F811
    told = run(
        "design", "-v", TRUCK, *FAST, "--max-acceleration", "1.2", "--hold", SOUGHT[0], "--json", "-o", "d.parquet"
    )
    assert (told.code, told.err) == (0, "")
    found = told.json()
    assert found["wants"] == dict.fromkeys(SOUGHT[1:4], 0.05)
    assert found["best"]["acceleration"] <= 1.2
    assert found["best"]["sigma"].keys() == set(SOUGHT[1:])
    assert found["files"] == {"d.parquet": "d.parquet"}
    assert len(read("d.parquet")) == pytest.approx(100 * found["best"]["duration"], abs=found["best"]["repetitions"])
    assert json.dumps(found).isprintable()


def test_design_refuses(run):  # noqa: F811
    refused(run("design", "-v", TRUCK, "--want", "tractor.colour=5%"), r"tractor\.colour: no such parameter")
    refused(run("design", "-v", TRUCK, "--want", f"{INERTIA}=much"), r"--want .*: expected NAME=PART")
    refused(run("design", "-v", TRUCK, "--want", f"{INERTIA}=0"), r"semitrailer\.yaw_inertia: expected a wanted sigma")
    refused(run("design", "-v", TRUCK, "--speed", "fast"), r"--speed: 'fast' is not a number with a unit")
    refused(run("design", "-v", TRUCK, "--speed", "200"), r"speed: expected 18 to 144 km/h")
    refused(run("design", "-v", TRUCK, "--channels", "sideslip.tractor"), r"sideslip\.tractor: no channel")
    refused(run("design", "-v", TRUCK, *FAST, "--out", "drive.txt"), r"drive\.txt: no format")
    refused(run("design", "-v", TRUCK, "--max-acceleration", "9"), r".*")
    refused(run("design", "-v", "lorry"), r"lorry: no such file")
    assert list(Path().iterdir()) == []


@pytest.mark.parametrize("command", ["check", "design"])
def test_help(command, run):  # noqa: F811
    for flag in ("--help", "-h"):
        outcome = run(command, flag)
        assert (outcome.code, outcome.err) == (0, "")
        assert outcome.out.partition("Examples")[2].count(f"fifthwheel {command}") >= 3
    assert command in run("--help").out
