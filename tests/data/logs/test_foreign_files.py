"""Files as other programs write them: CAN traces as text, VBOX, times without a unit, marks of missing samples."""

import base64
from datetime import UTC, datetime

import numpy as np
import pytest

from fifthwheel.base.errors import SignalError
from fifthwheel.data.logs import SignalMap, read_log
from fifthwheel.data.logs.map_text import as_toml
from fifthwheel.data.logs.propose import propose_map
from fifthwheel.data.logs.readers import open_log
from fifthwheel.data.logs.row_time import find_row_time
from fifthwheel.data.logs.survey import survey_log
from fifthwheel.data.record.timestamps import RepeatedTimestamps

COUNT, STEP = 60, 0.05
TIMES = STEP * np.arange(COUNT)
YAW = np.round(0.1 * np.sin(TIMES), 4)
START = datetime(2025, 6, 19, 9, 59, 58, tzinfo=UTC)


def table(cells, header="Time", end="", minus="-"):
    lines = [f"{header},YawRate{end}"]
    lines += [f"{c},{y}{end}".replace(",-", f",{minus}") for c, y in zip(cells, YAW, strict=True)]
    return "\n".join([*lines, ""])


def mapped(path, text, **time):
    path.write_text(text, encoding="utf-8")
    source = {"signals": {"yaw_rate.tractor": {"column": "YawRate", "unit": "rad/s"}}}
    return read_log(path, SignalMap.model_validate(source | ({"time": time} if time else {})))


def seconds(k):
    return datetime.fromtimestamp(START.timestamp() + STEP * k, UTC)


@pytest.mark.parametrize(
    ("header", "cell", "note"),
    [
        ("Time", lambda k: round(1e3 * START.timestamp()) + 50 * k, "ms since 1970"),
        ("time_stamp", lambda k: round(1e6 * START.timestamp()) + 50_000 * k, "us since 1970"),
        ("gps_time", lambda k: round(1e9 * START.timestamp()) + 50_000_000 * k, "ns since 1970"),
        ("Elapsed Time", lambda k: 50 * k, "ms"),
        ("%time", lambda k: 50_000 * k, "us"),
        ("datetime", lambda k: f"{(START.timestamp() + STEP * k) / 86400 + 25569:.10f}", "days since 1900"),
        ("t", lambda k: f"{START.timestamp() + STEP * k + 2082844800:.3f}", "LabVIEW"),
        ("UTC", lambda k: f"{seconds(k):%H%M%S.%f}"[:-4], "HHMMSS"),
        ("utc", lambda k: f"{seconds(k):%Y-%m-%dT%H:%M:%S.%f}Z", ""),
        ("Uhrzeit", lambda k: f"{seconds(k):%H:%M:%S.%f}", ""),
        ("x", lambda k: f"{STEP * k:.2f}", ""),
    ],
)
def test_times(header, cell, note, tmp_path):
    record = mapped(tmp_path / "run.csv", table(map(cell, range(COUNT)), header))
    assert np.diff(record.time) == pytest.approx(STEP, abs=2e-3)
    assert record.signals["yaw_rate.tractor"] == pytest.approx(YAW)
    assert any(note in text for text in record.notes) or not note


def test_a_stated_unit_that_makes_no_time_is_refused(tmp_path):
    text = table(1750327872000 + 50 * np.arange(COUNT))
    with pytest.raises(SignalError, match='is no time of a log; set unit = "ms"'):
        mapped(tmp_path / "run.csv", text, unit="s")


def test_midnight_is_passed(tmp_path):
    record = mapped(tmp_path / "run.csv", table((86399 + TIMES) % 86400))
    assert np.diff(record.time) == pytest.approx(STEP)


def test_a_distance_is_no_time(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("\n".join(["x,y", *[f"{20 * t + t * t},{k}" for k, t in enumerate(TIMES)], ""]))
    with open_log(path) as log:
        assert find_row_time(log) is None


@pytest.mark.parametrize("size", [1, 7, 60])
def test_a_repeated_timestamp_gives_one_sample(size):
    """The first value of each column counts, however the log is divided."""
    time, values = np.repeat(np.arange(20.0), 2), np.arange(40.0)
    values[2::4] = np.nan
    joined, found = RepeatedTimestamps(), []
    for begin in range(0, 40, size):
        found.append(joined.push(time[begin : begin + size], {"a": values[begin : begin + size]})[1]["a"])
    with pytest.raises(SignalError, match="10 of 40 rows repeat"):  # with other values, which is too often
        joined.last("log")
    assert np.concatenate(found)[:4] == pytest.approx([0.0, 3.0, 4.0, 7.0])
    assert joined.notes == ["time: 20 rows repeat the timestamp of the row before, first at 0 s; one sample is used"]


@pytest.mark.parametrize("mark", ["999", "-9999", "65535", "655.35", "1e20"])
def test_marks_of_missing_samples(mark, tmp_path):
    text = table(TIMES)
    lines = text.splitlines()
    for row in (5, 20, 21, 40):
        lines[row] = f"{lines[row].split(',')[0]},{mark}"
    record = mapped(tmp_path / "run.csv", "\n".join([*lines, ""]))
    assert np.isnan(record.signals["yaw_rate.tractor"]).sum() == 4
    assert any(f"4 samples are exactly {float(mark):.10g}" in note for note in record.notes)


@pytest.mark.parametrize("minus", ["\u2212", "\u2013"])
def test_a_minus_of_typography(minus, tmp_path):
    record = mapped(tmp_path / "run.csv", table(TIMES, minus=minus))
    assert record.signals["yaw_rate.tractor"] == pytest.approx(YAW)


@pytest.mark.parametrize(
    ("header", "end", "message"),
    [
        ("Time", ",", None),
        ("Time,Speed", "", "the header has 3 names, the rows have 2 cells"),
        ("", "", "begins with numbers"),
    ],
)
def test_cells_of_the_header(header, end, message, tmp_path):
    text = table(TIMES, header)
    text = text.replace("\n", f"{end}\n").replace(f"YawRate{end}", "YawRate", 1) if header else text.split("\n", 1)[1]
    if message is None:
        assert mapped(tmp_path / "run.csv", text).signals["yaw_rate.tractor"] == pytest.approx(YAW)
    else:
        with pytest.raises(SignalError, match=message):
            mapped(tmp_path / "run.csv", text)


def test_json_is_named(tmp_path):
    path = tmp_path / "run.jsonl"
    path.write_text('{"Time": 0.0, "YawRate": 1.0}\n')
    with pytest.raises(SignalError, match="JSON; export it as CSV"):
        read_log(path)


def test_vbox(tmp_path):
    rows = [f"012 {seconds(k):%H%M%S.%f}"[:-4] + f" 080.00 {y:+.6E}" for k, y in enumerate(np.degrees(YAW))]
    head = ["[header]", "satellites", "time", "velocity kmh", "YawRate", "", "[channel units]", "deg/s", ""]
    text = [
        "File created on 19/06/2025",
        "",
        *head,
        "[column names]",
        "sats time velocity YawRate",
        "",
        "[data]",
        *rows,
    ]
    path = tmp_path / "run.vbo"
    path.write_text("\r\n".join([*text, ""]), newline="")
    record = read_log(path, SignalMap.model_validate({"signals": {"yaw_rate.tractor": "YawRate", "speed": "velocity"}}))
    assert record.signals["yaw_rate.tractor"] == pytest.approx(YAW, abs=1e-6)
    assert record.signals["speed"] == pytest.approx(80 / 3.6)
    assert np.ptp(record.time) == pytest.approx(TIMES[-1])


@pytest.mark.parametrize("empty", [True, False])
def test_a_speed_once_a_second(empty, tmp_path):
    rows, speed = np.arange(400), np.round(20 + np.sin(0.3 * np.arange(21)), 1)
    cells = [f"{speed[k // 20]}" if k % 20 == 0 or not empty else "" for k in rows]
    text = "\n".join(
        ["Time,speed,yaw_rate.tractor", *[f"{STEP * k:.2f},{c},0.1" for k, c in zip(rows, cells, strict=True)], ""]
    )
    path = tmp_path / "run.csv"
    path.write_text(text)
    record = read_log(path)
    expected = np.interp(record.time, np.arange(21), speed)
    assert record.signals["speed"][:380] == pytest.approx(expected[:380])
    assert any("1 Hz in a table of 20 Hz" in note for note in record.notes)


DATA = bytes.fromhex("7F7D0F717D7F7D7D")
SPACED = " ".join(f"{byte:02X}" for byte in DATA)
TRACES = {
    "SavvyCAN": lambda k: f"{50_000 * k},18F0090B,true,Rx,0,8,{SPACED.replace(' ', ',')},",
    "BUSMASTER": lambda k: f"10:00:{k // 20:02d}:{500 * (k % 20):04d} Rx 1 0x18F0090B x 8 {SPACED} ",
    "CRTD": lambda k: f"{STEP * k:.6f} 1R29 18F0090B {SPACED}",
    "python-can": lambda k: f"{STEP * k},0x18f0090b,1,0,0,8,{base64.b64encode(DATA).decode()}",
    "CSS Electronics": lambda k: f"19T1000{k // 20:02d}{50 * (k % 20):03d};1;18f0090b;{DATA.hex()}",
    "candump -t A": lambda k: f" (2025-06-19 10:00:{STEP * k:09.6f})  can0  18F0090B   [8]  {SPACED}",
}


@pytest.mark.slow
@pytest.mark.parametrize("program", TRACES)
def test_can_traces_as_text(program, tmp_path):
    pytest.importorskip("can")
    path = tmp_path / "trace"
    path.write_text("\n".join([*map(TRACES[program], range(COUNT)), ""]))
    with open_log(path) as log:
        chunk = next(log.chunks(["VDC2.yaw_rate@0B"]))
        assert chunk.time is not None
        assert np.diff(chunk.time) == pytest.approx(STEP, abs=1e-6)
        assert len(chunk.values["VDC2.yaw_rate@0B"]) == COUNT


def test_a_database_without_frames_is_noted(tmp_path):
    path, database = tmp_path / "run.csv", tmp_path / "truck.dbc"
    path.write_text(table(TIMES))
    database.write_text("")
    with open_log(path, [database]) as log:
        assert any("truck.dbc not used" in note for note in log.notes)


def test_a_course_gives_a_yaw_rate(tmp_path):
    """It is clockwise, wraps at 360 degrees, and is the only yaw signal."""
    rate = 0.05 * np.sin(0.5 * TIMES)
    course = (359.9 - np.degrees(np.cumsum(rate) * STEP)) % 360
    lines = [f"{t:.2f},80,{c:.4f}" for t, c in zip(TIMES, course, strict=True)]
    path = tmp_path / "run.csv"
    path.write_text("\n".join(["Time,Speed [km/h],Heading", *lines, ""]))
    with open_log(path) as log:
        proposal = propose_map(log, survey_log(log))
    source = proposal.signals.signals["yaw_rate.tractor"]
    assert (source.column, source.derivative, source.sign) == ("Heading", True, -1)
    record = read_log(path, SignalMap.parse(as_toml(proposal, survey_log(open_log(path)))))
    present = np.isfinite(record.signals["yaw_rate.tractor"])
    assert present.sum() == COUNT - 2
    assert record.signals["yaw_rate.tractor"][present] == pytest.approx(rate[present], abs=2e-3)


def test_a_derivative_is_of_a_rate():
    with pytest.raises(SignalError, match=r"speed: derivative is of a rate"):
        SignalMap.parse('[signals]\nspeed = { column = "x", derivative = true }')
