"""`fifthwheel signals`, `weigh` and `mass`: output, files and exit codes."""

import json
import re
from pathlib import Path

import numpy as np
import pandas
import pytest
from typer.testing import CliRunner

import fifthwheel as fw
from fifthwheel.apps import cli
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.data.logs import SignalMap, read_log, write_record
from fifthwheel.model.plant.powered import DrivenTruck, drive
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle, get
from tests.apps.cli.conftest import TRUCK, refused

DEGREE = np.pi / 180
COLUMNS = {
    "Geschwindigkeit [km/h]": ("speed", 3.6),
    "Lenkradwinkel [°]": ("steer.tractor.front", -20 / DEGREE),
    "Gierrate Zugm. [°/s]": ("yaw_rate.tractor", 1 / DEGREE),
    "Gierrate Auflieger [°/s]": ("yaw_rate.semitrailer", 1 / DEGREE),
    "Wankrate Auflieger [°/s]": ("roll_rate.semitrailer", 1 / DEGREE),
}


@pytest.fixture(scope="module")
def german_log(tmp_path_factory):
    """A run in the format of a German logger."""
    record = simulate(get(TRUCK), count=2, seed=1)
    path = tmp_path_factory.mktemp("german") / "fahrt.csv"
    rows = np.column_stack([record.time, *(factor * record.signals[name] for name, factor in COLUMNS.values())])
    lines = ["Messung 7", "", ";".join(["Zeit", *COLUMNS])]
    lines += [";".join(f"{x:.7g}".replace(".", ",") for x in row) for row in rows]
    path.write_text("\n".join(lines) + "\n", encoding="cp1252")
    return path


@pytest.mark.slow
def test_the_proposed_map_of_a_log_gives_the_original_record(german_log, run, tmp_path):
    outcome = run("signals", german_log, "-v", TRUCK, "-o", "signals.toml")
    assert (outcome.code, outcome.err) == (0, "")
    for column, (signal, _) in COLUMNS.items():
        name = column.partition(" [")[0]
        line = next(line for line in outcome.out.splitlines() if line.startswith(name))
        assert signal in line
        assert " 100 " in line
    assert SignalMap.load("signals.toml").signals["steer.tractor.front"].sign == -1

    outcome = run("signals", german_log, "-v", TRUCK, "-s", "signals.toml", "--save", "fahrt.parquet")
    assert (outcome.code, outcome.err) == (0, "")
    assert "Beware" not in outcome.out
    record, truth = read_log("fahrt.parquet"), simulate(get(TRUCK), count=2, seed=1)
    for name in ("speed", "yaw_rate.tractor", "yaw_rate.semitrailer", "roll_rate.semitrailer"):
        assert record.signals[name] == pytest.approx(truth.signals[name], rel=1e-5, abs=1e-6)


def test_without_out_the_map_is_printed(german_log, run, tmp_path):
    outcome = run("signals", german_log)
    assert outcome.code == 0
    assert '[signals."yaw_rate.semitrailer"]' in outcome.out
    printed = json.loads(run("signals", german_log, "--json").out)
    assert [column["unit"] for column in printed["columns"]][1:] == ["km/h", "°", "°/s", "°/s", "°/s"]
    assert SignalMap.parse(printed["signals_toml"]).signals
    (tmp_path / "m.toml").write_text("[signals]\nspeed = 'Geschwindigkeit'\n")
    refused(run("signals", german_log, "--save", "x.csv"), "--save: needs --signals")
    refused(run("signals", "none.csv"), "none.csv: cannot be read")
    refused(run("signals", german_log, "-s", "m.toml", "--save", "x.xls"), "x.xls: no format")


def test_weighing_corrects_the_masses(run, tmp_path):
    truck = get(TRUCK)
    heavier = truck.replace({"semitrailer.mass": 30000.0, "semitrailer.payload.mass": 16672.0})
    truck.save(tmp_path / "truck.toml")
    loads = heavier.axle_loads()
    random = np.random.default_rng(0)
    rows = [",".join(["t", *(f"axle_load.{path} [kN]" for path in loads)])]
    rows += [
        ",".join([f"{k}", *(f"{(v + random.normal(0, 200)) / 1e3:.3f}" for v in loads.values())]) for k in range(100)
    ]
    (tmp_path / "parked.csv").write_text("\n".join(rows) + "\n")
    outcome = run("weigh", tmp_path / "parked.csv", "-v", tmp_path / "truck.toml", "-o", "weighed.toml")
    assert (outcome.code, outcome.err) == (0, "")
    assert Vehicle.load("weighed.toml").parameters()["semitrailer.mass"] == pytest.approx(30000, rel=2e-3)
    assert Vehicle.load("weighed.toml").source.endswith("; weighed by parked")
    printed = json.loads(run("weigh", tmp_path / "parked.csv", "-v", TRUCK, "-o", "other.toml", "--json").out)
    assert printed["units"]["semitrailer"]["mass"] == pytest.approx(30000, rel=2e-3)
    (tmp_path / "odd.csv").write_text("t,axle_load.dolly\n" + "".join(f"{k},1\n" for k in range(9)))
    refused(run("weigh", tmp_path / "odd.csv", "-v", TRUCK, "-o", "odd.toml"), "axle_load.dolly: ")
    run("weigh", tmp_path / "parked.csv", "-v", TRUCK, "-o", "commented.toml")
    text = Path("commented.toml").read_text()
    assert "# published, (11)" in text
    assert '# was "33.45 t": ' in text


def test_weighing_by_a_slip(run):
    loads = {path: f"{load / STANDARD_GRAVITY:.0f} kg" for path, load in get(TRUCK).axle_loads().items()}
    lines = [f'{path} = "{load}"' for path, load in loads.items()]
    Path("slip.toml").write_text("\n".join(['accuracy = "0.5 %"', "[laden]", *lines]))
    outcome = run("weigh", "--slip", "slip.toml", "-v", TRUCK)
    assert (outcome.code, outcome.err) == (0, "")
    weighed = Vehicle.load("weighed.toml")
    assert weighed.unit("semitrailer").mass == pytest.approx(33450, rel=1e-3)
    assert weighed.stated["semitrailer.mass"] > 100
    assert "# published, (11)" in Path("weighed.toml").read_text()
    refused(run("weigh", "-v", TRUCK), "--slip: expected either a log or a slip, got none; give one")
    refused(run("weigh", "log.csv", "--slip", "slip.toml", "-v", TRUCK), "--slip: expected either .*, got both")


@pytest.mark.slow
def test_axle_loads_that_contradict_the_vehicle_file_are_reported(run):
    record = simulate(get(TRUCK), count=1, seed=1)
    loads = {f"axle_load.{path}": np.full(len(record), load) for path, load in get(TRUCK).axle_loads().items()}
    loads["axle_load.semitrailer"] *= 0.87
    write_record(record.with_signals({**loads, "wheel_speed.tractor.front": record.signals["speed"]}), "laden.csv")
    outcome = run("check", "laden.csv", "-v", TRUCK)
    assert outcome.code == 0
    assert outcome.err.startswith("laden: axle_load.semitrailer is 195.8 kN, the vehicle file gives 225.1 kN; ")
    assert len(outcome.err.splitlines()) == 1


def test_a_database_outside_of_the_folder_of_the_map_must_be_allowed(run, tmp_path):
    (tmp_path / "truck.dbc").write_text("not read")
    (tmp_path / "map").mkdir()
    (tmp_path / "map" / "signals.toml").write_text('databases = ["../truck.dbc"]')
    write_record(simulate(get(TRUCK), count=1, seed=1), tmp_path / "run.csv")
    refused(run("signals", "run.csv", "-s", "map/signals.toml"), ".*outside of the folder.*--allow-outside")
    assert run("signals", "run.csv", "-s", "map/signals.toml", "--allow-outside").code == 0


ARTICLE = fw.vehicle("cheng_cebon_2011")
GROSS = sum(unit.mass for unit in ARTICLE.units)


def invoke(*arguments):
    return CliRunner().invoke(cli.app, [str(argument) for argument in arguments])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("mass")
    record = drive(DrivenTruck(mass=GROSS), duration=300.0, seed=5, rate=20.0)
    fw.write_record(record, path / "drive.parquet")
    ARTICLE.save(path / "truck.toml")
    fw.with_payload(ARTICLE, 8e3).save(path / "light.toml")
    return path


def test_no_payload_remains_for_a_light_vehicle(folder):
    record = drive(DrivenTruck(mass=12e3), duration=200.0, seed=5, rate=20.0)
    fw.write_record(record, folder / "empty.parquet")
    done = invoke("mass", folder / "empty.parquet", "-v", folder / "truck.toml", "-o", folder / "empty.toml")
    assert done.exit_code != 0
    assert "without payload in the vehicle file; correct its unladen masses" in str(done.exception)
    assert not (folder / "empty.toml").exists()


def test_the_payload_of_the_file_follows_from_the_drive(folder):
    """The conclusion comes first, and the numbers of the new file are short."""
    command = ("mass", folder / "drive.parquet", "-v", folder / "light.toml", "-o", folder / "new.toml")
    done = invoke(*command)
    assert done.exit_code == 0, done.output
    assert re.match(r"The vehicle file is \d+\.\d t too light: the gross mass is \d+\.\d \S+ \d+\.\d t,", done.stdout)
    result = json.loads(invoke(*command, "--force", "--json").stdout)
    estimate = result["gross_mass"]
    assert abs(estimate["mass"] - GROSS) < 2.5 * estimate["sigma"]
    assert result["vehicle_file"]["deviation"] > 3
    new, light = fw.Vehicle.load(folder / "new.toml"), fw.Vehicle.load(folder / "light.toml")
    assert sum(unit.mass for unit in new.units) == pytest.approx(estimate["mass"])
    assert new.units[0].mass == light.units[0].mass
    assert new.units[1].sprung.mass == light.units[1].sprung.mass
    assert new.stated["semitrailer.mass"] >= estimate["sigma"]
    stated = [float(x.split("+-")[1].split()[0]) for x in (folder / "new.toml").read_text().splitlines() if "+-" in x]
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
    done = invoke("mass", folder / "bus.csv", "-v", folder / "truck.toml", "-s", folder / "bus.toml")
    assert str(done.exception) == (
        "engine_torque: column Trq of bus.csv: expected N m or a unit that converts to it, got '%'; in percent of a"
        ' reference: set unit = "N m" and gain = reference in N m / 100 in signals.toml'
    )
