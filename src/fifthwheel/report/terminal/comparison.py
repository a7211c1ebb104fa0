"""A comparison of identifications on a terminal."""

from typing import TYPE_CHECKING

from fifthwheel.diagnose.comparison import Comparison
from fifthwheel.report.terminal.page import TerminalPage
from fifthwheel.report.text.comparison import EXPLANATION, headline

if TYPE_CHECKING:
    from rich.console import Console


def show_comparison(comparison: Comparison, console: "Console | None" = None) -> None:
    """Print the estimates of each run with their differences from the first."""
    page = TerminalPage(console)
    page.headline(headline(comparison))
    first = comparison.runs[0]
    rows = [(name if run == first else "", run, *cells) for name, run, *cells in comparison.rows()]
    page.table(("Parameter", "Run", "Estimate>", "Difference>"), rows)
    page.lists(("Notes", [*comparison.notes, EXPLANATION]))
