"""`fifthwheel knowledge` and `fifthwheel fleet`."""

import json
import shutil
from pathlib import Path

import pytest

from fifthwheel.base.atomic import one_run
from fifthwheel.estimate.identify.knowledge.knowledge import Knowledge
from tests.apps.cli.conftest import ESTIMATED, LINEAR, TRUCK, refused
from tests.apps.fleet.make import FIXED, make_fleet


@pytest.fixture
def result(identified, tmp_path) -> Path:
    """A result folder of two logs."""
    shutil.copytree(identified[0], tmp_path / "result")
    return tmp_path / "result"


def test_the_estimates_of_all_logs_and_their_history(result, run):
    shown = run("knowledge", "show", result)
    assert (shown.code, shown.err) == (0, "")
    assert shown.out.startswith("2 logs, 5 estimated parameters.")
    for name in ESTIMATED:
        assert name in shown.out
    assert " load " in shown.out
    assert "mass_scale" not in shown.out
    assert "mass_scale" in run("knowledge", "show", result, "--all").out
    contents = run("knowledge", "show", result / "knowledge.json", "--json").json()
    assert contents["logs"] == ["first", "second"]
    assert [e["name"] for e in contents["estimates"]] == ESTIMATED
    identification = json.loads((result / "identification.json").read_text())
    for own, estimate in zip(contents["estimates"], identification["parameters"], strict=False):
        assert abs(own["value"] - estimate["value"]) < 0.5 * estimate["sigma"]
    assert len(run("knowledge", "show", result, "--json", "--all").json()["estimates"]) > 40
    assert run("knowledge", "history", result).out.startswith("2 logs.")
    first, second = run("knowledge", "history", result, "--json").json()["logs"]
    assert (first["name"], second["name"]) == ("first", "second")
    assert [row["name"] for row in first["added"]] == ESTIMATED
    assert all(row["sigma_after"] < row["sigma_before"] for row in (*first["added"], *second["added"]))


def test_a_log_is_forgotten_in_place(result, run):
    outcome = run("knowledge", "forget", result, "first")
    assert outcome.code == 0
    assert outcome.out.startswith("1 log, 5 estimated parameters.")
    assert "those of the last identify: run it again" in outcome.out
    assert [log.name for log in Knowledge.load(result).logs] == ["second"]
    with one_run(result / "knowledge.json", result / "identification.json"):
        pass  # run.json has the new digest
    assert not (result / ".fifthwheel").exists()
    refused(run("knowledge", "forget", result, "second"), "second: the last log, .*; delete the file instead")


def test_a_log_is_forgotten_in_another_file(result, run):
    before = (result / "knowledge.json").read_bytes()
    outcome = run("knowledge", "forget", result, "second", "-o", "left.json", "--json")
    assert outcome.json()["logs"] == ["first"]
    assert [log.name for log in Knowledge.load("left.json").logs] == ["first"]
    assert (result / "knowledge.json").read_bytes() == before
    refused(run("knowledge", "forget", result, "second", "-o", "left.json"), "left.json: exists; .*--force")
    assert run("knowledge", "forget", result, "second", "-o", "left.json", "--force").code == 0


def test_what_is_refused(result, run):
    """A file that was changed is not replaced."""
    refused(run("knowledge", "forget", result, "firts"), "firts: no such log; did you mean 'first'")
    refused(run("knowledge", "show", "absent"), "absent: cannot be read")
    Knowledge(logs=Knowledge.load(result).logs[::-1]).save(result / "knowledge.json")
    refused(run("knowledge", "forget", result, "first"), ".*changed since fifthwheel identify wrote it, .*--out")
    (result / "knowledge.json").unlink()
    refused(run("knowledge", "show", result), ".*knowledge.json: the result in this folder has no knowledge, .*ident")
    (result / "knowledge.json").write_text("{}")
    refused(run("knowledge", "forget", result, "first"), ".*knowledge.json: ")


@pytest.mark.slow
def test_merged_knowledge_begins_an_identification(result, run, folder, tmp_path):
    assert run("knowledge", "forget", result, "first", "-o", "one.json").code == 0
    assert run("knowledge", "forget", result, "second", "-o", "other").code == 0
    merged = run("knowledge", "merge", "one.json", "other", result, "-o", "merged.json", "--json").json()
    assert merged["logs"] == ["second", "first"]
    refused(run("knowledge", "merge", "one.json", "-o", "merged.json"), "merged.json: exists")
    begin = ("identify", folder / "flat.csv", "--knowledge", "merged.json")
    begun = run(*begin, "-v", TRUCK, "-o", "next", "--json", *LINEAR).json()
    assert "merged.json" in Path("next/report.html").read_text(encoding="utf-8").replace("<wbr/>", "")
    assert any("Begins with the information of earlier logs (2," in note for note in begun["notes"])
    assert [log.name for log in Knowledge.load("next").logs] == ["second", "first", "flat"]
    refused(
        run(*begin, "-v", TRUCK, "--set", "semitrailer.mass=40t"),
        "semitrailer.mass: 40000 kg, but 33450 kg with the same load in first: another load",
    )
    refused(run("identify", folder / "flat.csv", "-v", "other"), "other: a folder without .*--knowledge other")
    lorry = Path("lorry.toml")
    lorry.write_text(run("vehicle", TRUCK).out.replace('"tractor"', '"lorry"'), encoding="utf-8")
    refused(run(*begin, "-v", lorry), "lorry: the knowledge is of a truck whose first unit is tractor")


OPTIONS = [word for name in FIXED for word in ("--set", f"{name}=exact")]


@pytest.mark.slow
def test_a_run_and_its_page(run, tmp_path):
    manifest, out, page = make_fleet(tmp_path / "fleet", trucks=1, trips=2), tmp_path / "out", tmp_path / "fleet.html"
    first = run("fleet", "run", manifest, "--out", out, "--jobs", "1", *OPTIONS)
    assert (first.code, first.err) == (0, "")
    assert first.out.startswith("2 trips: 2 new\n")
    again = run("fleet", "run", manifest, "--out", out, "--jobs", "1", *OPTIONS, "--json").json()
    assert (again["new"], again["unchanged"]) == (0, 2)
    written = run("fleet", "report", out, "--out", page)
    assert written.out == f"Written: {page}; nothing needs attention\n"
    assert "nothing needs attention" in page.read_text()
    assert run("fleet", "report", out, "--out", page).code == 2, "a file is replaced only with --force"
    assert run("fleet", "report", out, "--out", page, "--force", "--json").json()["attention"] == []


def test_fleets_that_are_refused(run):
    for arguments, message in (
        (("run", "none.csv"), ".*none.csv"),
        (("run", "https://example.org/manifest.csv"), ".*expected a local path or one of s3://"),
        (("report", "nowhere"), ".*give the data set"),
        (("run", "none.csv", "--height-limit", "3 kg"), ".*kg"),
        (("run", "none.csv", "--false-alarms", "2"), "false_alarms: expected"),
    ):
        refused(run("fleet", *arguments), message)
