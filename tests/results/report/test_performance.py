"""An assessment on a page, in the report of an identification, in words and on a terminal."""

import json
from dataclasses import replace

import pytest
from rich.console import Console

import fifthwheel as fw
from fifthwheel.base.pages.terminal import show
from fifthwheel.results.assess.lane_change import linear
from fifthwheel.results.assess.truck import Truck
from fifthwheel.results.report import assessment_document, write_assessment_report, write_report
from fifthwheel.results.report.assessment import explanations, headline, is_good
from tests.results.report.conftest import Page

TRUCK = fw.vehicle("cheng_cebon_2011")


@pytest.fixture(scope="module")
def assessment():
    """Cheap measures, with the lane change of one model in place of both."""
    run = linear(Truck(vehicle=TRUCK))
    return replace(fw.assess(TRUCK, cheap=True), runs={"linear": run, "nonlinear": run})


def with_rollover(assessment, value, probability):
    first, *others = assessment.measures
    (threshold,) = first.thresholds
    first = replace(first, value=value, thresholds=(replace(threshold, probability=probability),))
    return replace(assessment, measures=(first, *others))


def test_the_headline_says_what_is_missed_or_doubtful(assessment):
    good = replace(assessment, measures=assessment.measures[:1])
    assert is_good(good)
    assert headline(good).endswith(" at 88 km/h: meets all thresholds of the Australian PBS that are assessed.")
    doubtful = with_rollover(good, 0.36, 0.6)
    assert not is_good(doubtful)
    assert headline(doubtful).endswith(
        "that are assessed, but with its uncertainty not surely those of static rollover threshold."
    )
    assert headline(with_rollover(good, 0.3, 0.1)).endswith("misses static rollover threshold.")
    unstable = replace(good, unstable=0.185)
    assert not is_good(unstable)
    assert unstable.instability in str(unstable)
    broken = replace(with_rollover(good, 0.3, 0.1), unstable=1.0)
    assert headline(broken).endswith("km/h: the truck is unstable at this speed. It misses static rollover threshold.")
    assert headline(unstable).endswith(
        "assessed. About 18 % of the trucks within the uncertainty are unstable at this speed."
    )


def test_notes_name_the_assumed_dimensions_and_the_origin_of_sigma(assessment):
    notes = " ".join(explanations(assessment))
    for text in ("half track 1.000 ± 0.030 m", "rear overhang unknown", "the vehicle file", "by body"):
        assert text in notes


@pytest.mark.parametrize(
    ("linear", "nonlinear", "models"),
    [(0.5, 0.5, None), (0.5, 0.61, "(nonlinear)"), (0.7, None, "(linear)"), (0.7, 0.61, "(linear and nonlinear)")],
)
def test_a_note_explains_a_dynamic_threshold_above_the_static_one(assessment, linear, nonlinear, models):
    static = replace(assessment.measures[0], value=0.63, nonlinear=0.60)
    dynamic = replace(static, name="rollover_threshold_dynamic", value=linear, nonlinear=nonlinear)
    notes = [note for note in explanations(replace(assessment, measures=(static, dynamic))) if "above" in note]
    assert [models in note for note in notes] == ([True] if models else [])


def test_the_page_has_every_measure_and_every_figure(assessment, tmp_path):
    path = tmp_path / "assess.html"
    written = write_assessment_report(path, assessment, figures="svg")
    page = Page(path.read_text(encoding="utf-8"))
    assert page.open == []
    assert all(measure.title in page.text for measure in assessment)
    assert {file.stem for file in written} == {
        "paths",
        "lateral acceleration",
        "roll",
        "load transfer ratio",
        "low-speed turn",
        "roll in a steady turn",
    }


def test_a_line_has_the_same_colour_in_all_plots(assessment, tmp_path):
    path = tmp_path / "assess.html"
    write_assessment_report(path, assessment)
    traces = [t for plot in json.loads(Page(path.read_text(encoding="utf-8")).data("figures")) for t in plot["data"]]
    looks = {(t["name"].partition(",")[0], t["line"]["color"]) for t in traces if t["name"]}
    assert len(looks) == len({name for name, _ in looks}) >= 4


def test_the_report_of_an_identification_says_what_the_truck_will_do(result, tmp_path):
    performance = fw.assess(result.identification, cheap=True)
    path = tmp_path / "report.html"
    write_report(path, result.identification, result.records, title="truck", performance=performance)
    text = Page(path.read_text(encoding="utf-8")).text
    assert "What this truck will do" in text
    assert all(measure.text().split(" ")[0] in text for measure in performance)
    assert "Nonlinear" not in text


def test_a_terminal_without_unicode(assessment, capsys):
    show(assessment_document(assessment), Console(width=160, force_terminal=False))
    out = capsys.readouterr().out
    assert ">= 0.35 g" in out
    assert out.isascii()
