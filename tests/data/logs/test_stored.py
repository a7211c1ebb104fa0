"""Stored samples: the same as those of the file, plotted at any zoom with all extremes, and without some windows."""

from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from asammdf import MDF, Signal

from fifthwheel.base.errors import SignalError
from fifthwheel.data.logs.files import record_of
from fifthwheel.data.logs.readers import open_log
from fifthwheel.data.logs.signal_map import SignalMap
from fifthwheel.data.logs.source import Chunk, Column, LogSource
from fifthwheel.data.logs.stored import StoredLog, store_log
from fifthwheel.estimate.identify.knowledge.information import Occasion
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import get
from tests.data.logs.formats import stored

TIME = np.arange(600_000) / 1000.0


class _Table(LogSource):
    """Ten minutes at 1 kHz, in chunks, with a spike of one sample, a gap, and a damaged timestamp."""

    def __init__(self):
        columns = {"t": Column(name="t", unit="ms"), "y": Column(name="y", unit="V"), "text": Column(name="text")}
        super().__init__("run.csv", columns)

    def chunks(self, columns):
        time, values = 1000 * TIME, np.sin(TIME)
        time[50_000], values[123_456], values[300_000:310_000] = np.nan, 7.0, np.nan
        table = {"t": time, "y": values, "text": np.full(time.size, np.nan)}
        self.unusable["text"] = "text: no numbers"
        for start in range(0, time.size, 7001):
            part = {name: table[name][start : start + 7001] for name in self.columns if name in columns}
            yield Chunk(values=part, done=start / time.size)


@pytest.fixture(scope="module")
def long_log(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stored")
    store_log(_Table(), folder)
    return StoredLog(folder)


def test_the_date_of_a_recording_is_that_of_its_header(tmp_path):
    mdf, date = MDF(version="4.10"), datetime(2024, 5, 6, 7, 8, 9, tzinfo=UTC)
    mdf.header.start_time = date
    mdf.append(Signal(samples=np.ones(20), timestamps=1.0 + np.arange(20) / 10, name="speed", unit="m/s"))
    mdf.save(tmp_path / "run.mf4")
    (tmp_path / "samples").mkdir()
    with open_log(tmp_path / "run.mf4") as log:
        store_log(log, tmp_path / "samples")
        records = [record_of(source, name="run") for source in (log, StoredLog(tmp_path / "samples"))]
    for record in records:
        assert record.date == date
        assert record.cut(1.5, 2.5).started == date + timedelta(seconds=1.5)
        assert Occasion(date=datetime.now(UTC)).date_of([record]) == date + timedelta(seconds=1)


def test_every_zoom_shows_the_extremes_and_the_gap(long_log):
    for start, stop in ((0.0, 600.0), (100.0, 400.0), (123.0, 124.0), (123.456, 123.456)):
        time, values = long_log.window("y", start, stop)
        assert len(time) < 5000
        assert np.nanmax(values) == 7.0
        assert np.nanmin(values) == pytest.approx(-1.0, abs=0.5)
        assert (np.diff(time[np.isfinite(time)]) >= 0).all()
    time, values = long_log.window("y", 0.0, 600.0)
    assert not np.isfinite(values[(time > 300.5) & (time < 309.5)]).any()
    time, values = long_log.window("y", 200.0, 201.0)
    np.testing.assert_allclose(values, np.sin(time), atol=1e-12)
    assert time[0] <= 200.0
    assert time[-1] >= 201.0


def test_windows_are_left_out_by_the_time_of_the_log(long_log):
    signal_map = SignalMap.parse('time = {column = "t", rate = 1000}\nsignals = {speed = {column = "y", unit = "m/s"}}')
    kept = record_of(long_log, signal_map, name="run", exclude=[(1.0, 599.0), (-5.0, 0.25)]).time
    assert (kept.min(), kept.max()) == (0.251, 599.999)
    assert not ((kept >= 1.0) & (kept <= 599.0)).any()
    assert kept.size == 749 + 999


def test_windows_are_left_out_of_channels_with_their_own_time(tmp_path):
    record = simulate(get("cheng_cebon_2011"), count=1, seed=1)
    path, signal_map = stored(record, tmp_path, "drive.mf4")
    with open_log(path, signal_map.databases) as log:
        left = record_of(log, signal_map, name="run", exclude=[(2.0, 4.0)])
    inside = (left.time > 2.05) & (left.time < 3.95)
    assert not any(np.isfinite(values[inside]).any() for values in left.signals.values())
    assert np.isfinite(left.signals["speed"]).sum() > 100


def test_an_incomplete_folder_is_refused(tmp_path):
    with pytest.raises(OSError, match="index"):
        StoredLog(tmp_path)
    log = _Table()
    log.chunks = lambda columns: iter(())
    store_log(log, tmp_path)
    assert StoredLog(tmp_path).span() == (0.0, 1.0)
    with pytest.raises(SignalError, match="no column 'x'"):
        next(StoredLog(tmp_path).chunks(["x"]))


def test_parts_of_a_log(long_log):
    """Its axis, the samples in a span, the window with the spike, zooms outside of it."""
    axis = long_log.axis("")
    assert long_log.span() == (0.0, pytest.approx(599.999))
    assert (np.diff(axis) >= 0).all()
    assert axis[50_000] == axis[49_999]
    part = StoredLog(long_log._folder, (10.0, 12.0))
    values = np.concatenate([chunk.values["y"] for chunk in part.chunks(["y"])])
    np.testing.assert_array_equal(values, np.sin(TIME[10_000:12_001]))
    start, stop = long_log.most_active("y", 0.5)
    assert start <= 123.456 <= stop
    assert long_log.most_active("y", 1000.0) == long_log.span()
    for start, stop in ((-20.0, -10.0), (700.0, 800.0)):
        assert len(long_log.window("y", start, stop)[0]) <= 1
    assert np.isnan(long_log.window("text", 0.0, 600.0)[1]).all()


def test_an_axis_leaves_out_spikes_and_no_manoeuvre(tmp_path):
    for name, lasts in (("spike", 2), ("manoeuvre", 10)):
        values = np.sin(TIME)
        values[1000 : 1000 + lasts] = 40.0 + np.arange(lasts)
        path = tmp_path / f"{name}.csv"
        path.write_text(
            "time [s],y\n" + "\n".join(f"{t},{y:.4f}" for t, y in zip(TIME[:9000], values[:9000], strict=True))
        )
        (folder := tmp_path / name).mkdir()
        with open_log(path) as log:
            store_log(log, folder)
        visible = StoredLog(folder).range_without_spikes("y", 0.0, 9.0)
        assert (visible is None) == (name == "manoeuvre")
        assert visible is None or max(np.abs(visible)) < 1.3
