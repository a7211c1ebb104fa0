"""The report of an assessment, and the evidence."""

import hashlib
import json
import re
from dataclasses import replace

import pytest

import fifthwheel as fw
from fifthwheel.results.assess.lane_change import linear
from fifthwheel.results.assess.truck import Truck
from fifthwheel.results.report import write_assessment_report
from fifthwheel.results.report.assessment import (
    SHOWN_FILES,
    TruckEvidence,
    explanations,
    headline,
    is_good,
    write_evidence,
)
from fifthwheel.results.report.provenance import FileUsed, Provenance
from fifthwheel.truck import get
from tests.results.report.conftest import Page
from tests.results.report.test_browser import CHROMIUM, browse

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


@pytest.mark.slow
def test_the_page_has_every_measure_and_every_figure(assessment, tmp_path):
    path = tmp_path / "assess.html"
    written = write_assessment_report(path, assessment, figures="svg")
    page = Page(path.read_text(encoding="utf-8"))
    assert all(measure.title in page.text for measure in assessment)
    figures = {"paths", "lateral acceleration", "roll", "load transfer ratio", "low-speed turn"}
    assert {file.stem for file in written} == figures | {"roll in a steady turn"}
    traces = [t for plot in json.loads(page.data("figures")) for t in plot["data"]]  # a line has one colour in all
    looks = {(t["name"].partition(",")[0], t["line"]["color"]) for t in traces if t["name"]}
    assert len(looks) == len({name for name, _ in looks}) >= 4


HEIGHT = "semitrailer.payload.height"
DIGESTS = [hashlib.sha256(bytes([k])).hexdigest() for k in range(12)]
PROVENANCE = Provenance(
    command="fifthwheel assess found -o out",
    time="2026-03-01",
    files=tuple(FileUsed(path=f"{k}.csv", size=k, sha256=digest) for k, digest in enumerate(DIGESTS)),
)


@pytest.fixture(scope="module")
def evidence(result):
    """Cheap measures, of which the first misses a threshold that is not confirmed."""
    identification = result.identification
    assessment = fw.assess(identification, cheap=True)
    first, *others = assessment.measures
    threshold = replace(first.thresholds[0], confirmed=False, value=9.0, probability=0.0)
    assessment = replace(assessment, measures=(replace(first, thresholds=(threshold,)), *others))
    return TruckEvidence(
        assessment=assessment, identification=identification, conclusion=["All <good>."], provenance=PROVENANCE
    )


def written(evidence, folder) -> Page:
    contents = folder / "assessment.json"
    contents.write_text(json.dumps(evidence.as_dict()), encoding="utf-8")
    write_evidence(folder / "evidence.html", evidence, contents)
    return Page((folder / "evidence.html").read_text(encoding="utf-8"))


def test_the_json_has_every_estimate_with_sigma_and_verdict(evidence):
    contents = json.loads(json.dumps(evidence.as_dict()))
    rows = {row["name"]: row for row in contents["parameters"]}
    for e in (*evidence.identification.parameters, *evidence.identification.derived):
        assert (rows[e.name]["value"], rows[e.name]["sigma"], rows[e.name]["verdict"]) == (e.value, e.sigma, e.verdict)
    assert rows.keys() >= evidence.assessment.uncertain.keys() - {"half_track"}
    assert rows["tractor.front.roll_stiffness"]["verdict"] == "assumed"
    assert [file["sha256"] for file in contents["provenance"]["files"]] == DIGESTS
    assert contents["measures"][0]["thresholds"][0]["source"].endswith("10 November 2008")


def test_a_changed_estimate_is_stated_and_what_follows_from_it_is_left_out(result):
    assessment = fw.assess(result.identification, cheap=True, changes={HEIGHT: 2.0}, sigmas={HEIGHT: 0.1})
    found = TruckEvidence(assessment=assessment, identification=result.identification).parameters()
    rows = {row.name: row for row in found}
    assert found.index(rows[HEIGHT]) < next(k for k, row in enumerate(found) if row.verdict == "assumed")
    assert rows[HEIGHT][1:] == (2.0, 0.1, "m", "stated")
    assert "semitrailer.cog_height" not in rows
    assert rows["semitrailer.cornering_stiffness"].verdict == "converged"
    truck = get("cheng_cebon_2011").with_stated({HEIGHT: 0.05})  # a vehicle has no estimates
    rows = TruckEvidence(assessment=fw.assess(truck, cheap=True)).parameters()
    assert (rows[0].name, rows[0].sigma, rows[0].verdict) == (HEIGHT, 0.05, "stated")
    assert {row.verdict for row in rows[1:]} == {"assumed"}


def test_the_page_has_measures_thresholds_digests_and_what_it_leaves_out(evidence, tmp_path):
    page = written(evidence, tmp_path)
    own = hashlib.sha256((tmp_path / "assessment.json").read_bytes()).hexdigest()
    left_out = f"{len(evidence.parameters()) - 20} further parameters and {13 - SHOWN_FILES} further files"
    for text in (*DIGESTS[: SHOWN_FILES - 1], own, "All <good>.", left_out, "(not confirmed)", "10 November 2008"):
        assert text in page.text
    assert DIGESTS[SHOWN_FILES - 1] not in page.text
    assert all(measure.title in page.text for measure in evidence.assessment)
    assert "Nonlinear" not in page.text
    assert "missed" in page.text


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="no chromium on the PATH")
def test_it_prints_on_one_sheet_of_a4(evidence, tmp_path):
    """Also with as many measures as a long combination can have."""
    measures = (evidence.assessment.measures * 28)[:28]
    longer = replace(evidence.assessment, measures=measures)
    evidence = replace(evidence, assessment=longer, conclusion=["A caution. " * 20])
    written(evidence, tmp_path)
    pdf = tmp_path / "evidence.pdf"
    page = (tmp_path / "evidence.html").as_uri()
    browse(tmp_path / "profile", "--no-pdf-header-footer", f"--print-to-pdf={pdf}", page)
    data = pdf.read_bytes()
    assert len(re.findall(rb"/Type\s*/Page\b", data)) == 1
    width, height = map(float, re.search(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", data).groups())
    assert (width / 72 * 25.4, height / 72 * 25.4) == pytest.approx((210, 297), abs=1)
