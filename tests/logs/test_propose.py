"""A map proposed for a log whose columns are called and counted in other ways."""

import numpy as np
import pytest

from fifthwheel.logs import SignalMap, read
from fifthwheel.logs.draft import as_toml
from fifthwheel.logs.propose import propose
from fifthwheel.logs.readers import open_log
from fifthwheel.logs.survey import survey

DEGREE = np.pi / 180
COLUMNS = {
    "Geschwindigkeit [km/h]": ("speed", 3.6),
    "Lenkradwinkel [°]": ("steer.tractor.front", -20 / DEGREE),
    "Gierrate Zugm. [°/s]": ("yaw_rate.tractor", 1 / DEGREE),
    "Gierrate Auflieger": ("yaw_rate.semitrailer", 1 / DEGREE),
    "Knickwinkel": ("articulation.semitrailer", -1),
    "ay": ("lateral_acceleration.tractor", 1 / 9.80665),
}


def written(tmp_path, record, columns):
    rows = np.column_stack([record.time, *(factor * record.signals[name] for name, factor in columns.values())])
    lines = [";".join(["Zeit", *columns]), *(";".join(f"{x:.7g}" for x in row) for row in rows)]
    path = tmp_path / "drive.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def proposed(path, **options):
    with open_log(path) as log:
        found = survey(log)
        return found, propose(log, found, **options)


def test_names_units_and_signs_are_found_and_the_record_is_the_drive(tmp_path, a_drive):
    path = written(tmp_path, a_drive, COLUMNS)
    found, proposal = proposed(path, wheelbase=4.0)
    toml = as_toml(proposal, found)
    record = read(path, SignalMap.parse(toml))
    assert record.time == pytest.approx(a_drive.time, abs=1e-5)
    for name, values in a_drive.signals.items():
        if name != "steer.tractor.front":
            assert record.signals[name] == pytest.approx(values, rel=1e-5, abs=1e-5), name
    ratio = record.signals["steer.tractor.front"] / a_drive.signals["steer.tractor.front"]
    assert 0.7 < np.median(ratio) < 1.5  # how much the truck understeers is not known
    assert "turned round" in proposal.reasons["articulation.semitrailer"]
    assert "taken for deg/s" in proposal.reasons["yaw_rate.semitrailer"]
    assert "steering wheel" in proposal.reasons["steer.tractor.front"]
    assert proposal.missing == (
        "roll_rate.semitrailer: found nowhere; without it the payload's height cannot be identified",
    )
    assert proposal.findings == ()


def test_the_second_of_two_gyros_without_a_name_is_the_trailers(tmp_path, a_drive):
    columns = {"vx": ("speed", 1), "steer": ("steer.tractor.front", 1)}
    columns |= {"gyro_z a": ("yaw_rate.semitrailer", 1), "gyro_z b": ("yaw_rate.tractor", 1)}
    _, proposal = proposed(written(tmp_path, a_drive, columns))
    assert proposal.signals.signals["yaw_rate.tractor"].column == "gyro_z b"
    assert proposal.signals.signals["yaw_rate.semitrailer"].column == "gyro_z a"
    assert "follows the other gyro" in proposal.reasons["yaw_rate.semitrailer"]


def test_two_gyros_of_the_same_unit_are_left_to_the_user(tmp_path, a_drive):
    columns = {"vx": ("speed", 1), "gyro_z": ("yaw_rate.tractor", 1), "yaw_rate": ("yaw_rate.tractor", 1.001)}
    found, proposal = proposed(written(tmp_path, a_drive, columns))
    assert len(proposal.others["yaw_rate.tractor"]) == 1
    assert '# or column = "' in as_toml(proposal, found)
    assert any(text.startswith("steer.tractor.front") for text in proposal.missing)


def test_units_and_columns_of_a_survey(tmp_path, a_drive):
    found, _ = proposed(written(tmp_path, a_drive, COLUMNS))
    speed = found.contents["Geschwindigkeit"]
    values = 3.6 * a_drive.signals["speed"]
    assert speed.column.unit == "km/h"
    assert (speed.samples, speed.missing) == (len(a_drive), 0)
    assert speed.rate == pytest.approx(50, rel=1e-3)
    assert (speed.low, speed.high) == pytest.approx((values.min(), values.max()), rel=1e-5)
    assert (speed.mean, speed.sigma) == pytest.approx((values.mean(), values.std()), rel=1e-4)
    assert (found.start, found.stop) == pytest.approx(a_drive.span)


def test_a_log_of_nothing_we_know(tmp_path):
    (tmp_path / "x.csv").write_text("t,coolant,state\n0,80,on\n1,81,on\n2,82,off\n")
    found, proposal = proposed(tmp_path / "x.csv")
    assert not proposal.signals.signals
    assert len(proposal.missing) == 5
    SignalMap.parse(as_toml(proposal, found))
    assert found.contents["state"].fault


@pytest.mark.parametrize("run", ["run01_s_bend", "run02_exit_ramp"])
def test_a_real_truck(data, run):
    _, proposal = proposed(data / "real_truck" / f"{run}.csv", wheelbase=6.0)
    columns = {signal: channel.column for signal, channel in proposal.signals.signals.items()}
    assert columns["speed"] == "vx"
    assert columns["steer.tractor.front"] == "steer_ang"
    assert columns["yaw_rate.tractor"] in ("yaw_rate", "imu_gyro_z")
    assert columns["articulation.semitrailer"] == "hitch"
    assert all(channel.sign == 1 and channel.gain == 1 for channel in proposal.signals.signals.values())
