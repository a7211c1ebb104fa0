"""A record in a notebook: pandas, plots, text and table."""

import copy
import pickle
import re
import sys
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest

from fifthwheel.base.errors import FifthwheelError, SignalError
from fifthwheel.base.plots.items import BLUE, VERMILLION
from fifthwheel.data.record import Record

TIME = np.arange(100) / 10


@pytest.fixture
def record():
    missing = np.where(np.arange(100) % 2, np.nan, 0.1 * np.sin(TIME))
    signals = {"speed": np.full(100, 20.0), "yaw_rate.tractor": 0.1 * np.sin(TIME), "yaw_rate.semitrailer": missing}
    return Record(time=TIME, signals=signals, reference={"sideslip.tractor": np.cos(TIME)}, name="<b>run</b>")


def test_pandas_has_all_channels_over_time(record):
    frame = record.to_pandas()
    assert frame.index.name == "time"
    np.testing.assert_array_equal(frame.index, record.time)
    assert list(frame) == [*record.signals, "reference.sideslip.tractor"]
    for name, values in record.signals.items():
        np.testing.assert_array_equal(frame[name], values)


def test_pandas_reads_the_signals_as_columns(record):
    """From a mapping that is not a dict it would make one column of names."""
    frame = pd.DataFrame(record.signals)
    assert frame.shape == (100, 3)
    np.testing.assert_array_equal(frame["speed"], record.signals["speed"])


def test_the_signals_cannot_be_changed(record):
    for change in (
        lambda signals: signals.__setitem__("speed", 1),
        lambda signals: signals.pop("speed"),
        lambda signals: signals.update(speed=1),
        lambda signals: signals.__ior__({"speed": 1}),
        lambda signals: signals.clear(),
    ):
        with pytest.raises(TypeError, match="read-only"):
            change(record.signals)
    assert pickle.loads(pickle.dumps(record)).signals.keys() == record.signals.keys()
    assert copy.deepcopy(record.signals).keys() == record.signals.keys()


def test_without_pandas(record, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(FifthwheelError, match=r"pip install 'fifthwheel\[pandas\]'"):
        record.to_pandas()


def test_a_plot_has_a_panel_for_each_quantity(record):
    plot = record.plot()
    assert [panel.y.title for panel in plot.panels] == ["speed, m/s", "yaw rate, deg/s", "sideslip, deg"]
    rates, (reference,) = plot.panels[1].items, plot.panels[2].items
    assert [line.name for line in rates] == ["tractor", "semitrailer"]
    np.testing.assert_allclose(rates[0].y, np.degrees(record.signals["yaw_rate.tractor"]))
    assert (reference.dash, reference.colour) == ("dash", rates[0].colour)  # one colour for each place
    assert {line.colour for line in rates} == {VERMILLION, "#009E73"}
    assert plot.panels[0].items[0].colour == BLUE
    plot.to_plotly()
    plot.to_matplotlib()


def test_a_plot_of_some_signals(record):
    assert len(record.plot("speed", "reference.sideslip.tractor").panels) == 2
    with pytest.raises(SignalError, match=r"yaw_rate\.tracktor: not in .*did you mean 'yaw_rate\.tractor'"):
        record.plot("yaw_rate.tracktor")


def test_the_text_is_short(record):
    assert repr(record).endswith("100 samples, 0 to 9.9 s at 10 Hz: speed, yaw_rate.tractor, yaw_rate.semitrailer)")
    many = Record(time=TIME, signals={f"wheel_speed.unit{k}": TIME for k in range(200)})
    assert repr(many).endswith("wheel_speed.unit7 and 192 more)")


def test_the_table_of_a_notebook(record):
    page = record._repr_html_()
    assert "<b>run</b>" not in page
    assert "&lt;b&gt;run" in page
    tree = ElementTree.fromstring(page)  # well formed
    rows = [["".join(cell.itertext()) for cell in row] for row in tree.iter("tr")]
    assert rows[0] == ["Signal", "Unit", "Rate", "Lowest", "Highest", "Missing", "Course"]
    assert rows[1] == ["speed", "m/s", "10 Hz", "20.0", "20.0", "", ""]
    assert rows[3][:3] == ["yaw_rate.semitrailer", "deg/s", "5 Hz"]
    assert rows[3][5] == ""  # complete at its own rate
    assert rows[2][4] == "5.73"
    assert rows[4][0] == "reference.sideslip.tractor"
    assert len(list(tree.iter("path"))) == 4
    assert not re.search("<script|http", page)


def test_a_table_of_a_channel_without_samples():
    record = Record(time=TIME, signals={"speed": np.full(100, np.nan)})
    assert "100 %" in record._repr_html_()
