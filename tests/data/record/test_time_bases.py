"""Time bases of the signals of a record."""

import pickle

import numpy as np

from fifthwheel.data.logs import SignalMap, read_log, write_record
from fifthwheel.data.record import Record

BASES = {"yaw_rate.semitrailer": "trailer logger", "sideslip.tractor": "optical sensor"}
RECORD = Record(
    time=np.arange(300) / 100,
    signals={"speed": np.full(300, 20.0), "steer.tractor.front": np.zeros(300), "yaw_rate.semitrailer": np.zeros(300)},
    reference={"sideslip.tractor": np.zeros(300)},
    time_bases=BASES,
)
MAP = """
[signals]
speed = "v"
"steer.tractor.front" = "delta"
[signals."yaw_rate.tractor"]
column = "gz"
time = "t_imu"
[signals."yaw_rate.semitrailer"]
column = "gz2"
clock = "trailer logger"
"""


def test_they_survive_the_operations_of_a_record():
    assert RECORD.cut(1, 2).time_bases == BASES
    assert RECORD.with_signals({"speed": np.zeros(300)}).time_bases == BASES
    assert pickle.loads(pickle.dumps(RECORD)).time_bases == BASES
    gap = np.where(np.arange(300) < 150, RECORD.time, RECORD.time + 5)
    segments = Record(time=gap, signals=RECORD.signals, time_bases=BASES).segments()
    assert [segment.time_bases for segment in segments] == [{"yaw_rate.semitrailer": "trailer logger"}] * 2


def test_the_default_is_one_time_base():
    assert Record(time=[0, 1], signals={}).time_bases == {}


def test_parquet_keeps_them_and_csv_does_not(tmp_path):
    for name, expected in (("log.parquet", BASES), ("log.csv", {})):
        write_record(RECORD, tmp_path / name)
        record = read_log(tmp_path / name)
        assert record == RECORD
        assert record.time_bases == expected


def test_a_map_names_them(tmp_path):
    rows = [f"{k / 100},20,0,{k / 100 + 0.003},0.1,0.1" for k in range(300)]
    (tmp_path / "log.csv").write_text("\n".join(["t,v,delta,t_imu,gz,gz2", *rows]))
    record = read_log(tmp_path / "log.csv", SignalMap.parse(MAP))
    assert record.time_bases == {"yaw_rate.tractor": "t_imu", "yaw_rate.semitrailer": "trailer logger"}


def test_the_main_one_is_that_of_the_steer_angle(tmp_path):
    rows = [f"{k / 100},20,0,0.1" for k in range(300)]
    (tmp_path / "log.csv").write_text("\n".join(["t,v,delta,gz", *rows]))
    text = '[signals]\nspeed = "v"\n[signals."steer.tractor.front"]\ncolumn = "delta"\nclock = "steering"'
    record = read_log(tmp_path / "log.csv", SignalMap.parse(text + '\n[signals."yaw_rate.tractor"]\ncolumn = "gz"'))
    assert record.time_bases == {"speed": "logger", "yaw_rate.tractor": "logger"}
