"""The report: everything that is known about a truck, on one page that opens without a network."""

from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import fifthwheel
from fifthwheel.report import facts, identified, observed, page, tables
from fifthwheel.report.conclusion import Conclusion
from fifthwheel.report.observed import Given
from fifthwheel.report.provenance import Provenance
from fifthwheel.report.sheet import Sheet
from fifthwheel.report.state_words import conclude_states
from fifthwheel.report.words import conclude

if TYPE_CHECKING:
    from fifthwheel.identify import Identification
    from fifthwheel.identify.outlook import Outlook
    from fifthwheel.logs import Record
    from fifthwheel.observe import States


def write_report(
    path: Path,
    identification: "Identification | None",
    records: "Sequence[Record]",
    states: "Sequence[States]",
    *,
    title: str,
    outlook: "Outlook | None" = None,
    given: Given | None = None,
    provenance: Provenance | None = None,
    figures: str | None = None,
) -> list[Path]:
    """Write an identification, or states alone, as one HTML file, whole or not at all.

    Args:
        identification: None when only states were estimated.
        records: the logs, those included that were only predicted; states and fits belong to them by name.
        states: of any of the records.
        title: usually the vehicle's name.
        outlook: at the identified vehicle, for what would help.
        given: how the states were estimated.
        provenance: command, files and versions, so that it can be run again.
        figures: "svg", "png" or "pdf" to write every figure into the folder figures beside the page too.

    Returns:
        The figures that were written.

    Raises:
        FifthwheelError: figures without matplotlib, or of another kind.
    """
    from fifthwheel.report.drawing import checked, save

    if figures is not None:
        checked(figures)
    sheet = Sheet()
    sheet.html(f"<h1>{escape(title)}</h1>")
    if identification is None:
        _states_alone(sheet, records, states, given)
    else:
        _identified(sheet, identification, records, states, outlook, given)
    _end(sheet, identification, records, provenance)
    page.write(Path(path), title=f"{title}: fifthwheel", body="\n".join(sheet.body), plots=sheet.plots)
    return [] if figures is None else save(Path(path).parent / "figures", sheet.plots, figures)


def _identified(
    sheet: Sheet,
    found: "Identification",
    records: "Sequence[Record]",
    states: "Sequence[States]",
    outlook: "Outlook | None",
    given: Given | None,
) -> None:
    sheet.say("subtitle", f"{_method(found)}, fifthwheel {found.version}")
    links = [("parameters", "Parameters"), ("told", "What the logs could tell"), ("histories", "Histories")]
    links = [*links, ("fits", "Measured and predicted"), *([("states", "States")] if states else [])]
    links += [("innovations", "Residuals and consistency"), ("logs", "Logs and settings")]
    if all(e.verdict == "held" for e in found.parameters):
        links.remove(("told", "What the logs could tell"))
    _begin(sheet, conclude(found, records, outlook, states), links)
    identified.parameters(sheet, found)
    identified.told(sheet, found, outlook)
    identified.histories(sheet, found)
    identified.fits(sheet, found)
    if states:
        observed.states(sheet, states, records, given, trusted=True, identified=True)
    observed.consistency(sheet, states, found.fits)


def _states_alone(sheet: Sheet, records: "Sequence[Record]", states: "Sequence[States]", given: Given | None) -> None:
    sheet.say("subtitle", f"States of a known truck, fifthwheel {fifthwheel.__version__}")
    told = conclude_states(states, records)
    links = [("states", "States"), ("innovations", "Residuals and consistency")] if states else []
    _begin(sheet, told, [*links, ("logs", "Logs")])
    if states:
        observed.states(sheet, states, records, given, trusted=not told.cautions)
        observed.consistency(sheet, states, ())


def _begin(sheet: Sheet, told: Conclusion, links: Sequence[tuple[str, str]]) -> None:
    """The way to every section, and the verdict."""
    sheet.html("<nav>" + "".join(f'<a href="#{key}">{text}</a>' for key, text in links) + "</nav>")
    sheet.html(tables.conclusion(told))


def _end(
    sheet: Sheet,
    found: "Identification | None",
    records: "Sequence[Record]",
    provenance: Provenance | None,
) -> None:
    """What was used of each log, and all that it takes to run it again."""
    sheet.heading("logs", "Logs" if found is None else "Logs and settings")
    sheet.hint("Sideways: speed times yaw rate, held for half a second, at its greatest.")
    if found is None:
        sheet.html(tables.plain_logs(records, facts.drives(records, None, {}, 5.0)))
    else:
        sheet.html(tables.logs(found, records, facts.driven(found, records)))
    if provenance is not None:
        sheet.part("To run it again")
        sheet.html(tables.provenance(provenance))
    if found is not None:
        with sheet.folded("Settings"):
            word = "steps" if found.method == "one-stage" else "rounds"
            sheet.hint(f"fifthwheel {found.version}, {_method(found)}; {found.rounds} {word}.")
            sheet.html(tables.settings(found.settings.as_dict()))


def _method(found: "Identification") -> str:
    return f"Identified {found.method}, preset {found.settings.preset}"
