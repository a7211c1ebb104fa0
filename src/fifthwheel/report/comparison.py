"""A comparison of identifications: its page, and its result on a terminal and in the workbench."""

from pathlib import Path

import fifthwheel
from fifthwheel import pages
from fifthwheel.diagnose.comparison import Comparison
from fifthwheel.pages import page, terminal

EXPLANATION = (
    "Difference: from the first run, in units of the sigma of this difference. Beyond 2 sigma a difference is real "
    "with a probability of 95 %. Errors of vehicle file and model that both runs share cancel."
)


def write_comparison_page(path: Path, comparison: Comparison) -> None:
    """Write table, notes and plots of a comparison as one HTML file."""
    figures = [
        pages.CaptionedPlot(plot.panels[0].title, plot, group=name, path=("", "comparison", name))
        for name, plot in comparison.plots().items()
    ]
    blocks: list[pages.Block] = [
        pages.Heading("Estimates", key="estimates"),
        pages.Hint(EXPLANATION),
        _table(comparison, repeat=True),
        pages.Items(comparison.notes),
        pages.Heading("Plots", key="plots"),
        pages.Plots(figures),
    ]
    subtitle = f"{', '.join(comparison.runs)}; fifthwheel {fifthwheel.__version__}"
    page.write(path, pages.Document("Comparison", blocks, subtitle))


def show_comparison(comparison: Comparison, console: "terminal.Console | None" = None) -> None:
    """Print the estimates of each run with their differences from the first."""
    terminal.show(comparison_document(comparison), console)


def comparison_document(comparison: Comparison) -> pages.Document:
    """Headline, estimates and notes."""
    notes = pages.Items([*comparison.notes, EXPLANATION], "Notes")
    return pages.Document("Comparison", [pages.Headline(headline(comparison)), _table(comparison), notes])


def _table(comparison: Comparison, *, repeat: bool = False) -> pages.Table:
    """Estimates and differences; the name of a parameter is in its first row only, or in each."""
    first = comparison.runs[0]
    rows = [
        (pages.Code(name) if repeat or run == first else "", run, estimate, difference)
        for name, run, estimate, difference in comparison.rows()
    ]
    return pages.Table(
        ("Parameter|name", "Run|name", "Estimate>", "Difference>"), rows, label="Estimates of all results"
    )


def headline(comparison: Comparison) -> str:
    """How many parameters differ by more than two sigma."""
    known = [(p.name, d.sigmas) for p in comparison.parameters for d in p.differences if d and d.sigmas is not None]
    clear = dict.fromkeys(name for name, sigmas in known if abs(sigmas) > 2)
    names = f": {', '.join(clear)}" if clear else ""
    count = len({name for name, _ in known})
    return f"{len(clear)} of {count} parameters differ from {comparison.runs[0]} by more than 2 sigma{names}."
