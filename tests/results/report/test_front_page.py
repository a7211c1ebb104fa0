"""The first page of the report: what an engineer sends on."""

import re
from dataclasses import replace

import numpy as np
import pytest

import fifthwheel as fw
from fifthwheel.base.formatting import with_sigma
from fifthwheel.estimate.identify import Verdict
from fifthwheel.results.diagnose.summaries import summarise_runs
from fifthwheel.results.report import Provenance, front_page, write_report
from fifthwheel.results.report.front_page import CHARACTER, TRUCK_WIDTH, truck_drawing
from fifthwheel.truck.spoken_names import spoken
from tests.results.report.conftest import Page

SECTIONS = ["Parameters", "Measured and predicted", "States", "Appendix"]


@pytest.fixture(scope="module")
def text(result, tmp_path_factory) -> str:
    path, origin = (
        tmp_path_factory.mktemp("front") / "report.html",
        Provenance(note="J. <Smith>, dry", time="2026-03-01"),
    )
    performance = fw.assess(result.identification, cheap=True)
    identification, records = result.identification, result.records
    write_report(
        path, identification, records, result.states, title="my truck", performance=performance, provenance=origin
    )
    return path.read_text(encoding="utf-8")


def heads(html: str) -> list[str]:
    return re.findall("<h2[^>]*>(.*?)</h2>", html)


def test_note_date_headline_and_main_numbers_come_first(result, text):
    (cog,) = (e for e in result.identification.derived if e.name == "semitrailer.cog_height")
    words = ["my truck", "J. &lt;Smith&gt;, dry", "2026-03-01. Identification", "parameters are identified"]
    words += ["Trailer, CoG height", with_sigma(cog.value, cog.sigma, cog.unit), "Static rollover threshold"]
    words += ["Next steps", '<svg class="truck"']
    places = [text.index(word) for word in words]
    assert places == sorted(places)


def test_everything_but_three_sections_is_folded_in_the_appendix(text):
    assert heads(text) == SECTIONS
    main, appendix = text.split('<section id="appendix">')
    outside = re.sub("<details.*</details>", "", appendix.split("</section>")[0], flags=re.DOTALL)
    assert Page(f"<section>{outside.strip()}</section>").text.strip() == "Appendix"
    for title in ("What this truck will do", "Histories of the estimates", "All states", "Settings", "Sensor errors"):
        assert f"<summary>{title}" in appendix
        assert f"<summary>{title}" not in main


def test_the_table_has_plain_names_with_their_paths_and_a_picture(result, text):
    table = text[text.index('aria-label="Estimates"') : text.index("Notes, priors")]
    for e in (*result.identification.parameters, *result.identification.derived):
        assert f'title="{e.name}">{spoken(e.name)}<' in table
    assert table.count('<svg class="whisker"') == table.count("<tr") - 1
    inertia = next(e for e in result.identification.parameters if e.name == "semitrailer.yaw_inertia")
    prior = with_sigma(inertia.initial, inertia.prior, inertia.unit)
    assert f"<title>prior {prior}, vehicle file {with_sigma(inertia.initial, None, inertia.unit)}, estimate" in table


def test_an_estimate_that_is_not_identified_is_grey_in_table_and_drawing(result):
    first, *rest = result.identification.parameters
    missing = replace(first, verdict=Verdict.NOT_EXCITED)
    blocks = list(front_page.estimates(replace(result.identification, parameters=(missing, *rest))))
    (row,) = (row for row in blocks[1].rows if row[0].hint == first.name)
    assert row[5].row == "off"
    assert "#0072B2" not in row[6]
    assert "#0072B2" in blocks[1].rows[1][6]
    drawing = truck_drawing(result.identification.vehicle, [missing, *rest])
    assert f'class="off" x="{_x(drawing, "(not excited)")}"' in drawing
    assert with_sigma(first.value, first.sigma, first.unit).rpartition(" ")[0] not in drawing


def _x(drawing: str, line: str) -> str:
    return re.search(rf'x="(\d+)" y="\d+"><title>[^<]*</title>{re.escape(line)}<', drawing)[1]


def test_tyres_are_below_their_axles_and_other_numbers_at_their_unit(result):
    drawing = truck_drawing(result.identification.vehicle, result.identification.parameters)
    assert int(_x(drawing, "Trailer tyres")) < int(_x(drawing, "Drive tyres")) < int(_x(drawing, "Front tyres"))
    inertia = next(e for e in result.identification.parameters if e.name == "semitrailer.yaw_inertia")
    assert f"Yaw inertia {with_sigma(inertia.value, inertia.sigma, inertia.unit)}" in drawing


@pytest.mark.parametrize("name", ["cheng_cebon_2011", "a_double"])
def test_no_texts_of_a_drawing_overlap(result, name):
    truck, template = fw.vehicle(name), result.identification.parameters[0]
    wanted = ("cornering_stiffness", "yaw_inertia", "payload.height")
    values = {path: v for path, v in truck.parameters().items() if path.endswith(wanted)}
    estimates = [replace(template, name=path, value=v, sigma=0.05 * v) for path, v in values.items()]
    drawing = truck_drawing(truck, estimates)
    texts = re.findall(r'x="(-?\d+)" y="(-?\d+)"><title>[^<]*</title>([^<]*)<', drawing)
    assert len(texts) > len(estimates)
    for k, (x, y, line) in enumerate(texts):
        half = CHARACTER * len(line) / 2
        assert int(x) - half >= -1
        assert int(x) + half <= TRUCK_WIDTH + 1
        for x2, y2, other in texts[k + 1 :]:
            apart = abs(int(x) - int(x2)) >= half + CHARACTER * len(other) / 2 - 1
            assert apart or abs(int(y) - int(y2)) >= 15, (line, other)
    below = {int(y) for _, y, line in texts if line.endswith("tyres")}
    assert len(below) <= 3, "texts stay near their axles"


def test_what_was_driven(result):
    identification, record = result.identification, result.records[0]
    runs = summarise_runs(identification, [record])
    (beside,) = front_page.truck_and_runs(identification, [record], runs)
    (figure,) = beside.blocks[1].plots
    speed, lateral = (panel.items[0] for panel in figure.plot.panels)
    assert figure.group == f"log {record.name}", "it has the cursor of the log"
    assert np.allclose(speed.y, 3.6 * record.signals["speed"])
    assert np.nanmax(np.abs(lateral.y)) == pytest.approx(runs[0].acceleration, rel=0.02)
    assert f"up to {runs[0].acceleration:.2f} m/s²" in figure.note
    both = summarise_runs(identification, result.records)
    (beside,) = front_page.truck_and_runs(identification, result.records, both)
    (figure,) = beside.blocks[1].plots
    assert [line.name for line in figure.plot.panels[0].items] == [r.name for r in result.records]
    (beside,) = front_page.truck_and_runs(identification, [], [])
    assert len(beside.blocks) == 1


def test_without_fits_states_and_date_they_are_left_out(result, tmp_path):
    path, without = tmp_path / "report.html", replace(result.identification, fits=())
    write_report(path, without, [], [], title="truck", provenance=Provenance())
    text = path.read_text(encoding="utf-8")
    assert heads(text) == ["Parameters", "Appendix"]
    assert '<p class="subtitle">Identification: one-stage' in text
