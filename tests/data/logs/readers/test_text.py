"""CSV in the wild: what loggers and spreadsheets put around and into a table."""

import numpy as np
import pytest

from fifthwheel.base.errors import SignalError
from fifthwheel.data.logs import read_log, source
from fifthwheel.data.logs.readers import open_log
from fifthwheel.data.logs.readers import text as module


def opened(tmp_path, content):
    path = tmp_path / "log.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return open_log(path)


def columns(log):
    chunks = [chunk.values for chunk in log.chunks(list(log.columns))]
    return {name: np.concatenate([chunk[name] for chunk in chunks]) for name in log.columns}


PREAMBLE = """Sample rate: 100 Hz
Start time: 19.06.2025 10:11:12
Events:

Time;vx;Lenkwinkel;Gierrate
s;km/h;°;°/s
0,00;50,1;1,2;0,3
0,01;50,2;1,3;0,4
0,02;50,3;;0,5
"""
CANAPE = (
    "Name;time;speed;yaw\nUnit;s;km/h;deg/s\nComment;;from EBS;gyro\n;0.0;50.1;0.3\n;0.01;50.2;0.4\n;0.02;50.3;0.5\n"
)


@pytest.mark.parametrize("encoding", ["utf-8", "cp1252", "utf-16"])
def test_what_is_above_the_rows(tmp_path, encoding):
    """A preamble and a row of units, with decimal commas; names, units and comments of CANape."""
    log = opened(tmp_path, PREAMBLE.encode(encoding))
    units = {"Time": "s", "vx": "km/h", "Lenkwinkel": "°", "Gierrate": "°/s"}
    assert {c.name: c.unit for c in log.columns.values()} == units
    found = columns(log)
    assert found["Time"] == pytest.approx([0, 0.01, 0.02])
    assert found["vx"] == pytest.approx([50.1, 50.2, 50.3])
    assert found["Lenkwinkel"] == pytest.approx([1.2, 1.3, np.nan], nan_ok=True)
    assert log.notes == ["3 comment lines above the header"]
    log = opened(tmp_path, CANAPE.encode(encoding))
    assert [(c.name, c.unit) for c in log.columns.values()][1:] == [("time", "s"), ("speed", "km/h"), ("yaw", "deg/s")]
    assert columns(log)["yaw"] == pytest.approx([0.3, 0.4, 0.5])


@pytest.mark.parametrize(
    ("content", "time"),
    [
        ("# by hand\n  t    vx   r\n 0.0  50.1  0.3\n 0.01  50.2  0.4\n 0.02 50.3\t0.5 \n", [0, 0.01, 0.02]),
        ("t|vx|r\n0.0|50.1|0.3\n0.01|50.2|0.4\n0.02|50.3|0.5\n", [0, 0.01, 0.02]),
        ('"t","vx","r"\n"0,0","50,1","0,3"\n"0,01","50,2","0,4"\n"0,02","50,3","0,5"\n', [0, 0.01, 0.02]),
        ("t;vx;r;\n0;50.1;0.3;\n1;50.2;0.4;\n2;50.3;0.5;\n", [0, 1, 2]),
        ("t;vx;r;\n0;50.1;0.3\n1;50.2;0.4\n2;50.3;0.5\n", [0, 1, 2]),
        ("t,vx (km/h),r [deg/s]\n0,50.1,0.3\n1,50.2,0.4\n2,50.3,0.5\n", [0, 1, 2]),
        ("t,vx,r\n23:59:59.990,50.1,0.3\n00:00:00.000,50.2,0.4\n00:00:00.010,50.3,0.5\n", [0, 0.01, 0.02]),
        ("t,vx,r\n2025-06-19T10:11:12Z,50.1,0.3\n2025-06-19T10:11:12.01Z,50.2,0.4\n2025-06-19 10:11:12.02,50.3,0.5\n",
         [0, 0.01, 0.02]),
        ("t;vx;r\n30.06.2025 23:59:59,5;50,1;0,3\n01.07.2025 00:00:00,5;50,2;0,4\n01.07.2025 00:00:01,5;50,3;0,5\n",
         [0, 1, 2]),
        ("t,vx,r\n06/19/2025 11:59:59 AM,50.1,0.3\n06/19/2025 12:00:00 PM,50.2,0.4\n06/19/2025 12:00:01 PM,50.3,0.5\n",
         [0, 1, 2]),
        ("t,vx,r\n19/06/2025 11:59:59,50.1,0.3\n19/06/2025 12:00:00,50.2,0.4\n19/06/2025 12:00:01,50.3,0.5\n",
         [0, 1, 2]),
    ],
)  # fmt: skip
def test_separators_dates_and_times_of_day(tmp_path, content, time):
    found = columns(opened(tmp_path, content))
    assert found["t"] - found["t"][0] == pytest.approx(time, abs=1e-6)
    assert found["vx"] == pytest.approx([50.1, 50.2, 50.3])
    assert found["r"] == pytest.approx([0.3, 0.4, 0.5])


def test_a_date_is_the_time_whatever_its_unit_row_says(tmp_path):
    rows = "".join(f"19.06.2025 10:11:{k:02d},50;{k},5;Halt\n" for k in range(12))
    path = tmp_path / "log.csv"
    for name in ("Datum/Uhrzeit", "Zeitstempel", "Timestamp"):
        path.write_text(f"{name};speed;Bemerkung\n-;km/h;-\n{rows}")
        record = read_log(path)
        assert record.time - record.time[0] == pytest.approx(np.arange(12))
        assert record.signals["speed"] == pytest.approx((np.arange(12) + 0.5) / 3.6)


def test_a_row_with_a_wrong_time_is_left_out(tmp_path):
    """A bad date, a stamp whose digit has flipped."""
    path = tmp_path / "log.csv"
    rows = "".join(f"2025-06-19 10:11:{k:02d},{k}\n" for k in range(20)).replace("10:11:07", "10:V1:07")
    path.write_text(f"time,speed\n{rows}")
    assert len(read_log(path)) == 19
    path.write_text("time,speed\n" + "".join(f"{k / 10},{k}\n" for k in range(50)).replace("2.5,25", "72.5,25"))
    record = read_log(path)
    assert len(record) == 49
    assert record.notes == ("time: 1 row without a time left out",)


def test_the_zone_of_an_instant_counts(tmp_path):
    """At the end of daylight saving time, local time goes back by one hour, and UTC does not."""
    rows = [f"2025-10-26T02:59:5{k}+02:00,{k}" for k in range(10)] + [
        f"2025-10-26T02:00:0{k}+0100,{k}" for k in range(9)
    ]
    found = columns(opened(tmp_path, "t,v\n" + "".join(f"{row}\n" for row in rows)))
    assert found["t"] == pytest.approx(1761440390 + np.arange(19))
    found = columns(opened(tmp_path, "t,v\n2025-10-26T02:59:50-03:30,1\n2025-10-26T02:59:51 -0330,2\n"))
    assert found["t"] == pytest.approx([1761440390 + 5.5 * 3600, 1761440391 + 5.5 * 3600])
    found = columns(opened(tmp_path, "t,v\n2024-02-29T00:00:00.25,1\n2024-03-01T00:00:00.25,1\n"))
    assert found["t"] == pytest.approx([1709164800.25, 1709251200.25])
    rows = [f"26.10.2025 02:59:5{k},{k}" for k in range(10)] + [f"26.10.2025 02:00:0{k},{k}" for k in range(9)]
    (tmp_path / "log.csv").write_text("time,speed\n" + "".join(f"{row}\n" for row in rows))
    with pytest.raises(SignalError, match=r"back by one hour.*daylight saving time; export the time in UTC"):
        read_log(tmp_path / "log.csv")


def test_a_large_table_comes_in_chunks_that_fit_together(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "_BLOCK", 4000)
    rows = np.column_stack([np.arange(5000) * 0.01, np.random.default_rng(0).normal(size=5000)]).round(6)
    (tmp_path / "log.csv").write_text("t,r\n" + "".join(f"{t},{r}\n" for t, r in rows))
    log = module.open_log(tmp_path / "log.csv")
    chunks = list(log.chunks(["t", "r"]))
    assert len(chunks) > 10
    assert [chunk.done for chunk in chunks] == sorted(chunk.done for chunk in chunks)
    assert chunks[-1].done == 1.0
    assert np.concatenate([chunk.values["r"] for chunk in chunks]) == pytest.approx(rows[:, 1])
    assert list(next(log.chunks(["r"])).values) == ["r"]


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_a_sample_is_whole_lines_spread_over_the_file(tmp_path, monkeypatch, end):
    monkeypatch.setattr(source, "_LARGE", 1e4)
    monkeypatch.setattr(source, "_PART", 1e3)
    rows = "".join(f"{k / 10},{k + 0.5}{end}" for k in range(20_000))
    path = tmp_path / "log.csv"
    path.write_bytes(f"# a run{end}t,r{end}{rows}".encode())
    log = module.open_log(path)
    log.sample()
    found = columns(log)
    np.testing.assert_allclose(found["r"], 10 * found["t"] + 0.5, atol=1e-9)
    numbers = np.rint(10 * found["t"]).astype(int)
    assert (np.diff(numbers) > 0).all()
    assert (np.diff(numbers) > 1).sum() == 7
    assert numbers[0] == 0
    assert numbers[-1] == 19_999
    assert 0.07 < numbers.size / 20_000 < 0.1
    assert log.notes[0].startswith("a sample of 0 of 0 MB was read, in 8 parts of the file: ranges, missing")
    assert columns(log)["r"] == pytest.approx(found["r"])
    path.write_text("t,r\n" + rows, encoding="utf-16")
    wide = module.open_log(path)
    wide.sample()
    assert not wide.sampled


def test_binary_rubbish_within_a_table_costs_its_lines_only(tmp_path):
    good = "".join(f"{k / 10},{k}\n" for k in range(100))
    log = opened(tmp_path, b"t,r\n" + good.encode() + b"\xff\x00\x81,\x93\nxx,\xfe,\x00,\n" + b"10.0,100\n")
    assert not log.sampled
    found = columns(log)
    assert found["r"][-1] == 100
    assert np.isnan(found["r"][100])
    assert any("1 lines left out" in note for note in log.notes)
    log = opened(tmp_path, "t,v,state\n0,1,drive\n1,2,drive\n2,3,brake\n")
    columns(log)
    assert list(log.unusable) == ["state"], "text harms only who asks for it"
