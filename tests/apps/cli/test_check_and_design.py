"""`fifthwheel check` and `fifthwheel design`: what they print, their files and their exit codes."""

import json
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
FAST = ("--speed", "80km/h")


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


def test_check_tells_every_parameter(folder, run):
    outcome = run("check", folder / "drive.csv", "-v", TRUCK)
    assert (outcome.code, outcome.err) == (0, "")
    headline = (
        "drive: 5 of 5 parameters are identifiable; rough, with a sigma above 15 %: the height of the trailer payload."
    )
    assert outcome.out.startswith(headline)
    for name in ESTIMATED:
        assert re.search(r"\+-30 %|\+-61 %", line_of(outcome.out, name))
        assert line_of(outcome.out, name).rstrip().endswith(" identifiable")
    assert re.search(
        rf"- {spoken(HEIGHT)}: \d+ % -> \d+ % if a static test of the semitrailer \(fifthwheel roll-test\) gives "
        r".* to 2 cm",
        " ".join(outcome.out.split()),
    )
    assert "Errors in the logs" not in outcome.out
    assert list(Path().iterdir()) == []


def test_check_in_80_columns(folder, run, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    outcome = run("check", folder / "drive.csv", "-v", TRUCK)
    assert max(map(len, outcome.out.splitlines())) <= 80
    assert outcome.out.isascii()
    assert all(line_of(outcome.out, name).endswith(" identifiable") for name in ESTIMATED)


def test_check_of_a_straight_drive(folder, run):
    """Nothing to be told is an answer, not an error."""
    outcome = run("check", folder / "straight.csv", "-v", TRUCK)
    assert (outcome.code, outcome.err) == (0, "")
    assert outcome.out.startswith("straight: no parameter is identifiable, the excitation is too small.")
    for name in ESTIMATED:
        assert line_of(outcome.out, name).rstrip().endswith("not excited")
        remedy = rf"(?m)^- {spoken(name)}: not excited -> [\d.]+ % if one more lane"
        assert re.search(remedy, outcome.out)
    assert "at 88 km/h" in outcome.out


def test_check_as_json(folder, run):
    logs = folder / "drive.csv", folder / "straight.csv"
    told = run(
        "check", *logs, "-v", TRUCK, "--json", f"--set={ESTIMATED[0]}=exact", "--set=tractor.yaw_inertia=free"
    ).json()
    assert [p["name"] for p in told["parameters"]] == [*ESTIMATED[1:], "tractor.yaw_inertia"]
    assert told["logs"] == ["drive", "straight"]
    assert told["findings"] == []
    assert set(told["noise"]) == {"drive", "straight"}
    for p in told["parameters"]:
        assert {
            "value",
            "prior",
            "sigma",
            "conditional_sigma",
            "verdict",
            "correlated_with",
            "remedies",
            "unit",
        } <= p.keys()


@pytest.mark.slow
def test_check_lists_what_is_wrong(folder, run):
    """All of it at once: in the page where a fit could go on, as the error where none could."""
    record = read_log(folder / "drive.csv")
    name = "yaw_rate.semitrailer"
    hole = record.signals["roll_rate.tractor"].copy()
    hole[300:420] = np.nan
    bad = record.with_signals({name: -record.signals[name], "roll_rate.tractor": hole})
    write_record(bad, "bad.csv")
    outcome = run("check", "bad.csv", "-v", TRUCK)
    assert outcome.code == 0
    assert "The logs have errors" in outcome.out.replace("\n", " ")
    assert outcome.out.index(f"bad: {name}: the sign contradicts") < outcome.out.index("Parameter")
    assert outcome.out.index("Cautions") < outcome.out.index("bad: roll_rate.tractor: 7.5 % of the")
    severities = [f["severity"] for f in run("check", "bad.csv", "-v", TRUCK, "--json").json()["findings"]]
    assert severities == ["error", "warning"]
    write_record(bad.with_signals({"speed": np.zeros(len(bad))}), "rest.csv")
    outcome = run("check", "rest.csv", "-v", TRUCK)
    refused(outcome, r"speed: at most 0\.0 m/s")
    assert "roll_rate.tractor: 7.5 % of the samples are missing" in outcome.err


def test_check_refuses(folder, run):
    log = folder / "drive.csv"
    refused(run("check", "nothing.csv", "-v", TRUCK), r"nothing\.csv: cannot be read")
    refused(run("check", log, "-v", "lorry"), r"lorry: no such file")
    refused(run("check", log, log, "-v", TRUCK), r"logs: .*given more than once")
    refused(run("check", log, "-v", TRUCK, "--set", "tractor.colour=exact"), r"tractor\.colour: no such parameter")
    refused(run("check", log, "-v", TRUCK, "--set", "tractor.colour=free"), r"tractor\.colour: no such parameter")
    refused(run("check", "-v", TRUCK), r".*")
    record = read_log(log)
    kept = {name: values for name, values in record.signals.items() if not name.startswith("yaw_rate")}
    write_record(replace(record, signals=kept), "blind.csv")
    refused(run("check", "blind.csv", "-v", TRUCK), r"yaw_rate\.tractor: in none of the logs")


@pytest.mark.slow
def test_design_proposes_a_drive(run):
    outcome = run("design", "-v", TRUCK, "--target", f"{INERTIA}=10%", *FAST, "--out", "drive.csv")
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
def test_design_says_why_not(run):
    outcome = run("design", "-v", TRUCK, "--target", f"{HEIGHT}=2%", "--speed", "80")
    assert outcome.code == 0
    assert outcome.out.startswith("No run reaches all targets: 1 of 1 missed")
    assert re.search(
        rf"- {HEIGHT}: \d+ %, target 2 %; -> \d+ % if a static test of the semitrailer .*, "
        r"-> \d+ % if semitrailer\.roll_[a-z]+ is measured and fixed \(--set\)",
        " ".join(outcome.out.split()),
    )
    told = run(
        "design", "-v", TRUCK, "--target", f"{HEIGHT}=2%", *FAST, "--json",
        "--channels", "yaw_rate.tractor,articulation.semitrailer",
    ).json()  # fmt: skip
    assert told["met"] is False
    assert told["unmet"][0]["remedies"][0]["channel"] == "roll_rate.semitrailer"


@pytest.mark.slow
def test_design_as_json(run, monkeypatch):
    """Among manoeuvres of two frequencies."""
    monkeypatch.setattr(search, "candidate_manoeuvres", lambda speed, some: candidate_manoeuvres(speed, some[:2]))
    told = run("design", "-v", TRUCK, *FAST, "--max-acceleration", "1.2", "--json", "-o", "d.parquet")
    assert (told.code, told.err) == (0, "")
    found = told.json()
    assert found["targets"] == dict.fromkeys(ESTIMATED[:4], 0.05)
    assert found["best"]["acceleration"] <= 1.2
    assert found["best"]["sigma"].keys() == set(ESTIMATED)
    assert found["files"] == {"d.parquet": "d.parquet"}
    assert len(read_log("d.parquet")) == pytest.approx(
        100 * found["best"]["duration"], abs=found["best"]["repetitions"]
    )
    assert json.dumps(found).isprintable()


def test_design_refuses(run):
    refused(run("design", "-v", TRUCK, "--target", "tractor.colour=5%"), r"tractor\.colour: no such parameter")
    refused(run("design", "-v", TRUCK, "--target", f"{INERTIA}=much"), r"--target .*: expected NAME=FRACTION")
    refused(
        run("design", "-v", TRUCK, "--target", f"{INERTIA}=0"), r"semitrailer\.yaw_inertia: expected a target sigma"
    )
    refused(run("design", "-v", TRUCK, "--speed", "fast"), r"--speed fast: expected a number with a unit")
    refused(run("design", "-v", TRUCK, "--speed", "200"), r"speed: expected road speeds of 18 to 144 km/h")
    refused(run("design", "-v", TRUCK, "--channels", "sideslip.tractor"), r"sideslip\.tractor: not a channel")
    refused(run("design", "-v", TRUCK, *FAST, "--out", "drive.txt"), r"drive\.txt: no format")
    refused(run("design", "-v", TRUCK, "--max-acceleration", "9"), r".*")
    refused(run("design", "-v", "lorry"), r"lorry: no such file")
    assert list(Path().iterdir()) == []


def test_a_roll_test_writes_a_vehicle_file(run):
    outcome = run(*ROLL_TEST, "--roll", "0.42 deg +- 2 %", "-o", "tested.toml")
    assert (outcome.code, outcome.err) == (0, "")
    assert line_of(outcome.out, "semitrailer.roll_stiffness")
    readings = ("--roll", "0.42 deg +- 2 %", "--displacement", "0.7 mm +- 0.1 mm", "--height", "0.9 m +- 5 mm")
    numbers = run(*ROLL_TEST, *readings, "--json", "--force", "-o", "tested.toml").json()["parameters"]
    assert numbers["semitrailer.roll_axis_height"]["value"] == pytest.approx(0.9 - 0.7e-3 / np.radians(0.42))
    tested = Vehicle.load("tested.toml")
    assert {path: tested.stated[path] for path in numbers} == {path: n["sigma"] for path, n in numbers.items()}


def test_readings_need_a_standard_deviation(run):
    refused(run(*ROLL_TEST, "--roll", "0.42 deg"), r"--roll: expected a standard deviation after '\+-'")
    refused(run(*ROLL_TEST, "--roll", "0.42 kg +- 1 %"), "--roll: ")
    assert list(Path().iterdir()) == []


@pytest.mark.parametrize("text", ["3", "3..x", "run=3"])
def test_a_window_that_is_not_one_is_refused(text, run):
    refused(run("check", "run.csv", "-v", TRUCK, "--exclude", text), f"--exclude {text}: expected FIRST..LAST")


@pytest.mark.slow
def test_excluded_windows_are_not_used(folder, run):
    log = folder / "drive.csv"
    refused(run("check", log, "-v", TRUCK, "--exclude", "0..100"), "drive.csv: all samples are in the windows")
    refused(run("check", log, "-v", TRUCK, "--exclude", "other=0..100"), "other: windows are excluded")
    write_record(read_log(log).cut(8.005), folder / "second.csv")
    both, one, second = (
        {p["name"]: p["sigma"] for p in run("check", *arguments, "-v", TRUCK, "--json").json()["parameters"]}
        for arguments in ((log,), (log, "--exclude", "drive=0..8"), (folder / "second.csv",))
    )
    assert one == pytest.approx(second)  # without the first of two lane changes
    assert all(one[name] > 1.03 * sigma for name, sigma in both.items())
