"""An assessment on a terminal."""

from typing import TYPE_CHECKING

from fifthwheel.assess import Assessment
from fifthwheel.assess.assessment import HEADS
from fifthwheel.report.terminal.page import TerminalPage
from fifthwheel.report.text.performance import explain_assessment, headline, is_good

if TYPE_CHECKING:
    from rich.console import Console


def show_assessment(assessment: Assessment, console: "Console | None" = None) -> None:
    """Print each measure with sigma, the nonlinear truck, the threshold and the probability that it is met."""
    page = TerminalPage(console)
    page.headline(headline(assessment), good=is_good(assessment))
    first, *others = HEADS
    page.table((first, *[f"{head}>" for head in others]), assessment.rows())
    page.lists(("Notes", explain_assessment(assessment)))
