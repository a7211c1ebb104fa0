"""The reports of an identification and of states, one page each."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import fifthwheel
from fifthwheel.assess import Assessment
from fifthwheel.diagnose.run_summary import summarise_records, summarise_runs
from fifthwheel.identify import Identification
from fifthwheel.observe import States
from fifthwheel.record import Record
from fifthwheel.report.html import sections, tables
from fifthwheel.report.html.page import write_page
from fifthwheel.report.html.page_builder import PageBuilder
from fifthwheel.report.html.performance import section
from fifthwheel.report.html.sections import StateConditions
from fifthwheel.report.provenance import Provenance
from fifthwheel.report.text.conclusion import Conclusion, conclude_identification, conclude_states
from fifthwheel.report.text.words import counted

if TYPE_CHECKING:
    from fifthwheel.identify.design.assess import InformationAssessment


def write_report(
    path: str | Path,
    identification: Identification,
    records: Sequence[Record],
    states: Sequence[States] = (),
    *,
    title: str,
    conclusion: Conclusion | None = None,
    outlook: "InformationAssessment | None" = None,
    performance: Assessment | None = None,
    conditions: StateConditions | None = None,
    provenance: Provenance | None = None,
    figures: str | None = None,
) -> list[Path]:
    """Write the report of an identification as one HTML file.

    Args:
        records: the logs, including those that were only predicted; states and fits belong to them by name.
        states: of any of the records.
        title: usually the name of the vehicle.
        conclusion: by default it is drawn from the other arguments.
        outlook: information at the identified vehicle, for predicted improvements.
        performance: what the identified truck does.
        conditions: how the states were estimated.
        provenance: command, files and versions, to reproduce the result.
        figures: "svg", "png" or "pdf" to write every figure into the folder "figures" beside the page too.

    Returns:
        The figures that were written.

    Raises:
        FifthwheelError: the format of the figures is unknown, or matplotlib is not installed.

    Example:
        >>> import fifthwheel as fw
        >>> result = fw.Identification.load("result")  # doctest: +SKIP
        >>> fw.write_report("report.html", result, [record], title="truck")  # doctest: +SKIP
    """
    method = f"{identification.method} method, preset {identification.settings.preset}"
    page = PageBuilder(title, f"Identification: {method}, fifthwheel {identification.version}")
    page.html(tables.conclusion(conclusion or conclude_identification(identification, records, outlook, states)))
    sections.parameters(page, identification)
    sections.information(page, identification, outlook)
    sections.histories(page, identification)
    sections.fits(page, identification)
    if states:
        sections.states(page, states, records, conditions, identified=True)
    sections.consistency(page, states, identification.fits)
    if performance is not None:
        section(page, performance)
    page.heading("logs", "Logs and settings")
    _origin(page, tables.logs(records, summarise_runs(identification, records), identification), provenance)
    with page.folded("Settings"):
        unit = "iteration" if identification.method == "one-stage" else "round"
        page.hint(f"Estimated in {counted(identification.rounds, unit)}.")
        page.html(tables.settings(identification.settings.as_dict()))
    return _write(page, Path(path), figures)


def write_states_report(
    path: str | Path,
    states: Sequence[States],
    records: Sequence[Record],
    *,
    title: str,
    conclusion: Conclusion | None = None,
    conditions: StateConditions | None = None,
    provenance: Provenance | None = None,
    figures: str | None = None,
) -> list[Path]:
    """Write the report of the states of a given vehicle as one HTML file; arguments, result and errors as of
    `write_report`."""
    conclusion = conclusion or conclude_states(states, records)
    page = PageBuilder(title, f"States of a given truck, fifthwheel {fifthwheel.__version__}")
    page.html(tables.conclusion(conclusion))
    if states:
        sections.states(page, states, records, conditions, reliable=not conclusion.cautions)
        sections.consistency(page, states, ())
    page.heading("logs", "Logs")
    _origin(page, tables.logs(records, summarise_records(records)), provenance)
    return _write(page, Path(path), figures)


def _origin(page: PageBuilder, logs: str, provenance: Provenance | None) -> None:
    """The table of the logs, and how to reproduce the result."""
    page.hint("Lateral acceleration: largest magnitude of speed × yaw rate, averaged over 0.5 s.")
    page.html(logs)
    if provenance is not None:
        page.subheading("Reproduce this result")
        page.html(tables.provenance(provenance))


def _write(page: PageBuilder, path: Path, figures: str | None) -> list[Path]:
    """Write the figures if requested, then the page."""
    from fifthwheel.report.figures.static import save_figures

    drawn = [] if figures is None else save_figures(path.parent / "figures", page.plots, figures)
    write_page(path, title=f"{page.title}: fifthwheel", body=page.body(), plots=page.plots)
    return drawn
