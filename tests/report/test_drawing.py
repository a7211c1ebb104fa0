"""The figures as files."""

import builtins
from dataclasses import replace

import pytest

from fifthwheel.errors import FifthwheelError
from fifthwheel.report import drawing, figures, lines, write_report

from .conftest import Page


def test_every_figure_of_the_page_is_written(found, tmp_path):
    path = tmp_path / "report.html"
    few = replace(found.identification, fits=found.identification.fits[:1])
    written = write_report(path, few, found.records, [], title="truck", figures="svg")
    places = [i for i in Page(path.read_text(encoding="utf-8")).ids if i.startswith("plot")]
    assert len(written) == len(set(written)) == len(places)
    assert all(p.is_relative_to(tmp_path / "figures") and p.read_text().rstrip().endswith("</svg>") for p in written)
    history = tmp_path / "figures" / "parameters" / "history" / "tractor.front.cornering_stiffness.svg"
    assert history in written
    assert "kN/rad" in history.read_text()


@pytest.mark.parametrize(("kind", "start"), [("png", b"\x89PNG"), ("pdf", b"%PDF")])
def test_other_kinds(found, tmp_path, kind, start):
    plot = figures.state(found.states[1], found.records[1], "yaw_rate.tractor", "log", "rad/s")
    (path,) = drawing.save(tmp_path, [plot], kind)
    assert path.read_bytes().startswith(start)
    assert path.parent.name == "states"


def test_the_same_figure_is_the_same_file(found, tmp_path):
    fit = found.identification.fits[0]
    plot = figures.fit(fit, "log", "rad/s")
    first, second = drawing.save(tmp_path, [plot, plot], "svg")
    assert first != second
    assert first.read_bytes() == second.read_bytes()
    assert len(drawing.draw(plot).axes) == 2


def test_a_figure_shows_what_the_page_shows(found):
    trace = found.identification.traces["one stage"]
    estimate = found.identification[trace.names[0]]
    plot = figures.history(trace, estimate, "history")
    (axes,) = drawing.draw(plot).axes
    assert axes.get_ylabel() == plot.figure["layout"]["yaxis"]["title"]["text"]
    assert list(axes.get_ylim()) == plot.figure["layout"]["yaxis"]["range"]
    assert {line.get_label() for line in axes.lines} >= {"initial", "final", "estimate", figures.AGREED}


@pytest.mark.parametrize(
    ("name", "expected"), [("a/b\\c:d", "a_b_c_d"), ("...", "_"), ("../up", "_up"), ("yaw_rate.tractor",) * 2]
)
def test_names_are_plain(name, expected):
    assert drawing.plain(name) == expected


def test_what_cannot_be_drawn_says_why(monkeypatch):
    with pytest.raises(FifthwheelError, match="--figures: expected svg, png, pdf"):
        drawing.checked("gif")
    real = builtins.__import__

    def without(name, *args, **kwargs):
        if name == "matplotlib":
            raise ImportError(name)
        return real(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(FifthwheelError, match=r"pip install '\.\[figures\]'"):
        drawing.checked("svg")


def test_numbers_of_a_line_are_as_many_as_a_screen_shows(found):
    line = lines.line(found.records[0].time, found.records[0].signals["yaw_rate.tractor"], [], "x", "#000")
    assert line["x"] == line["y"] == []
    states = found.states[0]
    plot = figures.state(states, None, "yaw_rate.tractor", "log", "rad/s")
    assert all(len(str(abs(value)).replace(".", "")) <= 6 for value in plot.figure["data"][1]["y"] if value)
