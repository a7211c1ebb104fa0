"""`fifthwheel assess`, `compare`, `evaluate` and `validate`: output, files and exit codes."""

import csv
import importlib
import json
import shutil

import pytest

import fifthwheel as fw
from fifthwheel.results.assess import steady_motion
from tests.apps.cli.conftest import TRUCK, refused
from tests.results.report.conftest import NASTY, Page

QUICK = ("--linear", "--speed", "80km/h")


@pytest.fixture(scope="module")
def exact(tmp_path_factory):
    """A vehicle file without uncertainty, so that only the half track has a sigma."""
    truck = fw.vehicle(TRUCK)
    path = tmp_path_factory.mktemp("trucks") / "exact.toml"
    truck.with_stated(dict.fromkeys(truck.parameters(), 0.0)).save(path)
    return path


def test_an_assessment_as_table_and_files(exact, run, tmp_path):
    outcome = run("assess", exact, *QUICK, "-o", tmp_path / "out", "--body", "rear_overhang=2.7m")
    assert (outcome.code, outcome.err) == (0, "")
    assert outcome.out.startswith(f"{TRUCK} at 80 km/h: meets all thresholds of the Australian PBS that are assessed.")
    assert "static rollover threshold" in outcome.out
    assert "wheel lift, drive axle" in outcome.out
    assert ">= 0.35 g" in outcome.out
    assert "level 1: <= 0.3 m" in outcome.out  # of the tail swing
    contents = json.loads((tmp_path / "out" / "assessment.json").read_text())
    assert contents["speed"] == pytest.approx(80 / 3.6)
    page = (tmp_path / "out" / "assess.html").read_text()
    assert all(text in page for text in ("steer tyre friction demand", "Lane change", "Low-speed turn of 90°"))
    (source,) = contents["provenance"]["files"]
    for text in (source["sha256"], "steer tyre friction demand", "met"):
        assert text in (tmp_path / "out" / "evidence.html").read_text()
    assert run("verify", tmp_path / "out").out.startswith(f"{tmp_path / 'out'}: 4 files as recorded.")
    (tmp_path / "out" / "assess.html").write_text("other")
    outcome = run("verify", tmp_path / "out", "--json")
    assert (outcome.code, outcome.json()["intact"], outcome.json()["files"][0]["state"]) == (1, False, "differs")


def test_set_changes_a_parameter_and_its_sigma(exact, run):
    plain = run("assess", exact, *QUICK, "--json").json()
    text = "semitrailer.payload.height=1.8 m +- 10 %"
    changed = run("assess", exact, *QUICK, "--set", text, "--body", "half_track=1m", "--json").json()
    assert plain["uncertain"] == {"half_track": {"name": "Half track", "sigma": 0.03, "unit": "m"}}
    assert list(changed["uncertain"]) == ["semitrailer.payload.height"]
    assert changed["uncertain"]["semitrailer.payload.height"]["sigma"] == pytest.approx(0.18)
    assert plain["units"] == {"speed": "m/s", "body": "m"}
    assert changed["measures"][0]["value"] < plain["measures"][0]["value"]


@pytest.mark.slow
def test_the_evidence_of_an_identification_has_its_conclusion_its_note_and_its_logs(
    identified, run, tmp_path, monkeypatch
):
    """Given by its folder or by its file."""
    folder, printed = identified
    run("assess", folder, "--linear", "-o", "assessed")
    contents = json.loads((tmp_path / "assessed" / "assessment.json").read_text())
    assert "joint covariance" in contents["origin"]
    module = importlib.import_module("fifthwheel.results.assess.assessment")
    monkeypatch.setattr(module, "FAMILIES", (steady_motion.measure_understeer,))
    (measure,) = run("assess", folder / "identification.json", "--linear", "--json").json()["measures"]
    assert measure in contents["measures"]
    assert contents["identification"][0] == printed["conclusion"]["headline"]
    assert {row["verdict"] for row in contents["parameters"]} >= {"converged", "assumed"}
    names = [file["path"].rpartition("/")[2] for file in contents["provenance"]["files"]]
    assert names == ["identification.json", "first.csv", "second.parquet", "flat.csv"]


def test_what_is_refused_names_the_key_and_the_cure(exact, run, tmp_path):
    (tmp_path / "file").write_text("mine")
    for options, message in (
        (("--set", "semitrailer.payload.height"), "--set semitrailer.payload.height: expected PATH=VALUE"),
        (("--set", "semitrailer.payload.height=1.8kg"), "--set semitrailer.payload.height: "),
        (("--set", "semitrailer.payload.hight=1.8m"), "semitrailer.payload.hight: expected the path of a parameter"),
        (("--body", "half_track"), "--body half_track: expected NAME=VALUE"),
        (("--body", "half_tracks=1m"), "half_tracks: no such dimension of the body"),
        (("--speed", "80kg"), "--speed 80kg: "),
        (("--speed", "10"), r"speed: expected 5 to 40 m/s \(18 to 144 km/h\), got 2\.778 m/s \(10 km/h\); give a road"),
        (("--figures", "svg"), "--figures: needs a folder; add -o FOLDER"),
        ((*QUICK, "-o", tmp_path / "file"), ".*file: expected a folder, got a file; choose another name"),
    ):
        refused(run("assess", exact, *options), message)
    refused(run("assess", tmp_path), ".*identification.json")
    assert (tmp_path / "file").read_text() == "mine"


def test_a_place_for_the_results_is_refused_before_the_computation(exact, run, tmp_path):
    """Which would refuse something else here."""
    (tmp_path / "file").write_text("mine")
    absent = tmp_path / "absent.csv"
    for arguments in (
        ("assess", exact, "--speed", "10"),
        ("evaluate", absent, "--test", "step"),
        ("validate", absent, absent, "--test", "step"),
    ):
        refused(run(*arguments, "-o", tmp_path / "file"), ".*file: expected a folder, got a file; choose another name")


@pytest.fixture
def runs(identified, tmp_path):
    for name in ("monday", NASTY.replace("/", "")):
        (tmp_path / name).mkdir()
        shutil.copy(identified[0] / "identification.json", tmp_path / name)
    return tmp_path / "monday", tmp_path / NASTY.replace("/", "")


def test_compared_runs_as_table_and_files(runs, run, tmp_path):
    page, table = tmp_path / "c.html", tmp_path / "c.csv"
    outcome = run("compare", *runs, "--csv", table, "--html", page)
    assert (outcome.code, outcome.err) == (0, "")
    assert outcome.out.startswith("The runs share logs: no test of the truck. Largest difference: ")
    assert "Front tyres, cornering stiffness" in outcome.out
    assert "share first" in " ".join(outcome.out.split())
    with table.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 14
    assert {row["difference_in_sigmas"] for row in rows} == {"", "0.0"}
    text = Page(page.read_text()).text
    assert runs[1].name in text
    assert "Rollover threshold" in text
    assert "The runs share logs: no test of the truck." in text
    assert 'title="tractor.front.cornering_stiffness">Front tyres, cornering stiffness' in page.read_text()


def test_compared_runs_as_json_and_refusals(runs, identified, run, tmp_path):
    contents = run("compare", *runs, "--json").json()
    assert contents["runs"][0] == "monday"
    assert contents["parameters"][0]["differences"][1]["at_least"] is True
    both = [str(identified[0]), str(identified[0] / "identification.json")]
    assert run("compare", *both, "--json").json()["runs"] == both
    (tmp_path / "c.csv").touch()
    refused(run("compare", runs[0]), "runs: expected at least two")
    refused(run("compare", runs[0], tmp_path / "absent"), ".*absent")
    refused(run("compare", *runs, "--csv", tmp_path / "c.csv"), ".*c.csv: exists")


SIGNALS = ("steer.tractor.front", "yaw_rate.tractor")
MAP = """
[time]
column = "t"
[signals]
speed = { column = "v", unit = "km/h" }
"steer.tractor.front" = { column = "delta", unit = "rad" }
"yaw_rate.tractor" = { column = "r", unit = "rad/s" }
"""


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tests")
    truck = fw.vehicle(TRUCK)
    truck.save(folder / "truck.toml")
    for name in ("slowly_increasing_steer", "step"):
        fw.write_record(fw.simulate(truck, manoeuvre=name, rate=50.0, seed=1), folder / f"{name}.parquet")
    return folder


def test_an_evaluation_as_tables_and_files(logs, run, tmp_path):
    log, out = logs / "slowly_increasing_steer.parquet", tmp_path / "out"
    outcome = run("evaluate", log, "--test", "steady_state", "-v", logs / "truck.toml", "-o", out)
    assert (outcome.code, outcome.err) == (0, "")
    assert outcome.out.startswith("slowly_increasing_steer by ISO 14792:2011: understeer gradient 0.")
    assert "understeer gradient" in outcome.out
    assert "deg/g" in outcome.out
    assert "within 2 km/h of its mean" in outcome.out
    contents = json.loads((out / "evaluation.json").read_text())
    gradient = contents["measures"][0]
    assert gradient["name"] == "understeer_gradient"
    exact = fw.summarize(fw.vehicle(TRUCK)).understeer_gradient
    assert abs(gradient["value"] - exact) < 3 * gradient["sigma"]
    assert len(contents["arrays"]["lateral_acceleration"]) > 20
    page = (out / "evaluation.html").read_text()
    assert all(text in page for text in ("Steer angle less Ackermann angle", "Conditions of ISO 15037-2", "truck.toml"))
    again = run("evaluate", log, "--test", "steady_state", "-v", logs / "truck.toml", "-o", out, "--json")
    assert again.json()["files"] == {n: str(out / n) for n in ("evaluation.json", "evaluation.html")}


def test_without_a_vehicle_and_a_folder(logs, run):
    result = run("evaluate", logs / "step.parquet", "--test", "step", "--json").json()
    assert "response_time.yaw_rate.semitrailer" in [m["name"] for m in result["measures"]]
    assert result["files"] == {}
    assert all(c["met"] is not False for c in result["conditions"])


@pytest.mark.slow
def test_the_nonlinear_truck_is_driven_with_the_inputs_of_the_log(logs, run, tmp_path):
    pytest.importorskip("mujoco")
    truck = logs / "truck.toml"
    result = run(
        "validate", "plant", logs / "step.parquet", "--test", "step", "-v", truck, "-o", "out", "--json"
    ).json()
    assert result["results"]["log"] == "nonlinear truck"
    assert {curve["name"]: curve["verdict"] for curve in result["curves"]}["steer.tractor.front"] == "inside"
    assert run("verify", "out").code == 0
    outcome = run("validate", "plant", logs / "step.parquet", "--test", "step")
    assert outcome.err == "error: plant: needs the truck; add --vehicle\n"
    outcome = run("validate", "truck.fmu", logs / "step.parquet", "--test", "step", "--results-signals", "map.toml")
    assert outcome.err.startswith("error: --results-signals: a map of a file of results; omit it")


WRONG = (
    ("evaluate", ("--test", "stepp"), "test: 'stepp' is not known; did you mean 'step'"),
    ("evaluate", ("--test", "pulse"), "no pulse, but steering for"),
    ("evaluate", ("--test", "step", "--figures", "svg"), "--figures: needs a folder; add -o FOLDER"),
    ("evaluate", (), "Missing option '--test'"),
    ("validate", ("--test", "steady_state"), "results, step: 10.0 s long, this test needs at least 15 s"),
    ("validate", ("--test", "step", "--tolerance", "yaw_rate=5 kg"), "tolerance yaw_rate=5 kg: expected rad/s"),
    ("validate", ("--test", "step", "--tolerance", "yaw_rate"), "--tolerance yaw_rate: expected NAME=VALUE, such as "),
    ("validate", ("--test", "step", "--tolerance", "jaw_rate=5%"), "tolerance jaw_rate: nothing with this name is "),
    ("validate", ("--test", "step", "--figures", "svg"), "--figures: needs a folder; add -o FOLDER"),
)


def test_wrong_calls(logs, run):
    for command, arguments, message in WRONG:
        outcome = run(command, *[logs / "step.parquet"] * (1 + (command == "validate")), *arguments)
        assert outcome.code == 2
        assert message in " ".join(outcome.err.split())


@pytest.mark.slow
def test_a_validation_with_maps_of_both_files(logs, run, tmp_path):
    log, out = logs / "step.parquet", tmp_path / "out"
    record = fw.read_log(log)
    columns = ["t", "v", "delta", "r"]
    values = [record.time, 3.6 * record.signals["speed"], *(record.signals[n] for n in SIGNALS)]
    lines = [",".join(columns), *(",".join(map(repr, map(float, row))) for row in zip(*values, strict=True))]
    (tmp_path / "tool.csv").write_text("\n".join(lines))
    (tmp_path / "tool.toml").write_text(MAP)
    files = (tmp_path / "tool.csv", log, "--results-signals", tmp_path / "tool.toml", "--test", "step")
    outcome = run("validate", *files, "-v", logs / "truck.toml", "-o", out)
    assert (outcome.code, outcome.err) == (0, "")
    assert outcome.out.startswith("Step input, tool against step: undecided, ")
    contents = json.loads((out / "validation.json").read_text())
    assert contents["curves"][0]["exceedance"] == 0
    assert any("only in the log: " in note and "yaw_rate.semitrailer" in note for note in contents["notes"])
    page = (out / "validation.html").read_text()
    assert all(text in page for text in ("of no standard", "tool.toml", "Front axle, steer angle", "Verdict"))
    again = run("validate", *files, "--tolerance", "yaw_rate=1% + 2deg/s", "-o", out, "--json").json()
    assert again["files"] == {n: str(out / n) for n in ("validation.json", "validation.html")}
    (curve,) = (c for c in again["curves"] if c["name"] == "yaw_rate.tractor")
    assert (curve["tolerance"]["text"], curve["verdict"]) == ("1% + 2deg/s", "inside")
