"""Records: checks, parts, segments, arrays and data frames, time bases, plots and tables."""

import copy
import pickle
import re
import sys
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest

from fifthwheel.base.errors import FifthwheelError, SignalError
from fifthwheel.base.plots.items import BLUE, VERMILLION
from fifthwheel.data.logs import SignalMap, read_log, write_record
from fifthwheel.data.record import Record
from fifthwheel.data.record.record import segments_above
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import get

T = np.arange(0, 20, 0.1)


def record(**signals):
    return Record(time=T, signals={"speed": np.full(T.size, 20.0), "yaw_rate.tractor": np.sin(T)} | signals)


def with_gap(start, stop):
    return record(speed=np.where((start < T) & (stop > T), np.nan, T))


def test_is_frozen_and_read_only():
    source = np.sin(T)
    made = Record(time=T, signals={"roll.semitrailer": source, "speed": np.where(T < 1, np.nan, T)})
    source[:] = 0
    assert made.signals["roll.semitrailer"][10] == np.sin(T[10])
    with pytest.raises(AttributeError):
        made.time = T
    for change in (
        lambda signals: signals.__setitem__("speed", 1),
        lambda signals: signals.pop("speed"),
        lambda signals: signals.update(speed=1),
        lambda signals: signals.__ior__({"speed": 1}),
        lambda signals: signals.clear(),
    ):
        with pytest.raises(TypeError, match="read-only"):
            change(made.signals)
    with pytest.raises(ValueError, match="read-only"):
        made.signals["roll.semitrailer"][0] = 1.0
    assert made == pickle.loads(pickle.dumps(made)) == copy.deepcopy(made)
    assert made != record()
    assert made != "record"
    assert list(made.with_signals({"speed": T, "roll.tractor": T}).signals) == [*made.signals, "roll.tractor"]


INVALID = [
    ({"time": np.where(np.arange(T.size) == 50, 4.85, T)}, r"time: goes back from 4\.9 s to 4\.85 s at row 51"),
    ({"time": np.where(np.arange(T.size) == 50, 4.9, T)}, r"time: 4\.9 s at row 51 occurs twice"),
    ({"time": np.where(np.arange(T.size) == 50, np.nan, T)}, r"time: no finite value at row 51"),
    ({"time": T[:1], "signals": {"speed": T[:1]}}, "time: 1 samples, at least 2"),
    ({"time": np.ones((2, 2))}, "time: 2 dimensions"),
    ({"signals": {"speed": T[:-1]}}, "speed: 199 samples, 200 expected"),
    ({"signals": {"speed": np.where(T == 0, np.inf, T)}}, r"speed: infinite at 0\.00 s"),
    ({"signals": {"speed": ["fast"] * T.size}}, "speed: not numbers"),
    ({"signals": {"yaw_rte.tractor": T}}, r"did you mean 'yaw_rate\.tractor'"),
    ({"signals": {"yaw_rate": T}}, r"yaw_rate: .*such as 'yaw_rate\.tractor'"),
    ({"signals": {"speed.tractor": T}}, "call it 'speed'"),
    ({"reference": {"Winkel des Aufliegers": T}}, r"expected quantity\.unit"),
    ({"signals": {"time": T}}, "time: the time base cannot be a signal"),
]


def test_an_invalid_record_is_refused():
    for change, message in INVALID:
        with pytest.raises(SignalError, match=message):
            Record(**({"time": T, "signals": {"speed": T}} | change))


def test_a_call_that_does_not_fit_is_refused():
    slow = record(**{"steer.tractor.front": np.where(np.arange(T.size) % 10, np.nan, 0.0)})
    for call, message in [
        (lambda: record().cut(30, 40), r"within 0\.00 to 19\.90 s"),
        (lambda: record().input("yaw_rate.traktor"), r"did you mean 'yaw_rate\.tractor'"),
        (lambda: record().plot("yaw_rate.tracktor"), r"yaw_rate\.tracktor: not in .*did you mean 'yaw_rate\.tractor'"),
        (lambda: Record(time=T * 1000, signals={"speed": T}).segments(), "check the unit of time"),
        (lambda: segments_above(record(speed=0.1 * T), 5.0), "^speed: "),
        (lambda: segments_above(record(speed=np.nan * T), 5.0), "^speed: "),
        (
            lambda: segments_above(slow, 5.0, ("speed", "steer.tractor.front")),
            r"steer\.tractor\.front: missing for more than 0\.5 s again and again",
        ),
    ]:
        with pytest.raises(SignalError, match=message):
            call()


def test_gaps_of_an_input():
    """Up to half a second they are interpolated."""
    assert with_gap(4.05, 4.45).input("speed") == pytest.approx(T, abs=1e-12)
    assert with_gap(-1, 0.25).input("speed")[0] == pytest.approx(0.3)
    with pytest.raises(SignalError, match="speed: missing in all samples of"):
        with_gap(-1, 99).input("speed", np.inf)
    for start, stop, where in ((4.05, 6, "4.00 to 6.00"), (-1, 0.95, "0.00 to 1.00"), (18.95, 99, "18.90 to 19.90")):
        with pytest.raises(SignalError, match=rf"speed: missing from {where} s; up to 0\.5 s"):
            with_gap(start, stop).input("speed")


@pytest.mark.parametrize(
    ("start", "stop", "spans"),
    [
        (4.05, 4.45, [(0, 19.9)]),
        (4.05, 4.55, [(0, 4.0), (4.6, 19.9)]),
        (-1, 0.45, [(0, 19.9)]),
        (-1, 0.55, [(0.6, 19.9)]),
        (19.45, 99, [(0, 19.9)]),
        (19.35, 99, [(0, 19.3)]),
    ],
)
def test_a_long_gap_of_an_input_ends_a_segment(start, stop, spans):
    names = ("speed", "yaw_rate.tractor")
    for name in names:
        gap = record(**{name: np.where((start < T) & (stop > T), np.nan, record().signals[name])})
        segments = segments_above(gap, 5.0, names)
        assert [segment.span for segment in segments] == [pytest.approx(span) for span in spans]
        assert all(segment.input(name).size for segment in segments), "no gap is too long"
        assert segments_above(gap, 5.0, [n for n in names if n != name])[0].span == gap.span
    gap = record(speed=np.where((T > 7.05) & (T < 9), np.nan, 20.0), **{names[1]: np.where(T < 8, np.nan, T)})
    assert [segment.span for segment in segments_above(gap, 5.0, names)] == [(pytest.approx(9.0), pytest.approx(19.9))]


def test_a_pause_of_all_signals_is_no_gap_of_an_input():
    """Messages of a trace have timestamps of their own, so that the last row before a pause may lack the speed."""
    time = np.concatenate([np.arange(0, 2, 0.01), np.arange(7, 9, 0.01)])
    speed = np.full(400, 20.0)
    speed[[199, 201]] = np.nan
    record = Record(time=time, signals={"speed": speed, "yaw_rate.tractor": np.zeros(400)}, name="trace")
    np.testing.assert_array_equal(record.input("speed"), 20.0)
    assert [segment.span for segment in record.segments()] == [(0, 1.99), (7, pytest.approx(8.99))]
    missing = np.where((time > 1) & (time < 1.8), np.nan, speed)
    with pytest.raises(SignalError, match=r"speed: missing from 1\.00 to 1\.80 s"):
        record.with_signals({"speed": missing}).input("speed")


def test_segments_are_separated_by_time_gaps_and_low_speed():
    time = np.concatenate([T[:50], T[50:55] + 5, T[60:] + 10])
    segments = Record(time=time, signals={"speed": time}, name="x").segments()
    assert [segment.name for segment in segments] == ["x (1)", "x (2)"]
    assert [len(segment) for segment in segments] == [50, 140]
    without_gap = record()
    assert without_gap.segments() == [without_gap]
    slow = record(speed=np.where((T > 2.95) & (T < 4) | (T > 15.95), 2.0, 20.0))
    spans = [(0, 2.9), (4, 15.9)]
    assert [segment.span for segment in segments_above(slow, 5.0)] == [pytest.approx(span) for span in spans]
    rows = (T < 7) | (T > 9.45)
    paused = Record(time=T[rows], signals={name: values[rows] for name, values in slow.signals.items()})
    spans = [(0, 2.9), (4, 6.9), (9.5, 15.9)]
    assert [segment.span for segment in segments_above(paused, 5.0)] == [pytest.approx(span) for span in spans]


YAW = "yaw_rate.tractor"
UNITS = {"speed": "km/h", YAW: "deg/s", "reference.yaw_rate.tractor": "deg/s"}
COLUMNS = {"speed": [72.0, np.nan, 36.0], YAW: [0.0, 1.0, 2.0], "reference.yaw_rate.tractor": [0.0, 1.5, 2.0]}


def expected(**fields) -> Record:
    rates = np.radians([COLUMNS[YAW], COLUMNS["reference.yaw_rate.tractor"]])
    return Record(
        time=[0, 0.1, 0.3], signals={"speed": [20, np.nan, 10], YAW: rates[0]}, reference={YAW: rates[1]}, **fields
    )


def close(first: Record, second: Record) -> bool:
    pairs = ((first.signals, second.signals), (first.reference, second.reference))
    same = [a.keys() == b.keys() and all(np.allclose(a[n], b[n], equal_nan=True) for n in a) for a, b in pairs]
    return np.allclose(first.time, second.time) and all(same)


def test_arrays_are_converted():
    record = Record.from_arrays([0, 0.1, 0.3], COLUMNS, units=UNITS, name="run")
    assert close(record, expected())
    assert record.name == "run"
    assert Record.from_arrays([0, 1], {"speed": [3, 4]}) == Record(time=[0, 1], signals={"speed": [3, 4]})


def test_a_record_survives_a_data_frame():
    record = simulate(get("cheng_cebon_2011"), count=1, seed=1)
    assert record.reference
    assert Record.from_table(record.to_pandas()) == record


@pytest.mark.parametrize("kind", ["s", "duration", "date", "zone"])
def test_the_index_is_the_time(kind):
    time = np.array([0, 0.1, 0.3])
    index = pd.Index(time) if kind == "s" else pd.to_timedelta(time, unit="s")
    if kind in ("date", "zone"):
        index = pd.Timestamp("2026-05-01 12:00", tz="Europe/Berlin" if kind == "zone" else None) + index
    record = Record.from_table(pd.DataFrame(COLUMNS, index=index), units=UNITS)
    assert close(record, expected())
    started = {"date": "2026-05-01T12:00:00+00:00", "zone": "2026-05-01T10:00:00+00:00"}.get(kind)
    assert (record.date and record.date.isoformat()) == started
    time = pa.array([1_777_593_600_000, 1_777_593_600_100], pa.timestamp("ms"))
    arrow = Record.from_table(pa.table({"time": time, "speed": [72.0, None]}), units={"speed": "km/h"})
    assert (arrow.time.tolist(), str(arrow.date)) == ([0.0, 0.1], "2026-05-01 00:00:00+00:00")
    np.testing.assert_array_equal(arrow.signals["speed"], [20.0, np.nan])
    speed = Record.from_table(pd.DataFrame({"speed": pd.array([20, None, 1], dtype="Int64")}, index=index)).signals
    np.testing.assert_array_equal(speed["speed"], [20, np.nan, 1])


def test_errors_name_the_signal_and_the_cure(monkeypatch):
    arrays, frame = Record.from_arrays, lambda *args, **more: Record.from_table(pd.DataFrame(*args, **more))
    for make, message in [
        (lambda: arrays([0, 1], {"sped": [1, 2]}), "sped"),
        (lambda: arrays([0, 1], {"speed": [1, 2]}, units={"sped": "m/s"}), "sped: has a unit, but is not a"),
        (lambda: arrays([0, 1], {"speed": [1, 2]}, units={"speed": "deg"}), "speed: expected m/s or a unit"),
        (lambda: arrays([0, 1], {"speed": [1, 2, 3]}), "speed: 3 samples, 2 expected"),
        (lambda: frame({"speed": [1, 2]}), r"time: .* use frame.set_index\('time'\)"),
        (lambda: frame({"speed": [1, 2]}, index=["a", "b"]), "time: expected an index of"),
        (lambda: frame({"speed": ["x", "y"]}, index=[0.0, 1.0]), "speed: not numbers"),
        (lambda: frame({0: [1, 2]}, index=[0.0, 1.0]), "0: "),
        (lambda: frame([[1, 2]] * 2, index=[0.0, 1.0], columns=["speed", "speed"]), "speed: two columns have this"),
    ]:
        with pytest.raises(SignalError, match=message):
            make()
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(FifthwheelError, match=r"pip install 'fifthwheel\[pandas\]'"):
        record().to_pandas()


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


def test_time_bases_survive_the_operations_of_a_record(tmp_path):
    """Parquet keeps them and CSV does not."""
    assert RECORD.cut(1, 2).time_bases == RECORD.with_signals({"speed": np.zeros(300)}).time_bases == BASES
    assert pickle.loads(pickle.dumps(RECORD)).time_bases == BASES
    gap = np.where(np.arange(300) < 150, RECORD.time, RECORD.time + 5)
    segments = Record(time=gap, signals=RECORD.signals, time_bases=BASES).segments()
    assert [segment.time_bases for segment in segments] == [{"yaw_rate.semitrailer": "trailer logger"}] * 2
    for name, expected in (("log.parquet", BASES), ("log.csv", {})):
        write_record(RECORD, tmp_path / name)
        read = read_log(tmp_path / name)
        assert (read, read.time_bases) == (RECORD, expected)


def test_a_map_names_them(tmp_path):
    """The main one is that of the steer angle."""
    rows = [f"{k / 100},20,0,{k / 100 + 0.003},0.1,0.1" for k in range(300)]
    (tmp_path / "log.csv").write_text("\n".join(["t,v,delta,t_imu,gz,gz2", *rows]))
    record = read_log(tmp_path / "log.csv", SignalMap.parse(MAP))
    assert record.time_bases == {"yaw_rate.tractor": "t_imu", "yaw_rate.semitrailer": "trailer logger"}
    text = '[signals]\nspeed = "v"\n"steer.tractor.front" = {column = "delta", clock = "steering"}'
    record = read_log(tmp_path / "log.csv", SignalMap.parse(text + '\n"yaw_rate.tractor" = "gz"'))
    assert record.time_bases == {"speed": "logger", "yaw_rate.tractor": "logger"}


TIME = np.arange(100) / 10


@pytest.fixture
def run():
    missing = np.where(np.arange(100) % 2, np.nan, 0.1 * np.sin(TIME))
    signals = {"speed": np.full(100, 20.0), "yaw_rate.tractor": 0.1 * np.sin(TIME), "yaw_rate.semitrailer": missing}
    return Record(time=TIME, signals=signals, reference={"sideslip.tractor": np.cos(TIME)}, name="<b>run</b>")


def test_pandas_has_all_channels_over_time(run):
    """It also makes columns of the signals; from a mapping that is not a dict it would make one column of names."""
    frame = run.to_pandas()
    assert frame.index.name == "time"
    np.testing.assert_array_equal(frame.index, run.time)
    assert list(frame) == [*run.signals, "reference.sideslip.tractor"]
    for other in (frame, pd.DataFrame(run.signals)):
        for name, values in run.signals.items():
            np.testing.assert_array_equal(other[name], values)


def test_a_plot_has_a_panel_for_each_quantity(run):
    plot = run.plot()
    assert [panel.y.title for panel in plot.panels] == ["speed, m/s", "yaw rate, deg/s", "sideslip, deg"]
    rates, (reference,) = plot.panels[1].items, plot.panels[2].items
    assert [line.name for line in rates] == ["tractor", "semitrailer"]
    np.testing.assert_allclose(rates[0].y, np.degrees(run.signals["yaw_rate.tractor"]))
    assert (reference.dash, reference.colour) == ("dash", rates[0].colour)  # one colour for each place
    assert {line.colour for line in rates} == {VERMILLION, "#009E73"}
    assert plot.panels[0].items[0].colour == BLUE


def test_the_table_of_a_notebook(run):
    page = run._repr_html_()
    assert "&lt;b&gt;run" in page
    assert not re.search("<script|http|<b>run", page)
    rows = [["".join(cell.itertext()) for cell in row] for row in ElementTree.fromstring(page).iter("tr")]
    assert rows[1] == ["speed", "m/s", "10 Hz", "20.0", "20.0", "", ""]
    assert [*rows[3][:3], rows[3][5]] == ["yaw_rate.semitrailer", "deg/s", "5 Hz", ""]  # complete at its own rate
    assert rows[4][0] == "reference.sideslip.tractor"
    many = Record(time=TIME, signals={"speed": np.full(100, np.nan)} | {f"wheel_speed.unit{k}": TIME for k in range(9)})
    assert "100 %" in many._repr_html_()
    assert repr(many).endswith("wheel_speed.unit6 and 2 more)")
