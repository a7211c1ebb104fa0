"""fifthwheel mass: a vehicle file with a wrong payload, and a drive of the true truck."""

import json

import pytest
from typer.testing import CliRunner

import fifthwheel as fw
from fifthwheel import cli
from fifthwheel.plant.driving import DrivenTruck, drive
from fifthwheel.workflow import mass_difference

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


def test_a_contradiction_with_the_file_is_a_warning(folder):
    record = fw.read_log(folder / "drive.parquet")
    light, right = (fw.Vehicle.load(folder / name) for name in ("light.toml", "truck.toml"))
    assert "stiffnesses scale with it; `fifthwheel mass`" in mass_difference(light, [record])
    assert mass_difference(right, [record]) == ""
    assert mass_difference(light, [fw.simulate(TRUCK, count=1)]) == ""


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
