"""`fifthwheel evaluate` and `validate`: tables, files, options and what they refuse."""

import json

import pytest

import fifthwheel as fw
from tests.apps.cli.test_cli import TRUCK, run  # noqa: F401 - a fixture

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


def test_the_tables_and_the_files(logs, run, tmp_path):  # noqa: F811
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


def test_a_result_folder_as_vehicle(logs, run, tmp_path):  # noqa: F811
    folder = tmp_path / "result"
    folder.mkdir()
    (folder / "vehicle.toml").write_text((logs / "truck.toml").read_text())
    (folder / "identification.json").write_text("{}")
    outcome = run("evaluate", logs / "step.parquet", "--test", "step", "-v", folder, "-o", tmp_path / "out")
    assert (outcome.code, outcome.err) == (0, "")
    assert str(folder / "vehicle.toml") in (tmp_path / "out" / "evaluation.html").read_text()


def test_without_a_vehicle_and_a_folder(logs, run):  # noqa: F811
    result = run("evaluate", logs / "step.parquet", "--test", "step", "--json").json()
    assert "response_time.yaw_rate.semitrailer" in [m["name"] for m in result["measures"]]
    assert result["files"] == {}
    assert all(c["met"] is not False for c in result["conditions"])


def test_the_nonlinear_truck_is_driven_with_the_inputs_of_the_log(logs, run, tmp_path):  # noqa: F811
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


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--test", "stepp"), "test: 'stepp' is not known; did you mean 'step'"),
        (("--test", "pulse"), "no pulse, but steering for"),
        (("--test", "step", "--figures", "svg"), "--figures: needs a folder; add -o FOLDER"),
        ((), "Missing option '--test'"),
    ],
)
def test_wrong_calls(logs, run, arguments, message):  # noqa: F811
    outcome = run("evaluate", logs / "step.parquet", *arguments)
    assert outcome.code == 2
    assert message in " ".join(outcome.err.split())


def test_a_validation_with_maps_of_both_files(logs, run, tmp_path):  # noqa: F811
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


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--test", "steady_state"), "results, step: 10.0 s long, this test needs at least 15 s"),
        (("--test", "step", "--tolerance", "yaw_rate=5 kg"), "tolerance yaw_rate=5 kg: expected rad/s"),
        (("--test", "step", "--tolerance", "yaw_rate"), "--tolerance yaw_rate: expected NAME=VALUE, such as yaw_rate="),
        (("--test", "step", "--tolerance", "jaw_rate=5%"), "tolerance jaw_rate: nothing with this name is compared;"),
        (("--test", "step", "--figures", "svg"), "--figures: needs a folder; add -o FOLDER"),
    ],
)
def test_wrong_validations(logs, run, arguments, message):  # noqa: F811
    outcome = run("validate", logs / "step.parquet", logs / "step.parquet", *arguments)
    assert outcome.code == 2
    assert message in " ".join(outcome.err.split())
