"""The report of an identification or of states, on one page."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import fifthwheel
from fifthwheel.diagnose.run_summary import summarise_records, summarise_runs
from fifthwheel.report.html import sections, tables
from fifthwheel.report.html.page import write_page
from fifthwheel.report.html.page_builder import PageBuilder
from fifthwheel.report.html.sections import StateConditions
from fifthwheel.report.provenance import Provenance
from fifthwheel.report.text.conclusion import conclude_identification, conclude_states
from fifthwheel.report.text.words import counted

if TYPE_CHECKING:
    from fifthwheel.identify import Identification
    from fifthwheel.identify.design.assess import InformationAssessment
    from fifthwheel.observe import States
    from fifthwheel.record import Record


def write_report(
    path: Path,
    identification: "Identification | None",
    records: "Sequence[Record]",
    states: "Sequence[States]",
    *,
    title: str,
    outlook: "InformationAssessment | None" = None,
    given: StateConditions | None = None,
    provenance: Provenance | None = None,
    figures: str | None = None,
) -> list[Path]:
    """Write the report of an identification, or of states alone, as one HTML file.

    Args:
        identification: None for states alone.
        records: the logs, including those that were only predicted; states and fits belong to them by name.
        states: of any of the records.
        title: usually the name of the vehicle.
        outlook: information at the identified vehicle, for predicted improvements.
        given: how the states were estimated.
        provenance: command, files and versions, to reproduce the result.
        figures: "svg", "png" or "pdf" to write every figure into the folder "figures" beside the page too.

    Returns:
        The figures that were written.

    Raises:
        FifthwheelError: the format of the figures is unknown, or matplotlib is not installed.
    """
    from fifthwheel.report.figures.static import checked_format, save_figures

    if figures is not None:
        checked_format(figures)
    if identification is None:
        page = PageBuilder(title, f"States of a given truck, fifthwheel {fifthwheel.__version__}")
        conclusion = conclude_states(states, records)
        page.html(tables.conclusion(conclusion))
        if states:
            sections.states(page, states, records, given, reliable=not conclusion.cautions)
            sections.consistency(page, states, ())
        page.heading("logs", "Logs")
        logs = tables.logs(records, summarise_records(records))
    else:
        method = f"{identification.method} method, preset {identification.settings.preset}"
        page = PageBuilder(title, f"Identification: {method}, fifthwheel {identification.version}")
        page.html(tables.conclusion(conclude_identification(identification, records, outlook, states)))
        sections.parameters(page, identification)
        sections.information(page, identification, outlook)
        sections.histories(page, identification)
        sections.fits(page, identification)
        if states:
            sections.states(page, states, records, given, reliable=True, identified=True)
        sections.consistency(page, states, identification.fits)
        page.heading("logs", "Logs and settings")
        logs = tables.logs(records, summarise_runs(identification, records), identification)
    page.hint("Lateral acceleration: largest magnitude of speed × yaw rate, averaged over 0.5 s.")
    page.html(logs)
    if provenance is not None:
        page.subheading("Reproduce this result")
        page.html(tables.provenance(provenance))
    if identification is not None:
        with page.folded("Settings"):
            unit = "iteration" if identification.method == "one-stage" else "round"
            page.hint(f"Estimated in {counted(identification.rounds, unit)}.")
            page.html(tables.settings(identification.settings.as_dict()))
    write_page(Path(path), title=f"{title}: fifthwheel", body=page.body(), plots=page.plots)
    return [] if figures is None else save_figures(Path(path).parent / "figures", page.plots, figures)
