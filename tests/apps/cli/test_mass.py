"""fifthwheel mass: a vehicle file with a wrong payload, and a drive of the true truck."""

import json
import re

import numpy as np
import pandas
import pytest
from typer.testing import CliRunner

import fifthwheel as fw
from fifthwheel.apps import cli
from fifthwheel.estimate.identify.dataset import prepare_dataset
from fifthwheel.estimate.identify.mass import mass_findings
from fifthwheel.model.plant.powered import DrivenTruck, drive
from fifthwheel.results.diagnose.caution import CautionKind
from fifthwheel.results.diagnose.cautions import signal_cautions

TRUCK = fw.vehicle("cheng_cebon_2011")
GROSS = sum(unit.mass for unit in TRUCK.units)


def run(*arguments):
    return CliRunner().invoke(cli.app, [str(argument) for argument in arguments])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("mass")
    record = drive(DrivenTruck(mass=GROSS), duration=300.0, seed=5, rate=20.0)
    fw.write_record(record, path / "drive.parquet")
    TRUCK.save(path / "truck.toml")
    fw.with_payload(TRUCK, 8e3).save(path / "light.toml")
    return path


def test_the_payload_of_the_file_follows_from_the_drive(folder):
    done = run("mass", folder / "drive.parquet", "-v", folder / "light.toml", "-o", folder / "new.toml", "--json")
    assert done.exit_code == 0, done.output
    result = json.loads(done.stdout)
    estimate = result["gross_mass"]
    assert abs(estimate["mass"] - GROSS) < 2.5 * estimate["sigma"]
    assert result["vehicle_file"]["deviation"] > 3
    new, light = fw.Vehicle.load(folder / "new.toml"), fw.Vehicle.load(folder / "light.toml")
    assert sum(unit.mass for unit in new.units) == pytest.approx(estimate["mass"])
    assert new.units[0].mass == light.units[0].mass
    assert new.units[1].sprung.mass == light.units[1].sprung.mass
    assert new.stated["semitrailer.mass"] >= estimate["sigma"]


def with_turns(record):
    """The drive with the steer angle and yaw rate of slow turns, without tyre slip."""
    steer = 0.01 * np.sin(0.6 * record.time)
    yaw_rate = record.signals["speed"] * steer / TRUCK.wheelbase
    rng = np.random.default_rng(1)
    rates = {f"yaw_rate.{unit.name}": yaw_rate + 1e-3 * rng.standard_normal(len(record)) for unit in TRUCK.units[:1]}
    return record.with_signals({"steer.tractor.front": steer, **rates})


def test_a_contradiction_with_the_file_is_a_finding(folder):
    record = fw.read_log(folder / "drive.parquet")
    light, right = (fw.Vehicle.load(folder / name) for name in ("light.toml", "truck.toml"))
    (finding,) = mass_findings([record], light)
    assert (finding.signal, finding.fault, finding.severity, finding.log) == (
        "engine_torque",
        "mass",
        "warning",
        "drive",
    )
    assert "correct the payload with fifthwheel mass" in finding.message
    assert not [*mass_findings([record], right)]
    assert not [*mass_findings([fw.simulate(TRUCK, count=1)], light)]


def test_check_and_identify_report_the_contradiction(folder):
    """As a caution of the page and in the JSON, and not as a fault of a signal that explains others."""
    record = with_turns(fw.read_log(folder / "drive.parquet"))
    fw.write_record(record, folder / "turns.parquet")
    light = fw.Vehicle.load(folder / "light.toml")
    done = run("check", folder / "turns.parquet", "-v", folder / "light.toml", "--json")
    assert done.exit_code == 0, done.exception
    found = [finding for finding in json.loads(done.stdout)["findings"] if finding["fault"] == "mass"]
    assert [finding["log"] for finding in found] == ["turns"]
    dataset = prepare_dataset([fw.read_log(folder / "turns.parquet")], light, fw.OneStage())
    (caution,) = [c for c in signal_cautions(dataset.findings) if c.kind is CautionKind.MASS]
    assert caution.message.startswith("turns: engine_torque: with it the gross mass is ")


def test_no_payload_remains_for_a_light_vehicle(folder):
    record = drive(DrivenTruck(mass=12e3), duration=200.0, seed=5, rate=20.0)
    fw.write_record(record, folder / "empty.parquet")
    done = run("mass", folder / "empty.parquet", "-v", folder / "truck.toml", "-o", folder / "empty.toml")
    assert done.exit_code != 0
    assert "without payload in the vehicle file; correct its unladen masses" in str(done.exception)
    assert not (folder / "empty.toml").exists()


def test_options_of_other_models_are_refused(folder):
    done = run("simulate", folder / "a.csv", "--model", "longitudinal", "--speed", "80")
    assert done.exit_code != 0
    assert "--speed: not available in the longitudinal model" in str(done.exception)


def test_the_conclusion_comes_first_and_numbers_are_short(folder):
    done = run("mass", folder / "drive.parquet", "-v", folder / "light.toml", "-o", folder / "short.toml")
    assert done.exit_code == 0, done.output
    assert re.match(r"The vehicle file is \d+\.\d t too light: the gross mass is \d+\.\d \S+ \d+\.\d t,", done.stdout)
    lines = (folder / "short.toml").read_text().splitlines()
    (payload,) = [line for line in lines[[*lines].index("[unit.payload]") :] if line.startswith("mass = ")]
    assert len(payload.split('"')[1].split()[0]) <= 8
    stated = [float(line.split("+-")[1].split()[0]) for line in lines if "+-" in line]
    assert stated
    assert stated == [float(f"{sigma:.3g}") for sigma in stated]


def test_a_column_in_percent_names_log_and_column(folder):
    record = fw.read_log(folder / "drive.parquet")
    table = {
        "time": record.time,
        **{name: record.signals[name] for name in ("speed", "engine_speed", "braking.tractor")},
    }
    pandas.DataFrame(table | {"Trq [%]": record.signals["engine_torque"] / 25}).to_csv(folder / "bus.csv", index=False)
    (folder / "bus.toml").write_text('[signals]\nengine_torque = "Trq"\n')
    done = run("mass", folder / "bus.csv", "-v", folder / "truck.toml", "-s", folder / "bus.toml")
    assert str(done.exception) == (
        "engine_torque: column Trq of bus.csv: expected N m or a unit that converts to it, got '%'; in percent of a"
        ' reference: set unit = "N m" and gain = reference in N m / 100 in signals.toml'
    )


def test_a_number_without_unit_is_refused_without_unit(folder):
    text = (folder / "truck.toml").read_text() + "\n[driveline]\nefficiency = 94.5\n"
    with pytest.raises(fw.VehicleError, match=r"driveline\.efficiency: expected 0\.7 to 1, the range"):
        fw.Vehicle.loads(text)
