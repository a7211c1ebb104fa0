"""The figures as files."""

import sys
from dataclasses import replace

import pytest

from fifthwheel.errors import FifthwheelError
from fifthwheel.report import write_report
from fifthwheel.report.figures import primitives, static, time_series
from tests.report.conftest import Page


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
    plot = time_series.state(result.states[1], result.records[1], "yaw_rate.tractor", "log")
    (path,) = static.save_figures(tmp_path, [plot], kind)
    assert path.read_bytes().startswith(start)
    assert path.parent.name == "states"


def test_the_same_figure_is_the_same_file(result, tmp_path):
    fit = result.identification.fits[0]
    plot = time_series.fit(fit, "log")
    first, second = static.save_figures(tmp_path, [plot, plot], "svg")
    assert first != second
    assert first.read_bytes() == second.read_bytes()
    assert len(static.draw(plot).axes) == 2


def test_a_file_shows_the_figure_of_the_page(result):
    history = result.identification.histories["one stage"]
    estimate = result.identification[history.names[0]]
    plot = time_series.history(history, estimate, "history")
    (axes,) = static.draw(plot).axes
    assert axes.get_ylabel() == plot.figure["layout"]["yaxis"]["title"]["text"]
    assert list(axes.get_ylim()) == plot.figure["layout"]["yaxis"]["range"]
    assert {line.get_label() for line in axes.lines} >= {"initial", "final", "estimate", time_series.FINAL_SIGMA}


@pytest.mark.parametrize(
    ("name", "expected"), [("a/b\\c:d", "a_b_c_d"), ("...", "_"), ("../up", "_up"), ("yaw_rate.tractor",) * 2]
)
def test_file_names(name, expected):
    assert static.file_name(name) == expected


def test_formats_that_cannot_be_written_are_refused(monkeypatch):
    with pytest.raises(FifthwheelError, match="--figures: expected svg, png, pdf"):
        static.checked_format("gif")
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(FifthwheelError, match=r"pip install 'fifthwheel\[figures\]'"):
        static.checked_format("svg")


def test_numbers_of_a_line_have_few_digits(result):
    record = result.records[0]
    line = primitives.line(record.time, record.signals["yaw_rate.tractor"], "x", "#000", rows=[])
    assert line["x"] == line["y"] == []
    states = result.states[0]
    plot = time_series.state(states, None, "yaw_rate.tractor", "log")
    assert all(len(str(abs(value)).replace(".", "")) <= 6 for value in plot.figure["data"][1]["y"] if value)
