"""`fifthwheel states`: smoothed, on a bank, and with the identification's uncertainty."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from pyarrow import parquet
from typer.testing import CliRunner

from fifthwheel import cli
from fifthwheel.logs import write
from fifthwheel.observe import Observer, ObserverSettings, Uncertainty
from fifthwheel.simulate import simulate

from .conftest import STEER

NAME = "cheng_cebon_2011"
ZERO = f"{STEER}.offset"
UNSURE = Uncertainty(names=(ZERO, "semitrailer.cornering_stiffness"), covariance=np.diag([0.001**2, 3e4**2]))


@pytest.fixture
def record(truck, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    record = simulate(truck, count=1, name="drive")
    write(record, Path("drive.csv"))
    return record


def states(*arguments: str) -> tuple[dict, dict[str, np.ndarray]]:
    """What --json printed, and the columns of states.parquet."""
    run = CliRunner().invoke(cli.app, ["states", "drive.csv", "-v", NAME, "--json", *arguments], catch_exceptions=False)
    assert run.exit_code == 0, run.output
    table = parquet.read_table("fifthwheel-states/states.parquet")
    return json.loads(run.stdout), {name: table[name].to_numpy() for name in table.column_names if name != "log"}


def identification(**more) -> str:
    told = {"sensors": [], "logs": [{"name": "drive", "noise": {}}], **more}
    Path("identification.json").write_text(json.dumps(told))
    return "identification.json"


def same(columns: dict[str, np.ndarray], found) -> None:
    for name, values in found.values.items():
        np.testing.assert_allclose(columns[name], values, rtol=1e-9, atol=1e-15)
        np.testing.assert_allclose(columns[f"{name}.sigma"], found.sigma[name], rtol=1e-9)


def test_as_the_observer_says(record, truck):
    o = Observer(truck, record.signals)
    for told in ({}, {"uncertainty": None}):
        printed, columns = states("-i", identification(**told))
        assert (printed["smoothed"], printed["uncertain"]) == (False, [])
        same(columns, o.batch(record))
    printed, columns = states("--smooth", "-i", identification(uncertainty=UNSURE.as_dict()))
    assert (printed["smoothed"], printed["uncertain"]) == (True, list(UNSURE.names))
    same(columns, o.smooth(record, UNSURE))
    _, columns = states("-i", "identification.json")
    same(columns, o.batch(record, UNSURE))


def test_on_a_bank(record, truck):
    printed, columns = states("--bank")
    assert printed["logs"][0]["states"][-1] == "bank.road"
    same(columns, Observer(truck, record.signals, ObserverSettings(bank=0.03)).batch(record))
    page = Path("fifthwheel-states/report.html").read_text(encoding="utf-8")
    assert re.search(r"bank\.(<wbr>)?road", page)


def test_an_uncertainty_that_is_none(record, monkeypatch, capsys):
    path = identification(uncertainty={"names": [ZERO], "covariance": [[-1]]})
    monkeypatch.setattr("sys.argv", ["fifthwheel", "states", "drive.csv", "-v", NAME, "-i", path])
    with pytest.raises(SystemExit) as stop:
        cli.main()
    assert stop.value.code == 2
    assert capsys.readouterr().err.startswith(f"error: {path}: uncertainty: not a covariance")
