"""Proposed maps of logs with other names, units and signs."""

import numpy as np
import pandas as pd
import pytest

from fifthwheel.data.logs import SignalMap, read_log
from fifthwheel.data.logs.map_text import as_toml
from fifthwheel.data.logs.propose import propose_map
from fifthwheel.data.logs.readers import open_log
from fifthwheel.data.logs.survey import survey_log
from fifthwheel.model.plant.powered import DrivenTruck, drive
from fifthwheel.model.simulate import simulate
from fifthwheel.results.report.logs import record_document
from fifthwheel.truck import get

DEGREE = np.pi / 180
COLUMNS = {
    "Geschwindigkeit [km/h]": ("speed", 3.6),
    "Lenkradwinkel [°]": ("steer.tractor.front", -20 / DEGREE),
    "Gierrate Zugm. [°/s]": ("yaw_rate.tractor", 1 / DEGREE),
    "Gierrate Auflieger": ("yaw_rate.semitrailer", 1 / DEGREE),
    "Knickwinkel": ("articulation.semitrailer", -1),
    "ay": ("lateral_acceleration.tractor", 1 / 9.80665),
}


def write_log(tmp_path, record, columns):
    rows = np.column_stack([record.time, *(factor * record.signals[name] for name, factor in columns.values())])
    lines = [";".join(["Zeit", *columns]), *(";".join(f"{x:.7g}" for x in row) for row in rows)]
    path = tmp_path / "run.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def survey_and_proposal(path, **options):
    with open_log(path) as log:
        survey = survey_log(log)
        return survey, propose_map(log, survey, **options)


def test_the_proposed_map_gives_the_original_record(tmp_path, weaving):
    path = write_log(tmp_path, weaving, COLUMNS)
    survey, proposal = survey_and_proposal(path, wheelbase=4.0)
    speed, values = survey.contents["Geschwindigkeit"], 3.6 * weaving.signals["speed"]
    assert (speed.column.unit, speed.samples, speed.missing) == ("km/h", len(weaving), 0)
    assert speed.rate == pytest.approx(50, rel=1e-3)
    assert (speed.low, speed.high) == pytest.approx((values.min(), values.max()), rel=1e-5)
    assert (speed.mean, speed.sigma) == pytest.approx((values.mean(), values.std()), rel=1e-4)
    assert (survey.start, survey.stop) == pytest.approx(weaving.span)
    toml = as_toml(proposal, survey)
    record = read_log(path, SignalMap.parse(toml))
    assert record.time == pytest.approx(weaving.time, abs=1e-5)
    for name, values in weaving.signals.items():
        if name != "steer.tractor.front":
            assert record.signals[name] == pytest.approx(values, rel=1e-5, abs=1e-5), name
    ratio = record.signals["steer.tractor.front"] / weaving.signals["steer.tractor.front"]
    assert 0.7 < np.median(ratio) < 1.5  # the understeer gradient is unknown
    assert "sign inverted" in proposal.reasons["articulation.semitrailer"]
    assert "unit deg/s by its magnitude" in proposal.reasons["yaw_rate.semitrailer"]
    assert "steering-wheel angle" in proposal.reasons["steer.tractor.front"]
    assert proposal.missing == (
        "roll_rate.semitrailer: not in the map; without it the payload height cannot be identified",
    )
    (question,) = map(str, proposal.findings)  # gyros and accelerometer of a log without roll may be inverted instead
    assert "yaw_rate.tractor, yaw_rate.semitrailer and lateral_acceleration.tractor are inverted instead" in question


SPEED, STEER = "speed", "steer.tractor.front"
YAW, YAW2 = "yaw_rate.tractor", "yaw_rate.semitrailer"
CHOSEN = {
    "the gyro that lags is that of the trailer": (
        {"vx": (SPEED, 1), "steer": (STEER, 1), "gyro_z a": (YAW2, 1), "gyro_z b": (YAW, 1)},
        {YAW: "gyro_z b", YAW2: "gyro_z a"},
        {YAW2: "it lags the first gyro"},
    ),
    "all columns with the name of the gyro that lags": (
        {"vx": (SPEED, 1), "steer": (STEER, 1), "gyro_z a": (YAW2, 1), "gyro_z b": (YAW, 1), "gyro_x a": (YAW2, 1)},
        {YAW: "gyro_z b", YAW2: "gyro_z a", "roll_rate.semitrailer": "gyro_x a"},
        {},
    ),
    "a repeated name": (
        {"vx": (SPEED, 1), "Gyro_Z": (YAW2, 1), "Gyro_Z_1": (YAW, 1)},
        {YAW: "Gyro_Z_1", YAW2: "Gyro_Z"},
        {},
    ),
    "a repeated name of pandas": (
        {"vx": (SPEED, 1), "Gyro_Z": (YAW2, 1), "Gyro_Z.1": (YAW, 1)},
        {YAW: "Gyro_Z.1", YAW2: "Gyro_Z"},
        {},
    ),
    "the road wheel before the steering wheel": (
        {"vx": (SPEED, 1), "SteeringWheelAngle": (STEER, 20), "RoadWheelAngle": (STEER, 1)},
        {STEER: "RoadWheelAngle"},
        {},
    ),
    "a gyro that the logger has filtered lags, and is not that of the trailer": (
        {"vx": (SPEED, 1), "steer": (STEER, 1), "GyroZ": (YAW, 1), "GyroZ_LP1Hz": (YAW2, 1)},
        {YAW: "GyroZ", YAW2: None},
        {},
    ),
    "the measured column before one that is computed from it": (
        {"vx": (SPEED, 1), "YawRate_corr": (YAW, 1.02), "YawRate": (YAW, 1)},
        {YAW: "YawRate"},
        {},
    ),
    "units by unit and name": (
        {"Speed2D [m/s]": (SPEED, 1), "YAW [deg/s]": (YAW, 1 / DEGREE), "YAW_TRL [deg/s]": (YAW2, 1 / DEGREE)},
        {SPEED: "Speed2D", YAW: "YAW", YAW2: "YAW_TRL"},
        {},
    ),
    "a speed by its unit": (
        {"Kanal 3 [km/h]": (SPEED, 3.6), "Kanal 4 [km/h]": (SPEED, 36), "LRW": (STEER, 20)},
        {SPEED: "Kanal 3"},
        {SPEED: "by its unit, km/h, and its largest value, 69"},
    ),
    "the speed of a wheel is better than none": (
        {"VelRR_obd": (SPEED, 3.6), "LRW": (STEER, 20), "YawRate": (YAW, 1)},
        {SPEED: "VelRR_obd", "wheel_speed.tractor.rear.right": None},
        {},
    ),
    "a velocity on an axis of the earth is too large for a lateral velocity": (
        {"vx": (SPEED, 1), "Lateral_vel [m/s]": (SPEED, 0.9)},
        {"lateral_velocity.tractor": None},
        {},
    ),
}


@pytest.mark.parametrize("case", CHOSEN)
def test_the_column_of_a_signal(tmp_path, weaving, case):
    columns, chosen, reasons = CHOSEN[case]
    _, proposal = survey_and_proposal(write_log(tmp_path, weaving, columns))
    found = {name: source.column for name, source in {**proposal.signals.signals, **proposal.signals.reference}.items()}
    assert {signal: found.get(signal) for signal in chosen} == chosen
    assert all(text in proposal.reasons[signal] for signal, text in reasons.items())


def test_other_candidates_and_what_is_missing(tmp_path, weaving):
    columns = {"vx": (SPEED, 1), "gyro_z": (YAW, 1), "yaw_rate": (YAW, 1.001)}
    survey, proposal = survey_and_proposal(write_log(tmp_path, weaving, columns))
    assert len(proposal.others[YAW]) == 1
    assert '# or column = "' in as_toml(proposal, survey)
    assert any(text.startswith(STEER) for text in proposal.missing)
    columns = {"vx": (SPEED, 1), "Kanal 3 [°/s]": (YAW, 1 / DEGREE), "Kanal 4 [V]": (SPEED, 1)}
    _, proposal = survey_and_proposal(write_log(tmp_path, weaving, columns))
    assert "columns with the unit of a rate, of an unknown axis: Kanal 3" in proposal.missing


def test_sensor_classes_are_proposed(tmp_path, weaving):
    """By names, and by the magnitude of a steering-wheel angle; reference signals have none."""
    columns = {"vx": (SPEED, 1), "steer": (STEER, 20), "ay": ("lateral_acceleration.tractor", 1)}
    columns |= {"VDC2_YawRate": (YAW, 1), "ins_yaw_rate_trailer": (YAW2, 1), "ins_lateral_velocity": (SPEED, 0.01)}
    survey, proposal = survey_and_proposal(write_log(tmp_path, weaving, columns))
    signal_map = SignalMap.parse(as_toml(proposal, survey))
    classes = {name: sensor.sensor_class for name, sensor in signal_map.sensors.items()}
    assert classes == {STEER: "steering wheel", YAW: "vdc2", YAW2: "ins"}
    assert "lateral_velocity.tractor" in signal_map.reference


@pytest.mark.parametrize(("unit", "scale", "expected"), [("", 1, "deg"), (" [rad]", 1, "deg"), ("", DEGREE, None)])
def test_a_sideslip_angle_is_in_degrees_by_its_magnitude(tmp_path, weaving, unit, scale, expected):
    columns = {"vx": ("speed", 1), f"Correvit_beta{unit}": ("yaw_rate.tractor", 0.2 / DEGREE * scale)}
    survey, proposal = survey_and_proposal(write_log(tmp_path, weaving, columns))
    assert proposal.signals.reference["sideslip.tractor"].unit == expected
    assert ('unit = "deg"' in as_toml(proposal, survey)) == (expected == "deg")


def test_the_signals_of_a_mass_from_driving_are_proposed(tmp_path):
    """Engine speed in rpm without its unit, torque in percent of a reference, and no lateral signal."""
    record = drive(DrivenTruck(mass=30e3), duration=60.0, rate=10.0)
    signals = record.signals
    columns = {
        "time": record.time,
        "WheelBasedVehicleSpeed [m/s]": signals["speed"],
        "EngineSpeed": signals["engine_speed"] * 30 / np.pi,
        "ActualEnginePercentTorque [%]": signals["engine_torque"] / 25,
        "DrivelineEngaged": signals["driveline_engaged"],
        "BrakeSwitch": signals["braking.tractor"],
    }
    path = tmp_path / "drive.csv"
    pd.DataFrame(columns).to_csv(path, index=False)
    _, proposal = survey_and_proposal(path)
    assert set(proposal.signals.signals) == {"speed", "engine_speed", "driveline_engaged", "braking.tractor"}
    assert proposal.signals.signals["engine_speed"].unit == "rpm"
    only, relative = proposal.missing
    assert relative.startswith("engine_torque: ActualEnginePercentTorque is in percent of a reference that the log ")
    assert relative.endswith('map it with unit = "N m" and gain = reference in N m / 100')
    columns["EngineTorque [N m]"] = signals["engine_torque"]
    pd.DataFrame(columns).to_csv(path, index=False)
    _, proposal = survey_and_proposal(path)
    assert proposal.missing == (only,)
    assert only.startswith(
        "steer.tractor.front and yaw_rate.tractor: not in the map; this log gives the gross mass only"
    )
    assert [finding.fault for finding in proposal.findings] == ["zero speed"]


def test_a_held_column_has_the_rate_of_its_new_values(tmp_path, weaving):
    """12.5 Hz in a table of 50 Hz; one empty row at the start of a pause is one cell, and as long as the pause."""
    rate = weaving.signals["yaw_rate.tractor"]
    held = rate[np.arange(rate.size) // 4 * 4]
    frame = pd.DataFrame({"time": weaving.time, "yaw_rate.tractor": held, "roll_rate.tractor": rate})
    frame = pd.concat([frame.iloc[:500], pd.DataFrame({"time": [frame.time[499] + 0.1]}), frame.iloc[600:]])
    path = tmp_path / "held.csv"
    frame.to_csv(path, index=False)
    survey, _ = survey_and_proposal(path)
    rates = [survey.contents[name].rate for name in ("yaw_rate.tractor", "roll_rate.tractor")]
    assert rates == pytest.approx([12.5, 50.0], rel=0.02)
    record = read_log(path)
    missing = [
        row.split()[-2:] for row in str(record_document(record, ())).splitlines() if row.startswith(("yaw", "roll"))
    ]
    expected = 100 * 2.0 / (record.time[-1] - record.time[0])
    assert [unit for _, unit in missing] == ["%", "%"]
    assert [float(value) for value, _ in missing] == pytest.approx([expected, expected], rel=0.05)


def test_a_log_without_known_channels(tmp_path):
    (tmp_path / "x.csv").write_text("t,coolant,state\n0,80,on\n1,81,on\n2,82,off\n")
    survey, proposal = survey_and_proposal(tmp_path / "x.csv")
    assert not proposal.signals.signals
    assert len(proposal.missing) == 5
    SignalMap.parse(as_toml(proposal, survey))
    assert survey.contents["state"].fault


@pytest.mark.parametrize("run", ["run01_s_bend", "run02_exit_ramp"])
def test_a_real_truck(data, run):
    _, proposal = survey_and_proposal(data / "real_truck" / f"{run}.csv", wheelbase=6.0)
    columns = {signal: channel.column for signal, channel in proposal.signals.signals.items()}
    assert columns["speed"] == "vx"
    assert columns["steer.tractor.front"] == "steer_ang"
    assert columns["yaw_rate.tractor"] in ("yaw_rate", "imu_gyro_z")
    assert columns["articulation.semitrailer"] == "hitch"
    assert all(channel.sign == 1 and channel.gain == 1 for channel in proposal.signals.signals.values())


def test_numbers_count_the_trailers_and_the_steered_axle_has_its_name(tmp_path, weaving):
    """Also where the leading unit has no number; the steering ratio and the signs follow as for an axle named front."""
    columns = {"vx [km/h]": ("speed", 3.6), "LRW [deg]": (STEER, 20 / DEGREE)}
    columns |= {f"GyroZ_{name} [deg/s]": (YAW, -1 / DEGREE) for name in ("Prime", "Tr1", "Tr2")}
    units = {"units": ("lorry", "lead", "last"), "steered": "steer", "wheelbase": 4.0}
    _, proposal = survey_and_proposal(write_log(tmp_path, weaving, columns), **units)
    signals = proposal.signals.signals
    names = ("lorry", "Prime"), ("lead", "Tr1"), ("last", "Tr2")
    assert {f"yaw_rate.{unit}": f"GyroZ_{name}" for unit, name in names}.items() <= {
        name: signal.column for name, signal in signals.items()
    }.items()
    assert signals["steer.lorry.steer"].sensor == "steering wheel"
    assert 14 < 1 / signals["steer.lorry.steer"].gain < 30
    assert signals["steer.lorry.steer"].sign * signals["yaw_rate.lorry"].sign == -1


def test_gyros_are_of_the_units_in_the_order_of_their_lags(tmp_path, weaving):
    """Names say nothing; each takes the other columns of its device with it."""
    late = {f"yaw_rate.{lag}": np.roll(weaving.signals[YAW], 20 * lag) for lag in (0, 1, 2)}
    record = weaving.with_signals({**weaving.signals, **late})
    columns = {"vx": (SPEED, 1), "steer": (STEER, 1)}
    columns |= {f"gyro_{axis} {name}": (f"yaw_rate.{lag}", 1) for axis in "zx" for lag, name in enumerate("qbm")}
    _, proposal = survey_and_proposal(write_log(tmp_path, record, columns), units=("lorry", "lead", "last"))
    mapped = {signal: source.column for signal, source in proposal.signals.signals.items()}
    for unit, name in (("lorry", "q"), ("lead", "b"), ("last", "m")):
        assert mapped[f"yaw_rate.{unit}"] == f"gyro_z {name}"
        assert mapped[f"roll_rate.{unit}"] == f"gyro_x {name}"
    assert "it lags the first gyro by 0.80 s" in proposal.reasons["yaw_rate.last"]


@pytest.mark.parametrize("speed", [10.0, 20.0])
@pytest.mark.parametrize("manoeuvre", ["sweep", "lane_changes"])
def test_the_steering_ratio_has_a_sigma_that_covers_quick_manoeuvres(tmp_path, manoeuvre, speed):
    """The yaw rate of a quick manoeuvre does not have the size that a steady turn predicts."""
    truck = get("b_double")
    ratio, run = 23.0, simulate(truck, manoeuvre=manoeuvre, speed=speed, rate=50.0)
    columns = {"vx": (SPEED, 1), "SteeringWheelAngle [deg]": (STEER, ratio / DEGREE), "YawRate [rad/s]": (YAW, 1)}
    _, proposal = survey_and_proposal(write_log(tmp_path, run, columns), wheelbase=truck.wheelbase)
    text = str(proposal.signals.signals[STEER].text_of("gain"))
    gain, sigma = (float(number.strip(" %")) for number in text.split("+-"))
    assert abs(np.log(gain * ratio)) < 2 * sigma / 100
