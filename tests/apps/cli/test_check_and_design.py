"""`fifthwheel check`, `design` and `roll-test`: what they print, their files and their exit codes."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fifthwheel.data.logs import read_log, write_record
from fifthwheel.estimate.design import search
from fifthwheel.estimate.design.search import candidate_manoeuvres
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle, get
from fifthwheel.truck.spoken_names import spoken
from tests.apps.cli.conftest import ESTIMATED, TRUCK, refused

HEIGHT, INERTIA = ESTIMATED[-1], ESTIMATED[-2]
CHECK, DESIGN = ("check", "-v", TRUCK), ("design", "-v", TRUCK, "--speed", "80km/h")
ROLL_TEST = ("roll-test", "-v", TRUCK, "--load", "2 t +- 1 %", "--shift", "0.9 m +- 5 mm")


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    place = tmp_path_factory.mktemp("logs")
    write_record(simulate(get(TRUCK), count=2, seed=1), place / "drive.csv")
    write_record(simulate(get(TRUCK), manoeuvre="straight", duration=12), place / "straight.csv")
    return place


def line_of(out: str, name: str) -> str:
    """The first line that begins with a parameter, by its path or in words."""
    return next(line for line in out.splitlines() if line.startswith((name, spoken(name))))


def test_check_tells_every_parameter_in_80_columns(folder, run, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    outcome = run(*CHECK, folder / "drive.csv")
    assert (outcome.code, outcome.err) == (0, "")
    words = " ".join(outcome.out.split())
    assert words.startswith(
        "drive: 5 of 5 parameters are identifiable; rough, with a sigma above 15 %: the height of the trailer payload."
    )
    for name in ESTIMATED:
        assert re.search(r"\+-30 %|\+-61 %", line_of(outcome.out, name))
        assert line_of(outcome.out, name).rstrip().endswith(" identifiable")
    assert re.search(
        rf"- {spoken(HEIGHT)}: \d+ % -> \d+ % if a static test of the semitrailer \(fifthwheel roll-test\) gives "
        r".* to 2 cm",
        words,
    )
    assert "Errors in the logs" not in outcome.out
    assert max(map(len, outcome.out.splitlines())) <= 80
    assert outcome.out.isascii()
    assert list(Path().iterdir()) == []


def test_check_of_a_straight_drive(folder, run):
    """Nothing to be told is an answer, not an error."""
    outcome = run(*CHECK, folder / "straight.csv")
    assert (outcome.code, outcome.err) == (0, "")
    assert outcome.out.startswith("straight: no parameter is identifiable, the excitation is too small.")
    for name in ESTIMATED:
        assert line_of(outcome.out, name).rstrip().endswith("not excited")
        assert re.search(rf"(?m)^- {spoken(name)}: not excited -> [\d.]+ % if one more lane", outcome.out)
    assert "at 88 km/h" in outcome.out


def test_check_as_json(folder, run):
    logs = folder / "drive.csv", folder / "straight.csv"
    told = run(*CHECK, *logs, "--json", f"--set={ESTIMATED[0]}=exact", "--set=tractor.yaw_inertia=free").json()
    assert [p["name"] for p in told["parameters"]] == [*ESTIMATED[1:], "tractor.yaw_inertia"]
    assert told["logs"] == [*told["noise"]] == ["drive", "straight"]
    assert told["findings"] == []
    keys = {"value", "prior", "sigma", "conditional_sigma", "verdict", "correlated_with", "remedies", "unit"}
    assert all(keys <= p.keys() for p in told["parameters"])


@pytest.mark.slow
def test_check_lists_what_is_wrong(folder, run):
    """All of it at once: in the page where a fit could go on, as the error where none could."""
    record, name = read_log(folder / "drive.csv"), "yaw_rate.semitrailer"
    hole = record.signals["roll_rate.tractor"].copy()
    hole[300:420] = np.nan
    bad = record.with_signals({name: -record.signals[name], "roll_rate.tractor": hole})
    write_record(bad, "bad.csv")
    outcome = run(*CHECK, "bad.csv")
    assert outcome.code == 0
    assert "The logs have errors" in outcome.out.replace("\n", " ")
    assert outcome.out.index(f"bad: {name}: the sign contradicts") < outcome.out.index("Parameter")
    assert outcome.out.index("Cautions") < outcome.out.index("bad: roll_rate.tractor: 7.5 % of the")
    write_record(bad.with_signals({"speed": np.zeros(len(bad))}), "rest.csv")
    outcome = run(*CHECK, "rest.csv")
    refused(outcome, r"speed: at most 0\.0 m/s")
    assert "roll_rate.tractor: 7.5 % of the samples are missing" in outcome.err


def test_check_refuses(folder, run):
    log = folder / "drive.csv"
    record = read_log(log)
    kept = {name: values for name, values in record.signals.items() if not name.startswith("yaw_rate")}
    write_record(replace(record, signals=kept), "blind.csv")
    for arguments, start in (
        ((), ".*"),
        (("nothing.csv",), r"nothing\.csv: cannot be read"),
        ((log, log), "logs: .*given more than once"),
        ((log, "--set", "tractor.colour=exact"), r"tractor\.colour: no such parameter"),
        ((log, "--set", "tractor.colour=free"), r"tractor\.colour: no such parameter"),
        (("blind.csv",), r"yaw_rate\.tractor: in none of the logs"),
        *((("run.csv", "--exclude", x), f"--exclude {x}: expected FIRST..LAST") for x in ("3", "3..x", "run=3")),
        ((log, "--exclude", "0..100"), r"drive\.csv: all samples are in the windows"),
        ((log, "--exclude", "other=0..100"), "other: windows are excluded"),
    ):
        refused(run(*CHECK, *arguments), start)
    refused(run("check", log, "-v", "lorry"), r"lorry: no such file")


@pytest.mark.slow
def test_design_proposes_a_drive(run):
    outcome = run(*DESIGN, "--target", f"{INERTIA}=10%", "--out", "drive.csv")
    assert (outcome.code, outcome.err) == (0, "")
    assert (proposed := re.match(r"A run of (\d+) s reaches all targets\.", outcome.out))
    assert re.search(r"- \d+ x lane change of 0\.\d Hz.*, at a constant 80 km/h\.", outcome.out)
    assert re.search(r"\+-10 % .*identifiable", line_of(outcome.out, INERTIA))
    assert "Written: drive.csv" in outcome.out
    record = read_log("drive.csv")
    assert set(record.signals) == {"speed", "steer.tractor.front"}
    assert record.signals["speed"] == pytest.approx(80 / 3.6)
    assert 0 < np.abs(record.signals["steer.tractor.front"]).max() < 0.1
    assert record.span[1] == pytest.approx(int(proposed[1]), abs=0.52)  # the text is rounded


@pytest.mark.slow
def test_design_says_why_not(run, monkeypatch):
    """Among manoeuvres of two frequencies."""
    monkeypatch.setattr(search, "candidate_manoeuvres", lambda speed, some: candidate_manoeuvres(speed, some[:2]))
    outcome = run(*DESIGN, "--target", f"{HEIGHT}=2%")
    assert outcome.code == 0
    assert outcome.out.startswith("No run reaches all targets: 1 of 1 missed")
    assert re.search(
        rf"- {HEIGHT}: \d+ %, target 2 %; -> \d+ % if a static test of the semitrailer .*, "
        r"-> \d+ % if semitrailer\.roll_[a-z]+ is measured and fixed \(--set\)",
        " ".join(outcome.out.split()),
    )
    channels = ("--channels", "yaw_rate.tractor,articulation.semitrailer")
    told = run(*DESIGN, "--target", f"{HEIGHT}=2%", *channels, "--max-acceleration", "1.2", "--json").json()
    assert told["met"] is False
    assert told["best"]["acceleration"] <= 1.2
    assert told["best"]["sigma"].keys() == set(ESTIMATED)
    assert told["unmet"][0]["remedies"][0]["channel"] == "roll_rate.semitrailer"


def test_design_refuses(run):
    for arguments, start in (
        (("--target", "tractor.colour=5%"), r"tractor\.colour: no such parameter"),
        (("--target", f"{INERTIA}=much"), r"--target .*: expected NAME=FRACTION"),
        (("--target", f"{INERTIA}=0"), r"semitrailer\.yaw_inertia: expected a target sigma"),
        (("--speed", "fast"), r"--speed fast: expected a number with a unit"),
        (("--speed", "200"), r"speed: expected road speeds of 18 to 144 km/h"),
        (("--channels", "sideslip.tractor"), r"sideslip\.tractor: not a channel"),
        (("--out", "drive.txt"), r"drive\.txt: no format"),
        (("--max-acceleration", "9"), r".*"),
    ):
        refused(run(*DESIGN, *arguments), start)
    refused(run("design", "-v", "lorry"), r"lorry: no such file")
    assert list(Path().iterdir()) == []


def test_a_roll_test_writes_a_vehicle_file(run):
    """Each reading needs a standard deviation."""
    refused(run(*ROLL_TEST, "--roll", "0.42 deg"), r"--roll: expected a standard deviation after '\+-'")
    refused(run(*ROLL_TEST, "--roll", "0.42 kg +- 1 %"), "--roll: ")
    assert list(Path().iterdir()) == []
    outcome = run(*ROLL_TEST, "--roll", "0.42 deg +- 2 %", "-o", "tested.toml")
    assert (outcome.code, outcome.err) == (0, "")
    assert line_of(outcome.out, "semitrailer.roll_stiffness")
    readings = ("--roll", "0.42 deg +- 2 %", "--displacement", "0.7 mm +- 0.1 mm", "--height", "0.9 m +- 5 mm")
    numbers = run(*ROLL_TEST, *readings, "--json", "--force", "-o", "tested.toml").json()["parameters"]
    assert numbers["semitrailer.roll_axis_height"]["value"] == pytest.approx(0.9 - 0.7e-3 / np.radians(0.42))
    tested = Vehicle.load("tested.toml")
    assert {path: tested.stated[path] for path in numbers} == {path: n["sigma"] for path, n in numbers.items()}
