"""Signs, units and columns of logs as others write them: frames of devices, missing units, wheels, full turns."""

import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import fifthwheel as fw
from fifthwheel.base.units import factor
from fifthwheel.data.channels import si_unit
from fifthwheel.data.checks import Fault
from fifthwheel.data.logs import SignalMap, read_log
from fifthwheel.data.logs.map_text import as_toml
from fifthwheel.data.logs.propose import propose_map
from fifthwheel.data.logs.readers import open_log
from fifthwheel.data.logs.survey import survey_log
from fifthwheel.data.record.full_turns import Unwrapped

TRUCK = fw.vehicle("cheng_cebon_2011")
FIRST, LAST = (unit.name for unit in TRUCK.units)
STEER, SPEED = f"steer.{FIRST}.front", "speed"
YAWS, ROLLS = [f"yaw_rate.{FIRST}", f"yaw_rate.{LAST}"], [f"roll_rate.{FIRST}", f"roll_rate.{LAST}"]
SIDEWAYS, ANGLES = [f"lateral_acceleration.{u}" for u in (FIRST, LAST)], [f"roll.{u}" for u in (FIRST, LAST)]
HITCH = f"articulation.{LAST}"
ORDER = (SPEED, STEER, *YAWS, *ROLLS, *SIDEWAYS, *ANGLES, HITCH)
COLUMNS = {
    "simulator": "Vx Steer_L1 AVz AVz_2 AVx AVx_2 Ay Ay_2 Roll Roll_2 Art_H",
    "logger": "Speed SteeringWheel GyroZ GyroZ_trailer GyroX GyroX_trailer AccY AccY_trailer",
    "German": "v_Fzg Lenkwinkel Gierrate_SZM Gierrate_Auflieger Wankrate_SZM Wankrate_Auflieger",
}
NAMES = {style: dict(zip(ORDER, names.split(), strict=False)) for style, names in COLUMNS.items()}
FRAMES = {
    "z up": set(),
    "gyros z down": {*YAWS},
    "all devices z down": {*YAWS, *SIDEWAYS},
    "the log z down": {STEER, HITCH, *YAWS, *SIDEWAYS},
    "trailer z down": {YAWS[1], SIDEWAYS[1]},
    "steer to the right": {STEER},
    "articulation": {HITCH},
}
UNITS = {
    "SI": {},
    "degrees": {"rad": "deg", "rad/s": "deg/s", "m/s": "km/h"},
    "degrees and g": {"rad": "deg", "rad/s": "deg/s", "m/s": "km/h", "m/s^2": "g"},
    "rates": {"rad/s": "deg/s"},
}
RATIO = 20.0


@pytest.fixture(scope="module")
def turns() -> fw.Record:
    noise: dict[str, float] = {}
    for names, variance in ((YAWS, 2e-6), (ROLLS, 2e-5), (SIDEWAYS, 0.01), (ANGLES, 1e-6), ([HITCH], 1e-6)):
        noise |= dict.fromkeys(names, variance)
    return fw.simulate(TRUCK, duration=20.0, speed=22.0, rate=50.0, sensors=noise)


def written(folder, turns, names, inverted=(), units=None, *, stated=False, more=None):
    """A log with these names, inverted signals and units by SI unit; the scale and sign of each column."""
    columns, truth = {"Time": turns.time}, {}
    for signal, column in NAMES[names].items():
        si = si_unit(signal)
        unit = (units or {}).get(si, si)
        ratio = RATIO if column == "SteeringWheel" and signal == STEER else 1.0
        sign = -1 if signal in inverted else 1
        values = sign * ratio * turns.signals[signal] / factor(unit, si)
        columns[f"{column} [{unit}]" if stated else column] = values
        truth[signal] = (column, sign, factor(unit, si) / ratio, unit)
    pd.DataFrame(columns | (more or {})).to_csv(folder / "run.csv", index=False, float_format="%.7g")
    return folder / "run.csv", truth


def proposed(path):
    with open_log(path) as log:
        survey = survey_log(log)
        return survey, propose_map(log, survey, units=(FIRST, LAST), wheelbase=TRUCK.wheelbase)


def wrong(proposal, truth, *, stated=False):
    """Signals with another column, sign or scale than in the log."""
    found = proposal.signals.signals
    return {
        signal
        for signal, (column, sign, scale, unit) in truth.items()
        if found[signal].column != column
        or found[signal].sign != sign
        or not 0.6
        < found[signal].gain
        * factor(found[signal].unit or (unit if stated else si_unit(signal)), si_unit(signal))
        / scale
        < 1.7
    }


CASES = [
    *(("simulator", frame, "degrees and g") for frame in FRAMES),
    ("logger", "gyros z down", "SI"),
    ("German", "gyros z down", "degrees"),
    ("German", "gyros z down", "rates"),
    ("logger", "z up", "degrees and g"),
    ("logger", "the log z down", "degrees"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("names", "frame", "units"), CASES)
def test_signs_and_units_of_a_log(tmp_path, turns, names, frame, units):
    """Without units; the signs of one with units."""
    path, truth = written(tmp_path, turns, names, FRAMES[frame], UNITS[units])
    survey, proposal = proposed(path)
    assert wrong(proposal, truth) == set()
    record = read_log(path, SignalMap.parse(as_toml(proposal, survey)))
    errors = [f for f in fw.check_signals(record, TRUCK) if f.severity == "error"]
    assert errors == []
    if names == "logger":
        path, truth = written(tmp_path, turns, names, FRAMES[frame], UNITS[units], stated=True)
        assert wrong(proposed(path)[1], truth, stated=True) == set()


@pytest.mark.slow
def test_what_else_explains_the_log_is_asked(tmp_path, turns):
    """Without roll, a steer angle to the right and two gyros z down are the same log."""
    path, truth = written(tmp_path, turns, "logger", {STEER}, UNITS["degrees"], stated=True)
    few = [f"{truth[signal][0]} [{truth[signal][3]}]" for signal in (SPEED, STEER, *YAWS)]
    pd.read_csv(path)[["Time", *few]].to_csv(path, index=False)
    survey, proposal = proposed(path)
    (question,) = proposal.questions
    assert (question.signal, question.fault, question.severity) == (STEER, Fault.SWAPPED_SIGN, "warning")
    assert f"if {YAWS[0]} and {YAWS[1]} are inverted instead" in question.message
    assert "look at a left turn" in question.message
    assert "look at a left turn" in as_toml(proposal, survey)


@pytest.mark.slow
def test_columns_of_wheels_come_after_those_of_the_body(tmp_path, turns):
    yaw, *rolls = ("AVz_knuckle_left", "AVx_hub_R1", "AVx_L2")
    more = {yaw: 1.3 * turns.signals[YAWS[0]], **dict.fromkeys(rolls, 2.0 * turns.signals[ROLLS[0]])}
    path, truth = written(tmp_path, turns, "simulator", more=more)
    _, proposal = proposed(path)
    assert wrong(proposal, truth) == set()
    assert yaw in proposal.others[YAWS[0]]
    pd.read_csv(path).drop(columns=["AVz"]).to_csv(path, index=False)
    _, proposal = proposed(path)
    (question,) = (q for q in proposal.questions if q.fault is Fault.WRONG_COLUMN)
    assert question.message.startswith(f"{YAWS[0]}: {yaw} is of a wheel")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("unit", "noise", "low"), [("deg", 0.2, 0.0), ("rad", 0.0, -180.0), (None, 0.2, -180.0), (None, 0.0, 0.0)]
)
def test_a_steering_wheel_angle_that_jumps_by_a_full_turn(tmp_path, turns, unit, noise, low):
    """At 0, when straight, or at half a turn."""
    mean = 0.0 if low == 0.0 else 175.0
    angle = np.degrees(RATIO * turns.signals[STEER]) + noise * np.random.default_rng(1).standard_normal(len(turns))
    wrapped = (angle + mean - low) % 360 + low
    name = "SteeringWheel" + (f" [{unit}]" if unit else "")
    more = {name: np.radians(wrapped) if unit == "rad" else wrapped}
    path, _ = written(tmp_path, turns, "logger", (), {}, stated=True)
    frame = pd.read_csv(path).drop(columns="SteeringWheel [rad]").assign(**more)
    frame.to_csv(path, index=False)
    survey, proposal = proposed(path)
    record = read_log(path, SignalMap.parse(as_toml(proposal, survey)))
    offset = 0.0 if mean == 0.0 else np.median(record.signals[STEER])
    ratio = proposal.signals.signals[STEER].gain
    assert record.signals[STEER] - offset == pytest.approx(
        ratio * np.radians(angle), abs=ratio * np.radians(10 if mean else 1e-3)
    )
    assert proposal.signals.signals[STEER].sign == 1
    assert "jumps by a full turn" in " ".join(record.notes)
    assert "jumps by a full turn" in proposal.reasons[STEER]


def test_other_angles_stay_as_they_are():
    """Of many turns, with spikes, with gaps."""
    time, k = np.arange(0, 20, 0.02), np.arange(1000)
    gaps = np.where(k % 300 > 290, np.nan, 150 * np.sin(time))
    for values in (700 * np.sin(time), 30 * np.sin(time) + 300 * (k % 400 == 399), gaps):
        angle = Unwrapped(360.0)
        assert angle.centred(angle.push(time, values)) == pytest.approx(values, nan_ok=True)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("case", "expected"),
    [
        ("z_down_gyros/run", {"GyroZ": -1, "GyroZ_trailer": -1, "GyroX": 1, "GyroX_trailer": 1, "SteeringWheel": 1}),
        ("wheel_columns_before_body/run", {"AVz": "deg/s", "AVx": "deg/s", "Ay": "g", "Ay_2": "g"}),
        ("road_wheel_degrees_without_unit/run", {"Steer_L1": "deg", "AVx": "deg/s", "Ay": "g", "Ay_2": "g"}),
        ("steering_wheel_wraps/exact", {"SteeringWheel": 1}),
        ("steering_wheel_wraps/noisy", {"SteeringWheel": 1}),
    ],
)
def test_logs_that_were_read_wrongly(case, expected):
    default = Path(__file__).resolve().parents[4] / "shared" / "cases"
    path = Path(os.environ.get("FIFTHWHEEL_CASES", default)) / f"{case}.csv"
    if not path.is_file():
        pytest.skip("no such logs; set FIFTHWHEEL_CASES to their folder")
    with open_log(path) as log:
        proposal = propose_map(log, survey_log(log), wheelbase=3.7)
    channels = {channel.column: channel for channel in proposal.signals.signals.values()}
    for column, value in expected.items():
        assert value in (channels[column].sign, channels[column].unit), column
