"""The page: complete and self-contained."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from fifthwheel.base.formatting import with_sigma
from fifthwheel.base.plots import Plot, downsample, plotly_figure
from fifthwheel.base.plots.items import rgba
from fifthwheel.estimate.identify.result import display
from fifthwheel.estimate.identify.verdict import Verdict
from fifthwheel.estimate.observe import Status
from fifthwheel.estimate.observe.states import SHADES
from fifthwheel.results.report import write_report, write_states_report
from fifthwheel.results.report.conclusion import MARKS, spoken_verdict
from fifthwheel.results.report.identification import _uncertain_numbers
from fifthwheel.results.report.states import innovation_figure
from tests.results.report.conftest import NASTY, Page


@pytest.fixture(scope="module")
def text(result, tmp_path_factory) -> str:
    path = tmp_path_factory.mktemp("report") / "report.html"
    write_report(path, result.identification, result.records, result.states, title="my <truck> & co")
    assert [p.name for p in path.parent.iterdir()] == ["report.html"]
    return path.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def parsed(text) -> Page:
    return Page(text)


@pytest.fixture(scope="module")
def plots(parsed) -> list:
    return drawn(parsed)


def drawn(parsed: Page) -> list:
    """The plots of the page."""
    return json.loads(parsed.data("figures"), parse_constant=pytest.fail)


def of_section(plots: list, *sections: str) -> list:
    """The plots of these sections."""
    return [plot for plot in plots if plot["name"][1] in sections]


def test_every_value_is_there(result, parsed):
    text = parsed.text.replace("\u00a0", " ")
    for estimate in (*result.identification.parameters, *result.identification.derived):
        assert estimate.name in parsed.text
        assert with_sigma(estimate.value, estimate.sigma, estimate.unit) in text
    for error in result.identification.sensors:
        assert with_sigma(error.value, error.sigma, error.unit) in parsed.text
    assert result.identification.version in parsed.text
    assert "process_noise" in parsed.text


def test_every_uncertain_number_has_a_sigma_and_a_prior(result):
    """The scale of all masses as the mass of all units; numbers of the model alone have no value."""
    identification = result.identification
    (folded,) = _uncertain_numbers(identification)
    rows = {getattr(row[0], "hint", ""): row for row in folded.blocks[1].rows}
    assert [hint for hint, row in rows.items() if "–" in row[2:]] == []
    (scale,) = [row for hint, row in rows.items() if hint.startswith("mass_scale")]
    gross = sum(unit.mass for unit in identification.vehicle.units)
    assert float(scale[1].replace("\u202f", "")) == pytest.approx(gross, rel=1e-3)
    assert scale[3] == "kg"
    assert scale[4].startswith("40\u202f650 ± 810")
    assert rows["yaw_rate.tractor.delay"][3:5] == ("ms", "0 ± 10")


def test_names_are_escaped_links_lead_somewhere_and_no_network_is_needed(text, parsed, plots):
    assert NASTY in parsed.text
    assert "my <truck> & co" in parsed.text
    assert "<truck>" not in text
    assert "bend <b>" not in text.replace(parsed.scripts["figures"], "")
    assert {link for _, link in parsed.links if not link.startswith("#")} == set()
    own = text
    for script in parsed.scripts.values():
        own = own.replace(script, "")
    assert not re.search(r"https?://|url\(|@import", own)
    assert "default-src &#x27;none&#x27;" in text
    assert any("Plotly.newPlot" in script for script in parsed.scripts.values())
    assert b"plotly.js v" in parsed.data("library")[:200]
    assert len(parsed.ids) == len(set(parsed.ids))
    assert {link[1:] for _, link in parsed.links} <= set(parsed.ids)
    assert [f"plot{k}" for k in range(len(plots))] == [i for i in parsed.ids if i.startswith("plot")]


def test_every_history_channel_and_state_has_a_plot(result, plots):
    identification = result.identification
    histories = sum(len(h.names) for h in identification.histories.values())
    assert len(of_section(plots, "history")) == histories == 6
    for name, states in zip((r.name for r in result.records), result.states, strict=True):
        own = [plot for plot in plots if plot["group"] == f"log {name}"]
        assert len(of_section(own, "states")) == 1 + len(states.values)
        assert len(of_section(own, "innovations")) == len(states.innovation)
        (fit,), (residual,) = of_section(own, "fit"), of_section(own, "residual")
        channels = [f for f in identification.fits if f.log == name]
        axes = [key for key in fit["layout"] if key.startswith("yaxis")]
        assert len(axes) == len(channels) == len([key for key in residual["layout"] if key.startswith("yaxis")])
        assert [key for key in fit["layout"] if key.startswith("xaxis")] == ["xaxis"]


def test_lines_are_short_and_histories_have_band_levels_and_passes(result, plots):
    for line in (line for plot in plots for line in plot["data"]):
        assert len(line["x"]) == len(line["y"]) <= downsample.MAX_POINTS + downsample.MAX_GAPS + 2
    history, plot = result.identification.histories["one stage"], of_section(plots, "history")[0]
    names = [line["name"] for line in plot["data"]]
    assert names == [display.HISTORY_BAND, "initial", "final", "estimate"]
    assert len(plot["layout"]["shapes"]) == history.passes - 1
    estimate = result.identification[history.names[0]]
    assert plot["data"][2]["y"][0] == pytest.approx(estimate.value / 1e3)
    assert plot["layout"]["yaxis"]["title"]["text"] == "kN/rad"


def test_status_is_shaded_rejected_samples_are_marked_and_gaps_are_null(result):
    states = result.states[1]
    assert (states.status == Status.TOO_SLOW).any()
    figure = plotly_figure.figure(innovation_figure(states, "yaw_rate.tractor").plot)
    colours = [shape.get("fillcolor") for shape in figure["layout"]["shapes"]]
    assert rgba(*SHADES[Status.TOO_SLOW]) in colours
    assert rgba(*SHADES[Status.COASTING]) in colours
    marks = figure["data"][1]
    assert marks["name"] == "rejected"
    assert 8.0 in marks["x"]
    panel = result.states[1].panel("yaw_rate.tractor", result.records[1])
    lines = plotly_figure.figure(Plot(panels=[panel]))["data"]
    assert None in next(line for line in lines if line["name"] == "estimate")["y"]
    assert not any(line["y"].count(None) > 5 for line in lines)


def test_states_alone(result, tmp_path):
    path = tmp_path / "report.html"
    write_states_report(path, result.states, result.records, title="truck")
    parsed = Page(path.read_text(encoding="utf-8"))
    assert "The states are reliable in" in parsed.text
    assert "too slow for the model" in parsed.text
    assert "rms difference from the reference" in parsed.text
    assert "parameters" not in parsed.ids
    plots = drawn(parsed)
    assert len(of_section(plots, "states")) == sum(1 + len(s.values) for s in result.states)
    assert len(of_section(plots, "innovations")) == sum(len(s.innovation) for s in result.states)


def test_a_channel_without_samples(result, tmp_path):
    states, nothing = result.states[0], np.full(len(result.states[0].time), np.nan)
    empty = {
        field: dict.fromkeys(getattr(states, field), nothing)
        for field in ("values", "sigma", "innovation", "innovation_sigma")
    }
    empty["accepted"] = {name: np.zeros(len(nothing), dtype=bool) for name in states.innovation}
    silent = replace(states, **empty, status=np.full(len(nothing), Status.INPUT_MISSING, dtype=np.int8))
    write_states_report(tmp_path / "report.html", [silent], result.records, title="truck")
    parsed = Page((tmp_path / "report.html").read_text(encoding="utf-8"))
    assert "never estimated" in parsed.text
    assert "never used" in parsed.text
    drawn(parsed)


def test_every_verdict_has_its_mark(every_verdict, result, tmp_path):
    path = tmp_path / "report.html"
    write_report(path, every_verdict, result.records, [], title="truck")
    text = path.read_text(encoding="utf-8")
    assert set(MARKS) == set(Verdict)
    for name, mark in MARKS.items():
        assert f'<span class="{name}"><span class="mark">{mark}</span>{spoken_verdict(name)}</span>' in text


@pytest.mark.slow
def test_a_prediction_that_diverges(result, tmp_path):
    fits = []
    for fit, value in zip(result.identification.fits, (np.inf, 1e200), strict=False):
        predicted = fit.predicted.copy()
        predicted[100:] = value
        fits.append(replace(fit, predicted=predicted, explained=-np.inf if value == np.inf else np.nan, rms=value))
    write_report(
        tmp_path / "report.html", replace(result.identification, fits=tuple(fits)), result.records, [], title="truck"
    )
    parsed = Page((tmp_path / "report.html").read_text(encoding="utf-8"))
    drawn(parsed)
    assert "explained" in parsed.text


@pytest.mark.slow
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
