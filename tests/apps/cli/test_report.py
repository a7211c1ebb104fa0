"""What the commands hand to the report: the conclusion as JSON, the way to run it again, figures as files."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

import fifthwheel as fw
from fifthwheel.apps import cli
from fifthwheel.data.logs import write_record
from tests.results.report.conftest import Page


@pytest.fixture(scope="module")
def log(result, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("commands") / "first.csv"
    write_record(result.records[0], path)
    return path


def ran(*arguments) -> dict:
    outcome = CliRunner().invoke(cli.app, [str(a) for a in arguments], catch_exceptions=False)
    assert outcome.exit_code == 0, outcome.stderr
    return json.loads(outcome.stdout)


def test_identify_concludes_and_says_how_to_run_it_again(log, tmp_path):
    note = "40 t, dry"
    told = ran(
        *("identify", log, "-v", "cheng_cebon_2011", "-o", tmp_path, "--json", "--tyres", "linear"),
        *("--note", note, "--author", "J. Smith"),
    )
    conclusion = told["conclusion"]
    assert conclusion.keys() >= {"good", "headline", "results", "not_identified", "cautions", "next_steps", "notes"}
    assert conclusion["next_steps"] == [step["message"] for step in conclusion["steps"]]
    assert conclusion["headline"].startswith("All 5 parameters are identified")
    assert json.loads((tmp_path / "identification.json").read_text())["conclusion"] == conclusion
    assert json.loads((tmp_path / "identification.json").read_text())["note"]["text"] == note
    assert fw.Identification.load(tmp_path).method == "one-stage"
    assert "figures" not in told["files"]
    page = Page((tmp_path / "report.html").read_text(encoding="utf-8"))
    assert conclusion["headline"] in page.text
    assert "Reproduce this result" in page.text
    assert "cheng_cebon_2011 (catalogue)" in page.text
    assert "information" in page.ids
    assert page.text.index(f"{note} (J. Smith, ") < page.text.index(conclusion["headline"])


def test_states_concludes_and_draws(log, tmp_path):
    told = ran("states", log, "-v", "cheng_cebon_2011", "-o", tmp_path, "--json", "--figures", "svg")
    assert (
        told["conclusion"]["headline"]
        == "The states are reliable in all samples of 1 log in which the filter has settled."
    )
    assert told["files"]["figures"] == str(tmp_path / "figures")
    assert (tmp_path / "figures" / "first" / "states" / "sideslip.semitrailer.svg").is_file()
    text = Page((tmp_path / "report.html").read_text(encoding="utf-8")).text
    assert "The band does not include the uncertainty of the parameters and sensor errors." in text


def test_another_kind_of_figure_is_refused(log, tmp_path):
    outcome = CliRunner().invoke(cli.app, ["states", str(log), "-v", "cheng_cebon_2011", "--figures", "gif"])
    assert outcome.exit_code == 2
