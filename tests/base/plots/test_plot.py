"""A plot as data, and its two renderers."""

import json
import re
import sys

import numpy as np
import pytest

from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.plots import Area, Axis, Band, Bars, Guide, Label, Line, Panel, Plot, Points, Span, plotly_figure
from fifthwheel.base.plots.items import BLUE, CYCLE, VERMILLION, trimmed, visible_range

TIME = np.linspace(0, 10, 50)
SINE = np.sin(TIME)


def example(**changes):
    """Every kind of item, in two panels with one time axis."""
    upper = [
        Span(2, 3),
        Band(TIME, SINE - 0.1, SINE + 0.1, name="± 1 sigma"),
        Line(TIME, SINE, name="estimate"),
        Line(TIME, -SINE, name="reference", dash="dash"),
        Guide(y=0.5, text="limit"),
    ]
    lower = [
        Points([1, 2], [1, 2], y_sigma=[0.5, 0.2], name="points", marker="cross"),
        Bars([4, 5, 6], [1, 2, 1], name="bars"),
        Area([7, 8, 8], [0, 0, 1]),
        Label(7, 1, "corner"),
        Line(TIME, SINE, name="estimate"),
    ]
    panels = [
        Panel(items=upper, x=Axis(label="time", unit="s"), y=Axis(label="yaw rate", unit="deg/s"), height=2),
        Panel(items=lower, x=Axis(label="time", unit="s"), y=Axis(unit="1")),
    ]
    return Plot(**{"panels": panels, "title": "Example", **changes})


def test_both_renderers_draw_the_same_lines():
    plot = example()
    traces = {(t["name"], t.get("yaxis", "y")): t for t in plotly_figure.figure(plot)["data"]}
    upper, lower = plot.to_matplotlib().axes
    drawn = {line.get_label(): line for line in upper.lines}
    for name, values in (("estimate", SINE), ("reference", -SINE)):
        np.testing.assert_allclose(traces[name, "y"]["y"], values, atol=5e-4)  # rounded for the page
        np.testing.assert_array_equal(drawn[name].get_ydata(), values)
        assert drawn[name].get_color() == traces[name, "y"]["line"]["color"]
    assert traces["estimate", "y"]["line"]["color"] == BLUE
    assert traces["reference", "y"]["line"]["color"] == VERMILLION
    assert (upper.get_ylabel(), lower.get_ylabel()) == ("yaw rate, deg/s", "1")
    assert (upper.get_xlabel(), lower.get_xlabel()) == ("", "time, s")


def test_every_item_is_accepted_by_plotly_and_a_range_shows_all_finite_values():
    figure = example().to_plotly()
    assert (len(figure.data), len(figure.layout.shapes)) == (8, 2)
    assert figure.layout.shapes[1].label.text == "limit"
    json.loads(figure.to_json())
    assert visible_range([0.0, np.nan], 1.0) == pytest.approx((-0.06, 1.06))
    assert visible_range([np.inf]) == (-1.0, 1.0)
    assert trimmed(np.array([*range(101), np.nan]), 0.05) == pytest.approx([5, 95])
    panel = Panel(items=[Line(TIME, SINE)] * 8 + [Line(TIME, SINE, colour="#123456")])
    assert [colour for _, colour in panel.coloured()][6:] == [CYCLE[6], CYCLE[0], "#123456"]


def test_panels_have_a_common_time_axis():
    layout = plotly_figure.figure(example())["layout"]
    assert "xaxis2" not in layout
    assert layout["xaxis"]["anchor"] == "y2"
    (low, high), (bottom, top) = layout["yaxis2"]["domain"], layout["yaxis"]["domain"]
    assert low == pytest.approx(0)
    assert top == pytest.approx(1)
    assert top - bottom == pytest.approx(2 * (high - low))
    assert bottom > high
    panel = Panel(items=[Area([0, 4, 4, 0], [0, 0, 1, 1])], x=Axis(unit="s"), equal=True)
    plot = Plot(panels=[panel] * 3, columns=2)
    layout = plotly_figure.figure(plot)["layout"]
    assert layout["xaxis"]["domain"][1] <= layout["xaxis2"]["domain"][0]
    assert layout["yaxis3"]["domain"][1] < layout["yaxis"]["domain"][0]
    assert layout["yaxis"]["scaleanchor"] == "x"
    assert [axes.get_aspect() for axes in plot.to_matplotlib().axes] == [1, 1, 1]


def test_a_name_is_once_in_the_legend():
    traces = [t for t in plotly_figure.figure(example())["data"] if t["name"] == "estimate"]
    assert [t.get("showlegend", True) for t in traces] == [True, False]
    (legend,) = example().to_matplotlib().legends
    names = [text.get_text() for text in legend.get_texts()]
    assert len(names) == len(set(names)) == 5


def test_logarithmic_axes():
    f = np.logspace(-3, 1, 200)
    axis = Axis(label="frequency", unit="Hz", log=True, range=(1e-3, 10))
    plot = Plot(panels=[Panel(items=[Line(f, f**2)], x=axis, y=Axis(log=True))])
    figure = plotly_figure.figure(plot)
    assert figure["layout"]["xaxis"]["range"] == pytest.approx([-3, 1])
    assert figure["layout"]["yaxis"]["type"] == "log"
    np.testing.assert_allclose(figure["data"][0]["y"], f**2, rtol=1e-4)  # no value is rounded to 0
    (axes,) = plot.to_matplotlib().axes
    assert (axes.get_xscale(), axes.get_yscale(), axes.get_xlim()) == ("log", "log", (1e-3, 10))


def test_gaps_and_missing_values_interrupt_lines():
    time = np.concatenate([np.arange(0, 1, 0.1), np.arange(5, 6, 0.1)])
    values = np.where(np.arange(20) == 3, np.nan, time)
    for gaps, missing in ((True, 1), (False, 1)):
        (trace,) = plotly_figure.figure(Plot(panels=[Panel(items=[Line(time, values, gaps=gaps)])]))["data"]
        assert trace["y"].count(None) == missing
        at = trace["y"].index(None)
        assert trace["y"][at - 1] == pytest.approx(0.9 if gaps else 0.2)


@pytest.mark.slow
@pytest.mark.parametrize(("suffix", "start"), [(".svg", b"<?xml"), (".pdf", b"%PDF")])
def test_the_same_plot_is_the_same_file(tmp_path, suffix, start):
    first, second = tmp_path / f"a{suffix}", tmp_path / f"b{suffix}"
    example().save(first)
    example().save(str(second))
    assert first.read_bytes().startswith(start)
    assert first.read_bytes() == second.read_bytes()


def test_a_page_needs_no_network_and_a_small_image_has_its_size(tmp_path):
    example().save(tmp_path / "plot.html")
    text = (tmp_path / "plot.html").read_text(encoding="utf-8")
    assert "yaw rate, deg" in text
    assert not re.findall(r"<(?:script|link|img)[^>]*(?:src|href)=", text)
    example().save(tmp_path / "small.svg", size=(4.2, 3.0))
    assert 'width="302.4pt" height="216pt"' in (tmp_path / "small.svg").read_text()
    with pytest.raises(FifthwheelError, match=r"plot\.gif: expected .*\.png.*\.html"):
        example().save(tmp_path / "plot.gif")
    bundle = example()._repr_mimebundle_()
    assert bundle["text/plain"] == "Plot('Example', 2 panels)"
    assert bundle["image/svg+xml"].rstrip().endswith("</svg>")


def test_without_matplotlib(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(FifthwheelError, match=r"pip install 'fifthwheel\[figures\]'"):
        example().save(tmp_path / "plot.png")
    bundle = example()._repr_mimebundle_()
    assert "image/svg+xml" not in bundle
    assert "Plotly.newPlot" in bundle["text/html"]
    assert not re.findall(r"<script[^>]*src=", bundle["text/html"])


def test_arrays_of_different_lengths_are_refused():
    with pytest.raises(FifthwheelError, match=r"Line\.y: expected 3 values.*shape \(2,\)"):
        Line([1, 2, 3], [1, 2])
    with pytest.raises(FifthwheelError, match="either x or y"):
        Guide(x=1, y=1)
    with pytest.raises(FifthwheelError, match="at least one Panel"):
        Plot(panels=[])


def test_dates():
    days = np.array([np.datetime64("2026-01-05"), np.datetime64("2026-01-07")]).astype("datetime64[ms]").astype(float)
    plot = Plot(panels=[Panel(items=[Line(days, [1, 2]), Guide(x=days[1])], x=Axis(date=True))])
    figure = plot.to_plotly()
    assert figure.layout.xaxis.type == "date"
    assert list(figure.data[0].x) == [days[0], figure.layout.shapes[0].x0]
    (axes,) = plot.to_matplotlib().axes
    assert axes.xaxis.get_major_formatter()(days[0]) == "2026-01-05"


@pytest.mark.parametrize(
    ("values", "ticks"),
    [([0.02, 10.0], {"dtick": 1}), ([0.3, 2.0], {"ticktext": ["0.1", "0.2", "0.5", "1", "2", "5"]}), ([1.1, 1.4], {})],
)
def test_ticks_of_a_logarithmic_axis_have_their_whole_value(values, ticks):
    axis = Axis(log=True)
    plot = Plot(panels=[Panel(items=[Line([1.0, 2.0], values)], y=axis)])
    y = plotly_figure.figure(plot)["layout"]["yaxis"]
    assert {key: y[key] for key in ("dtick", "ticktext") if key in y} == ticks
