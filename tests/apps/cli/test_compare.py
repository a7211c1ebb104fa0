"""`fifthwheel compare`: table, files, and what it refuses."""

import csv

import pytest

from tests.apps.cli.test_cli import refused, run  # noqa: F401 - a fixture
from tests.results.report.conftest import NASTY, Page


@pytest.fixture
def runs(result, tmp_path):
    for name in ("monday", NASTY.replace("/", "")):
        result.identification.save(tmp_path / name)
    return tmp_path / "monday", tmp_path / NASTY.replace("/", "")


def test_table_and_files(runs, run, tmp_path):  # noqa: F811
    page, table = tmp_path / "c.html", tmp_path / "c.csv"
    outcome = run("compare", *runs, "--csv", table, "--html", page)
    assert (outcome.code, outcome.err) == (0, "")
    assert outcome.out.startswith("No difference beyond chance. Largest: ")
    assert "Front tyres, cornering stiffness" in outcome.out
    assert "share lane changes" in " ".join(outcome.out.split())
    with table.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 16
    assert {row["difference_in_sigmas"] for row in rows} == {"", "0.0"}
    text = Page(page.read_text()).text
    assert runs[1].name in text
    assert "Rollover threshold" in text
    assert "No difference beyond chance." in text
    assert 'title="tractor.front.cornering_stiffness">Front tyres, cornering stiffness' in page.read_text()


def test_json(runs, run):  # noqa: F811
    contents = run("compare", *runs, "--json").json()
    assert contents["runs"][0] == "monday"
    assert contents["parameters"][0]["differences"][1]["at_least"] is True


def test_the_folder_of_a_command(identified, run, tmp_path):  # noqa: F811
    out, _ = identified
    outcome = run("compare", out, out / "identification.json", "--json")
    assert outcome.code == 0
    assert outcome.json()["runs"] == [str(out), str(out / "identification.json")]


def test_refusals(runs, run, tmp_path):  # noqa: F811
    refused(run("compare", runs[0]), "runs: expected at least two")
    refused(run("compare", runs[0], tmp_path / "absent"), ".*absent")
    (tmp_path / "c.csv").touch()
    refused(run("compare", *runs, "--csv", tmp_path / "c.csv"), ".*c.csv: exists")
