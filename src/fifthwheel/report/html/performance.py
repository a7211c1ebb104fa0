"""The page of an assessment, and its section in the report of an identification."""

from html import escape
from pathlib import Path

import fifthwheel
from fifthwheel.assess import Assessment
from fifthwheel.assess.assessment import HEADS
from fifthwheel.assess.low_speed_turn import turn
from fifthwheel.assess.rollover import rollover
from fifthwheel.assess.truck import Truck
from fifthwheel.errors import FifthwheelError
from fifthwheel.report.figures import performance as figures_of
from fifthwheel.report.figures.static import save_figures
from fifthwheel.report.html import tables
from fifthwheel.report.html.page import write_page
from fifthwheel.report.html.page_builder import CaptionedPlot, PageBuilder
from fifthwheel.report.provenance import Provenance
from fifthwheel.report.text.performance import explain_assessment, headline, is_good

COLUMNS = tuple(tables.Column(head, "n" if k else "name", f"{head}: " if k else "") for k, head in enumerate(HEADS))


def write_assessment_report(
    path: Path, assessment: Assessment, *, provenance: Provenance | None = None, figures: str | None = None
) -> list[Path]:
    """Write the page of an assessment as one HTML file; returns the figures that were written.

    Args:
        provenance: command, files and versions, to reproduce the result.
        figures: "svg", "png" or "pdf" to write every figure into the folder "figures" beside the page too.

    Raises:
        FifthwheelError: the format of the figures is unknown, or matplotlib is not installed.
    """
    page = PageBuilder(assessment.title, f"What this truck does, fifthwheel {fifthwheel.__version__}")
    state = "verdict good" if is_good(assessment) else "verdict"
    page.html(f'<section class="{state}" id="verdict"><p class="headline">{escape(headline(assessment))}</p></section>')
    page.heading("measures", "Measures")
    page.html(measures(assessment))
    page.html("<ul>", *[f"<li>{escape(note)}</li>" for note in explain_assessment(assessment)], "</ul>")
    _manoeuvres(page, assessment)
    page.heading("uncertain", "Uncertain parameters")
    page.hint("Standard deviation of each uncertain parameter, SI. A parameter that is not listed is exact.")
    page.html(tables.settings({name: f"{sigma:.3g}" for name, sigma in assessment.uncertain.items()}))
    if provenance is not None:
        page.subheading("Reproduce this result")
        page.html(tables.provenance(provenance))
    drawn = [] if figures is None else save_figures(path.parent / "figures", page.plots, figures)
    write_page(path, title=f"{page.title}: fifthwheel", body=page.body(), plots=page.plots)
    return drawn


def section(page: PageBuilder, assessment: Assessment) -> None:
    """The section of the report of an identification: the measures, and how to get all of them."""
    page.heading("performance", "What this truck will do")
    half_track = f"{assessment.body.half_track:g} m ± {assessment.body.half_track_sigma:g} m"
    page.hint(
        f"Predicted by the linear model of the identified truck at {3.6 * assessment.speed:.0f} km/h. Sigma is that of "
        f"the parameters, with the half track taken as {half_track}. fifthwheel assess on this folder computes all "
        "measures, at any speed and payload, beside the nonlinear truck."
    )
    page.html(measures(assessment))
    for note in assessment.notes:
        page.hint(note)


def measures(assessment: Assessment) -> str:
    """The table of the measures; without the column of the nonlinear truck if it was not simulated."""
    simulated = any(m.nonlinear is not None for m in assessment)
    kept = [k for k, head in enumerate(HEADS) if simulated or head != "Nonlinear"]
    rows = [("", [escape(row[k]) for k in kept]) for row in assessment.rows()]
    return tables.table([COLUMNS[k] for k in kept], rows)


def _manoeuvres(page: PageBuilder, assessment: Assessment) -> None:
    """Pictures of the manoeuvres."""
    truck = Truck(vehicle=assessment.vehicle, body=assessment.body, speed=assessment.speed)
    if assessment.runs:
        page.heading("lane-change", "Lane change")
        page.hint("Single lane change of ISO 14791: one sine of 0.15 g at 0.4 Hz at the front axle. Dashed: nonlinear.")
        runs = assessment.runs
        page.figures(
            [
                CaptionedPlot(
                    "From above", "Front axle, and last axle of each unit.", figures_of.lane_change_paths(runs)
                ),
                CaptionedPlot("Lateral acceleration", "", figures_of.lane_change_acceleration(runs)),
                CaptionedPlot("Roll angle", "", figures_of.lane_change_roll(runs)),
                CaptionedPlot("Load transfer ratio", "", figures_of.load_transfer(runs)),
            ]
        )
    plots = []
    try:
        plots.append(CaptionedPlot("Low-speed turn of 90°", "", figures_of.turn_from_above(truck, turn(truck))))
        note = "A vertical line marks the lift of the inner wheels of an axle group."
        plots.append(CaptionedPlot("Roll in a steady turn", note, figures_of.roll_by_acceleration(rollover(truck))))
    except FifthwheelError:  # a note on the measure says why
        pass
    if plots:
        page.heading("turns", "Turns")
        page.figures(plots)
