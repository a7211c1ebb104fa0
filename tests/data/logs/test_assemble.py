"""Logs whose table repeats the messages of a bus."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from fifthwheel.base.errors import SignalError
from fifthwheel.data.checks import Fault, check
from fifthwheel.data.logs import read_log
from fifthwheel.data.logs.readers import open_log
from fifthwheel.data.logs.row_time import RowTime, find_row_time
from fifthwheel.data.record.timestamps import Renewals

STEER, YAW, SPEED = "steer.tractor.front", "yaw_rate.tractor", "speed"
COURSES = {
    STEER: lambda t: 0.03 * np.sin(1.9 * t),
    YAW: lambda t: 0.12 * np.sin(1.9 * t - 0.3),
    SPEED: lambda t: 20 + 0.5 * np.sin(0.3 * t),
}


def table(folder, rates, *, rate=100, end=30.0, phase=0.004, **more):
    """A log with a row rate in Hz that holds signals with message rates in Hz; the others have a value in each row."""
    time = np.arange(round(end * rate)) / rate
    columns = {"time": time}
    for name, course in COURSES.items():
        period = 1 / rates.get(name, rate)
        sent = np.floor((time - phase) / period + 1e-9) * period + phase if name in rates else time
        columns[name] = course(sent)
    pq.write_table(pa.table(columns | more), folder / "log.parquet")
    return folder / "log.parquet"


def test_only_renewed_values_are_samples(tmp_path):
    record = read_log(table(tmp_path, {STEER: 20, YAW: 50, SPEED: 10}))
    assert [note.partition(";")[0] for note in record.notes] == [
        "steer.tractor.front: held, 20 Hz in a table of 100 Hz",
        "yaw_rate.tractor: held, 50 Hz in a table of 100 Hz",
        "speed: held, 10 Hz in a table of 100 Hz",
    ]
    present = np.isfinite(record.signals[YAW])
    assert present.sum() == pytest.approx(1500, abs=2)
    errors = record.signals[YAW][present] - COURSES[YAW](record.time[present])
    assert np.abs(errors[2:]).max() < 0.12 * 1.9 * 0.0065
    for name, tolerance in ((STEER, 0.03 * (1.9 * 0.0065 + (1.9 * 0.05) ** 2 / 8)), (SPEED, 0.002)):
        values = record.input(name)
        inside = slice(20, -20)
        assert np.abs(values - COURSES[name](record.time))[inside].max() < tolerance, name


def test_a_held_channel_of_a_dense_table_is_not_low_passed(tmp_path):
    """1 kHz decimated to 100 Hz: the steer angle is not late by half of its period."""
    record = read_log(table(tmp_path, {STEER: 20}, rate=1000))
    assert "steer.tractor.front: held, 20 Hz in a table of 1000 Hz" in record.notes[-1]
    assert record.rate == pytest.approx(100)
    inside = slice(20, -20)
    error = record.input(STEER) - COURSES[STEER](record.time)
    assert np.abs(error[inside]).max() < 0.03 * (1.9 * 0.0015 + (1.9 * 0.05) ** 2 / 8)
    assert np.abs(record.signals[YAW] - COURSES[YAW](record.time))[inside].max() < 1e-3


def test_a_frozen_sensor_of_a_held_channel_is_found(tmp_path):
    path = table(tmp_path, {STEER: 20, YAW: 20, SPEED: 10})
    assert not [finding for finding in check(read_log(path)) if finding.severity == "error"]
    columns = {name: np.array(values) for name, values in pq.read_table(path).to_pydict().items()}
    columns[YAW][1500:2000] = columns[YAW][1500]
    pq.write_table(pa.table(columns), path)
    assert [f.signal for f in check(read_log(path)) if f.fault is Fault.STUCK] == [YAW]


@pytest.mark.slow
def test_no_channel_of_a_real_log_is_taken_for_held(data):
    """Of their own messages all but one, which the gearbox computes at half the rate of its message; the steer angle of
    the real truck is stepwise, but not regularly."""
    patterns = ("real_truck/run02*.csv", "j1939/csu*.log", "vendor/canape*.mf4")
    for path in (path for pattern in patterns for path in data.glob(pattern) if path.suffix != ".md"):
        with open_log(path) as log:
            found = {name: Renewals() for name in log.columns}
            rows = RowTime(log, find_row_time(log))
            for chunk in log.chunks(list(log.columns)):
                time = rows.of(chunk)
                for name, values in chunk.values.items():
                    found[name].push(time, values)
        held = {name: round(result.rate) for name, renewals in found.items() if (result := renewals.finish())}
        assert held == ({"ETC1.output_shaft_speed@03": 50} if path.name == "csu_normal_drive.log" else {}), path.name


def test_a_window_that_excludes_nothing_is_said(tmp_path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("time,speed [m/s]\n" + "".join(f"{t / 10},20\n" for t in range(40)))
    record = read_log(path, exclude=[(1.0, 2.0), (100.0, 200.0)])
    notes = [note for note in record.notes if "exclude" in note]
    assert notes == ["exclude 100..200 s: no timestamp is in this window"]
    dated = tmp_path / "dated.csv"
    dated.write_text("time,speed\n" + "".join(f"{1.75e9 + 0.1 * k:.1f},20\n" for k in range(50)))
    by_record, by_log = (read_log(dated, exclude=[(t + 1.0, t + 2.0)]) for t in (0.0, 1.75e9))
    assert by_record == by_log
    assert len(by_record) == 39
    assert not ((record.time > 1) & (record.time < 2)).any()
    with pytest.raises(SignalError, match=r"exclude 14\.\.12: expected the first instant before the last"):
        read_log(path, exclude=[(14.0, 12.0)])
