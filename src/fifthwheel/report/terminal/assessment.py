"""The information in logs on a terminal: which parameters are identifiable, what would help, errors in the logs."""

from typing import TYPE_CHECKING

from fifthwheel.formatting import relative, with_sigma
from fifthwheel.report.terminal.page import COLOURS, TerminalPage
from fifthwheel.report.text import information
from fifthwheel.report.text.words import spoken_verdict

if TYPE_CHECKING:
    from rich.console import Console

    from fifthwheel.identify.design.assess import InformationAssessment, ParameterAssessment


def show_assessment(outlook: "InformationAssessment", console: "Console | None" = None) -> None:
    """Print the predicted sigma and verdict of each parameter, what would help, and what is wrong with the logs."""
    page, errors = TerminalPage(console), information.errors(outlook)
    complete = all(map(information.is_identifiable, outlook.parameters)) and not errors
    page.headline(information.headline(outlook), good=complete)
    page.lists(("Errors in the logs", errors))
    page.table(
        ("Parameter", "Value>", "Prior\nsigma>", "Predicted\nsigma>", "Verdict"),
        map(_row, outlook.parameters),
        [COLOURS[p.verdict] for p in outlook.parameters],
    )
    page.lists(
        ("What would help", information.improvements(outlook)),
        ("Strongly correlated", information.separation(outlook)),
        ("Cautions", information.warnings(outlook)),
        ("Notes", [*outlook.notes, *information.notes(outlook)]),
    )


def _row(p: "ParameterAssessment") -> tuple[str, ...]:
    sigma = f"±{relative(p.value, p.sigma)}" if information.is_identifiable(p) else "–"
    return (
        p.name,
        with_sigma(p.value, None, p.unit),
        f"±{relative(p.value, p.prior)}",
        sigma,
        spoken_verdict(p.verdict, predicted=True),
    )
