"""`fifthwheel states`: smoothed, on a bank, and with the identification's uncertainty."""

import json
from pathlib import Path

import numpy as np
import pytest
from pyarrow import parquet
from typer.testing import CliRunner

from fifthwheel import truck as vehicle
from fifthwheel.apps import cli
from fifthwheel.data.logs import write_record
from fifthwheel.estimate.identify import Identification, LogSummary, OneStage
from fifthwheel.estimate.observe import Observer, ObserverSettings, Uncertainty
from fifthwheel.model.simulate import simulate
from tests.estimate.observe.conftest import STEER

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
    log = LogSummary(name="run", span=(0, 1), samples=2, used=1, speed=(20, 20), rejected={}, noise={}, notes=())
    truck = vehicle.get(NAME)
    empty = Identification(
        method="one-stage",
        vehicle=truck,
        initial_vehicle=truck,
        signals=(),
        parameters=(),
        derived=(),
        sensors=(),
        histories={},
        logs=(log,),
        fits=(),
        settings=OneStage(),
        rounds=1,
        notes=(),
        version="",
    )
    Path("identification.json").write_text(json.dumps(empty.as_dict() | more))
    return "identification.json"


def same(columns: dict[str, np.ndarray], expected) -> None:
    for name, values in expected.values.items():
        np.testing.assert_allclose(columns[name], values, rtol=1e-9, atol=1e-15)
        np.testing.assert_allclose(columns[f"{name}.sigma"], expected.sigma[name], rtol=1e-9)


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


def test_on_a_bank(record, truck):
    printed, columns = states("--bank")
    assert printed["logs"][0]["states"][-1] == "bank.road"
    same(columns, Observer(truck, record.signals, ObserverSettings(estimate_bank=True)).batch(record))
    page = Path("fifthwheel-states/report.html").read_text(encoding="utf-8")
    assert "Road, bank" in page


def test_an_uncertainty_that_is_not_a_covariance(record, monkeypatch, capsys):
    path = identification(uncertainty={"names": [OFFSET], "covariance": [[-1]]})
    monkeypatch.setattr("sys.argv", ["fifthwheel", "states", "run.csv", "-v", NAME, "-i", path])
    with pytest.raises(SystemExit) as stop:
        cli.main()
    assert stop.value.code == 2
    assert capsys.readouterr().err.startswith(f"error: {path}: uncertainty: not a covariance")


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


def test_a_folder_without_a_result_is_refused_with_the_cure(record, monkeypatch, capsys):
    Path("empty").mkdir()
    monkeypatch.setattr("sys.argv", ["fifthwheel", "states", "run.csv", "-v", "empty"])
    with pytest.raises(SystemExit) as stop:
        cli.main()
    assert stop.value.code == 2
    assert "empty: a folder without vehicle.toml; give a vehicle file, or the result folder" in capsys.readouterr().err
