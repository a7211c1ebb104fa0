"""The figures as files."""

from dataclasses import replace

import pytest

from fifthwheel.base.pages import CaptionedPlot, html
from fifthwheel.base.plots import Line, Panel, Plot, plotly_figure
from fifthwheel.estimate.identify.result import display
from fifthwheel.results.report import write_report
from tests.results.report.conftest import Page


def yaw_rate(states, record=None):
    plot = Plot(panels=[states.panel("yaw_rate.tractor", record)])
    return CaptionedPlot("yaw rate", plot, "log", (states.name, "states", "yaw_rate.tractor"))


def test_every_figure_of_the_page_is_written(result, tmp_path):
    path = tmp_path / "report.html"
    few = replace(result.identification, fits=result.identification.fits[:1])
    written = write_report(path, few, result.records, [], title="truck", figures="svg")
    places = [i for i in Page(path.read_text(encoding="utf-8")).ids if i.startswith("plot")]
    assert len(written) == len(set(written)) == len(places)
    assert all(p.is_relative_to(tmp_path / "figures") and p.read_text().rstrip().endswith("</svg>") for p in written)
    history = tmp_path / "figures" / "parameters" / "history" / "tractor.front.cornering_stiffness.svg"
    assert history in written
    assert "kN/rad" in history.read_text()


@pytest.mark.parametrize(("kind", "start"), [("png", b"\x89PNG"), ("pdf", b"%PDF")])
def test_other_kinds(result, tmp_path, kind, start):
    (path,) = html.save_images(tmp_path, [yaw_rate(result.states[1], result.records[1])], kind)
    assert path.read_bytes().startswith(start)
    assert path.parent.name == "states"


def test_the_same_figure_is_the_same_file(result, tmp_path):
    fit = result.identification.fits[0]
    figure = CaptionedPlot("fit", Plot(panels=[display.fit_panel(fit)] * 2), "log", ("log", "fit", fit.signal))
    first, second = html.save_images(tmp_path, [figure, figure], "svg")
    assert first != second
    assert first.read_bytes() == second.read_bytes()


def test_a_file_shows_the_figure_of_the_page(result):
    history = result.identification.histories["one stage"]
    estimate = result.identification[history.names[0]]
    plot = Plot(panels=[display.history_panel(history, estimate)])
    (axes,) = plot.to_matplotlib().axes
    layout = plotly_figure.figure(plot)["layout"]
    assert axes.get_ylabel() == layout["yaxis"]["title"]["text"]
    assert list(axes.get_ylim()) == layout["yaxis"]["range"]
    assert {line.get_label() for line in axes.lines} >= {"initial", "final", "estimate"}


def test_numbers_of_a_line_have_few_digits(result):
    (empty,) = plotly_figure.figure(Plot(panels=[Panel(items=[Line([], [])])]))["data"]
    assert empty["x"] == empty["y"] == []
    line = plotly_figure.figure(yaw_rate(result.states[0]).plot)["data"][1]
    assert all(len(str(abs(value)).replace(".", "")) <= 6 for value in line["y"] if value)
