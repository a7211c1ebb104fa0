"""`fifthwheel identify` and `states`: the report, figures, smoothing, a bank, uncertainty, late channels."""

import json
from pathlib import Path

import numpy as np
import pytest
from pyarrow import parquet
from typer.testing import CliRunner

import fifthwheel as fw
from fifthwheel.apps import cli
from fifthwheel.data.checks import Fault
from fifthwheel.data.logs import SignalMap, read_log, write_record
from fifthwheel.estimate.identify import Identification, LogSummary, OneStage
from fifthwheel.estimate.observe import Observer, ObserverSettings, Uncertainty
from fifthwheel.estimate.time_bases import check_signals
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import get
from tests.apps.cli.conftest import refused
from tests.estimate.observe.conftest import STEER
from tests.results.report.conftest import Page


def ran(*arguments) -> dict:
    outcome = CliRunner().invoke(cli.app, [str(a) for a in arguments], catch_exceptions=False)
    assert outcome.exit_code == 0, outcome.stderr
    return json.loads(outcome.stdout)


@pytest.mark.slow
def test_identify_concludes_and_says_how_to_run_it_again(identified):
    out, told = identified
    conclusion, note = told["conclusion"], "40 t, dry"
    assert conclusion.keys() >= {"good", "headline", "results", "not_identified", "cautions", "next_steps", "notes"}
    assert conclusion["next_steps"] == [step["message"] for step in conclusion["steps"]]
    assert conclusion["headline"].startswith("All 5 parameters are identified")
    stored = json.loads((out / "identification.json").read_text())
    assert (stored["conclusion"], stored["note"]["text"]) == (conclusion, note)
    assert fw.Identification.load(out).method == "one-stage"
    page = Page((out / "report.html").read_text(encoding="utf-8"))
    for text in (conclusion["headline"], "Reproduce this result", "cheng_cebon_2011 (catalogue)"):
        assert text in page.text
    assert "information" in page.ids
    assert page.text.index(f"{note} (J. Smith, ") < page.text.index(conclusion["headline"])


@pytest.mark.slow
def test_states_concludes_and_draws(folder, tmp_path):
    told = ran("states", folder / "flat.csv", "-v", NAME, "-o", tmp_path, "--json", "--figures", "svg")
    headline = "The states are reliable in all samples of 1 log in which the filter has settled."
    assert told["conclusion"]["headline"] == headline
    assert told["files"]["figures"] == str(tmp_path / "figures")
    assert (tmp_path / "figures" / "flat" / "states" / "sideslip.semitrailer.svg").is_file()
    text = Page((tmp_path / "report.html").read_text(encoding="utf-8")).text
    assert "The band does not include the uncertainty of the parameters and sensor errors." in text


NAME = "cheng_cebon_2011"
OFFSET = f"{STEER}.offset"
UNCERTAINTY = Uncertainty(names=(OFFSET, "semitrailer.cornering_stiffness"), covariance=np.diag([0.001**2, 3e4**2]))


@pytest.fixture
def record(truck, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    record = simulate(truck, count=1, name="run")
    write_record(record, Path("run.csv"))
    return record


def states(*arguments: str) -> tuple[dict, dict[str, np.ndarray]]:
    """The printed JSON, and the columns of states.parquet."""
    run = CliRunner().invoke(cli.app, ["states", "run.csv", "-v", NAME, "--json", *arguments], catch_exceptions=False)
    assert run.exit_code == 0, run.output
    table = parquet.read_table("fifthwheel-states/states.parquet")
    return json.loads(run.stdout), {name: table[name].to_numpy() for name in table.column_names if name != "log"}


def identification(**more) -> str:
    """An identification.json without sensor errors."""
    log = LogSummary(
        name="run", span=(0, 1), samples=2, averaged=1, used=1, speed=(20, 20), rejected={}, noise={}, notes=()
    )
    truck, nothing = get(NAME), ("signals", "parameters", "derived", "sensors", "fits", "notes")
    empty = Identification(
        method="one-stage", vehicle=truck, initial_vehicle=truck, histories={}, logs=(log,), settings=OneStage(),
        rounds=1, version="", **dict.fromkeys(nothing, ()),
    )  # fmt: skip
    Path("identification.json").write_text(json.dumps(empty.as_dict() | more))
    return "identification.json"


def same(columns: dict[str, np.ndarray], expected) -> None:
    for name, values in expected.values.items():
        np.testing.assert_allclose(columns[name], values, rtol=1e-9, atol=1e-15)
        np.testing.assert_allclose(columns[f"{name}.sigma"], expected.sigma[name], rtol=1e-9)


@pytest.mark.slow
def test_equal_to_the_observer(record, truck):
    o = Observer(truck, record.signals)
    printed, columns = states("-i", identification())
    assert (printed["smoothed"], printed["uncertain"]) == (False, [])
    same(columns, o.batch(record))
    printed, columns = states("--smooth", "-i", identification(uncertainty=UNCERTAINTY.as_dict()))
    assert (printed["smoothed"], printed["uncertain"]) == (True, list(UNCERTAINTY.names))
    same(columns, o.smooth(record, UNCERTAINTY))
    _, columns = states("-i", "identification.json")
    same(columns, o.batch(record, UNCERTAINTY))


@pytest.mark.slow
def test_on_a_bank(record, truck):
    printed, columns = states("--bank")
    assert printed["logs"][0]["states"][-1] == "bank.road"
    same(columns, Observer(truck, record.signals, ObserverSettings(estimate_bank=True)).batch(record))
    assert "Road, bank" in Path("fifthwheel-states/report.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_result_folder_is_its_vehicle_and_its_identification(record, truck):
    path = identification(uncertainty=UNCERTAINTY.as_dict())
    result = Path("result")
    result.mkdir()
    Path(path).rename(result / path)
    truck.save(result / "vehicle.toml")
    expected = Observer(truck, record.signals).smooth(record, UNCERTAINTY)
    for given in ("result", "result/identification.json"):
        printed, columns = states("-v", given, "--smooth")
        assert printed["uncertain"] == list(UNCERTAINTY.names)
        same(columns, expected)
    (result / path).unlink()
    printed, _ = states("-v", "result")
    assert printed["uncertain"] == []


def test_a_wrong_uncertainty_and_a_folder_without_a_result_are_refused(run, record):
    path = identification(uncertainty={"names": [OFFSET], "covariance": [[-1]]})
    Path("empty").mkdir()
    for arguments, message in (
        (("-v", NAME, "-i", path), f"{path}: uncertainty: not a covariance"),
        (("-v", "empty"), "empty: a folder without vehicle.toml; give a vehicle file, or the result folder"),
    ):
        refused(run("states", "run.csv", *arguments), message)


LATE = ("yaw_rate.semitrailer", "roll_rate.semitrailer")


@pytest.fixture
def late(tmp_path):
    record = simulate(get("cheng_cebon_2011"), count=4)
    shifted = {n: np.interp(record.time - 0.35, record.time, record.signals[n]) for n in LATE}
    write_record(record.with_signals(shifted), tmp_path / "late.csv")
    return tmp_path / "late.csv"


def test_signals_writes_the_delay_that_check_asks_for(late, run):
    outcome = run("signals", late, "-v", NAME, "-o", "signals.toml")
    assert (outcome.code, outcome.err) == (0, "")
    proposed = SignalMap.load("signals.toml")
    delays = {name: channel.delay for name, channel in proposed.signals.items() if channel.delay}
    assert delays == {name: pytest.approx(0.35, abs=0.02) for name in LATE}
    findings = check_signals(read_log(late, proposed), get(NAME))
    assert Fault.TIME_OFFSET not in [finding.fault for finding in findings]


def test_check_names_and_draws_the_late_channels(late, run):
    outcome = run("check", late, "-v", NAME, "--plot", "time.html")
    assert (outcome.code, outcome.err) == (0, "")
    words = " ".join(outcome.out.split())
    assert "0.35 s late" in words
    assert 'set delay = "0.35 s +- ' in words
    text = Path("time.html").read_text()
    assert all(name in text for name in LATE)
    assert "+0.35 ± 0.0" in text
