"""`fifthwheel assess`: table, files, options and what it refuses."""

import json

import pytest

import fifthwheel as fw
from tests.apps.cli.test_cli import TRUCK, run  # noqa: F401 - a fixture

QUICK = ("--linear", "--speed", "80km/h")


@pytest.fixture(scope="module")
def exact(tmp_path_factory):
    """A vehicle file without uncertainty, so that only the half track has a sigma."""
    truck = fw.vehicle(TRUCK)
    path = tmp_path_factory.mktemp("trucks") / "exact.toml"
    truck.with_stated(dict.fromkeys(truck.parameters(), 0.0)).save(path)
    return path


def test_the_table_and_the_files(exact, run, tmp_path):  # noqa: F811
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


def test_a_file_is_no_folder_for_results(exact, run, tmp_path):  # noqa: F811
    (tmp_path / "file").write_text("mine")
    outcome = run("assess", exact, *QUICK, "-o", tmp_path / "file")
    assert outcome.code == 2
    assert outcome.err.endswith("file: expected a folder, got a file; choose another name\n")
    assert (tmp_path / "file").read_text() == "mine"


def test_set_changes_a_parameter_and_its_sigma(exact, run):  # noqa: F811
    plain = run("assess", exact, *QUICK, "--json").json()
    text = "semitrailer.payload.height=1.8 m +- 10 %"
    changed = run("assess", exact, *QUICK, "--set", text, "--body", "half_track=1m", "--json").json()
    assert plain["uncertain"] == {"half_track": {"name": "Half track", "sigma": 0.03, "unit": "m"}}
    assert list(changed["uncertain"]) == ["semitrailer.payload.height"]
    assert changed["uncertain"]["semitrailer.payload.height"]["sigma"] == pytest.approx(0.18)
    assert plain["units"] == {"speed": "m/s", "body": "m"}
    assert changed["measures"][0]["value"] < plain["measures"][0]["value"]


def test_an_identification_in_a_folder(result, run, tmp_path):  # noqa: F811
    result.identification.save(tmp_path / "found")
    outcome = run("assess", tmp_path / "found", "--linear", "--json")
    assert outcome.code == 0
    assert "joint covariance" in outcome.json()["origin"]
    path = tmp_path / "found" / "identification.json"
    assert run("assess", path, "--linear", "--json").json()["measures"] == outcome.json()["measures"]


def test_the_evidence_of_an_identification_has_its_conclusion_its_note_and_its_logs(identified, run, tmp_path):  # noqa: F811
    folder, printed = identified
    run("assess", folder, "--linear", "-o", "assessed")
    contents = json.loads((tmp_path / "assessed" / "assessment.json").read_text())
    assert contents["identification"][0] == printed["conclusion"]["headline"]
    assert {row["verdict"] for row in contents["parameters"]} >= {"converged", "assumed"}
    names = [file["path"].rpartition("/")[2] for file in contents["provenance"]["files"]]
    assert names == ["identification.json", "first.csv", "second.parquet", "flat.csv"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--set", "semitrailer.payload.height"), "--set semitrailer.payload.height: expected PATH=VALUE"),
        (("--set", "semitrailer.payload.height=1.8kg"), "--set semitrailer.payload.height: "),
        (("--set", "semitrailer.payload.hight=1.8m"), "semitrailer.payload.hight: expected the path of a parameter"),
        (("--body", "half_track"), "--body half_track: expected NAME=VALUE"),
        (("--body", "half_tracks=1m"), "half_tracks: no such dimension of the body"),
        (("--speed", "80kg"), "--speed 80kg: "),
        (("--speed", "10"), "speed: expected 5 to 40 m/s (18 to 144 km/h), got 2.778 m/s (10 km/h); give a road speed"),
        (("--figures", "svg"), "--figures: needs a folder; add -o FOLDER"),
    ],
)
def test_what_is_refused_names_the_key_and_the_cure(run, options, message):  # noqa: F811
    outcome = run("assess", TRUCK, *options)
    assert (outcome.code, outcome.out) == (2, "")
    assert outcome.err.startswith(f"error: {message}")
    assert outcome.err.count("\n") == 1


def test_a_folder_without_an_identification(run, tmp_path):  # noqa: F811
    outcome = run("assess", tmp_path)
    assert outcome.code == 2
    assert "identification.json" in outcome.err
