"""`fifthwheel knowledge`: tables, logs that are forgotten, merged files, and what is refused."""

import json
import shutil
from pathlib import Path

import pytest

from fifthwheel.base.atomic import one_run
from fifthwheel.estimate.identify.knowledge.knowledge import Knowledge
from tests.apps.cli.test_cli import ESTIMATED, TRUCK, refused, run  # noqa: F401 - a fixture


@pytest.fixture
def result(identified, tmp_path) -> Path:
    """A result folder of two logs."""
    shutil.copytree(identified[0], tmp_path / "result")
    return tmp_path / "result"


def test_the_estimates_of_all_logs(result, run):  # noqa: F811
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


def test_the_history_of_the_logs(result, run):  # noqa: F811
    shown = run("knowledge", "history", result)
    assert shown.out.startswith("2 logs.")
    first, second = run("knowledge", "history", result, "--json").json()["logs"]
    assert (first["name"], second["name"]) == ("first", "second")
    assert [row["name"] for row in first["added"]] == ESTIMATED
    for row in (*first["added"], *second["added"]):
        assert row["sigma_after"] < row["sigma_before"]


def test_a_log_is_forgotten_in_place(result, run):  # noqa: F811
    outcome = run("knowledge", "forget", result, "first")
    assert outcome.code == 0
    assert outcome.out.startswith("1 log, 5 estimated parameters.")
    assert "those of the last identify: run it again" in outcome.out
    assert [log.name for log in Knowledge.load(result).logs] == ["second"]
    with one_run(result / "knowledge.json", result / "identification.json"):
        pass  # run.json has the new digest
    assert not (result / ".fifthwheel").exists()
    refused(run("knowledge", "forget", result, "second"), "second: the last log, .*; delete the file instead")


def test_a_log_is_forgotten_in_another_file(result, run):  # noqa: F811
    before = (result / "knowledge.json").read_bytes()
    outcome = run("knowledge", "forget", result, "second", "-o", "left.json", "--json")
    assert outcome.json()["logs"] == ["first"]
    assert [log.name for log in Knowledge.load("left.json").logs] == ["first"]
    assert (result / "knowledge.json").read_bytes() == before
    refused(run("knowledge", "forget", result, "second", "-o", "left.json"), "left.json: exists; .*--force")
    assert run("knowledge", "forget", result, "second", "-o", "left.json", "--force").code == 0


def test_what_is_refused(result, run):  # noqa: F811
    refused(run("knowledge", "forget", result, "firts"), "firts: no such log; did you mean 'first'")
    refused(run("knowledge", "show", "absent"), "absent: cannot be read")
    (result / "knowledge.json").unlink()
    refused(
        run("knowledge", "show", result), ".*knowledge.json: the result in this folder has no knowledge, .*identify"
    )
    (result / "knowledge.json").write_text("{}")
    refused(run("knowledge", "forget", result, "first"), ".*knowledge.json: ")


def test_a_changed_file_is_not_replaced(result, run):  # noqa: F811
    knowledge = Knowledge.load(result)
    Knowledge(logs=knowledge.logs[::-1]).save(result / "knowledge.json")
    refused(run("knowledge", "forget", result, "first"), ".*changed since fifthwheel identify wrote it, .*--out")


def test_merged_knowledge_begins_an_identification(result, run, folder, tmp_path):  # noqa: F811
    assert run("knowledge", "forget", result, "first", "-o", "one.json").code == 0
    assert run("knowledge", "forget", result, "second", "-o", "other").code == 0
    merged = run("knowledge", "merge", "one.json", "other", result, "-o", "merged.json", "--json").json()
    assert merged["logs"] == ["second", "first"]
    refused(run("knowledge", "merge", "one.json", "-o", "merged.json"), "merged.json: exists")
    begun = run(
        *(
            "identify",
            folder / "flat.csv",
            "-v",
            TRUCK,
            "--knowledge",
            "merged.json",
            "-o",
            "next",
            "--json",
            "--tyres",
            "linear",
        ),
    ).json()
    assert any("Begins with the information of earlier logs (2," in note for note in begun["notes"])
    assert [log.name for log in Knowledge.load("next").logs] == ["second", "first", "flat"]
    begin = ("identify", folder / "flat.csv", "--knowledge", "merged.json")
    refused(
        run(*begin, "-v", TRUCK, "--set", "semitrailer.mass=40t"),
        "semitrailer.mass: 40000 kg, but 33450 kg with the same load in first: another load",
    )
    refused(run("identify", folder / "flat.csv", "-v", "other"), "other: a folder without .*--knowledge other")
    lorry = Path("lorry.toml")
    lorry.write_text(run("vehicle", TRUCK).out.replace('"tractor"', '"lorry"'), encoding="utf-8")
    refused(
        run(*begin, "-v", lorry),
        "lorry: the knowledge is of a truck whose first unit is tractor",
    )
