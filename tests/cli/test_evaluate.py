"""`fifthwheel evaluate`: table, files, options and what it refuses."""

import json

import pytest

import fifthwheel as fw
from tests.cli.test_cli import TRUCK, run  # noqa: F401 - a fixture


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


def test_without_a_vehicle_and_a_folder(logs, run):  # noqa: F811
    result = run("evaluate", logs / "step.parquet", "--test", "step", "--json").json()
    assert "response_time.yaw_rate.semitrailer" in [m["name"] for m in result["measures"]]
    assert result["files"] == {}
    assert all(c["met"] is not False for c in result["conditions"])


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
