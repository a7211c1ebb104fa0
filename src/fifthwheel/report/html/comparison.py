"""The page of a comparison of identifications."""

from html import escape
from pathlib import Path

import fifthwheel
from fifthwheel.diagnose.comparison import Comparison
from fifthwheel.plots.plotly_figure import figure
from fifthwheel.report.figures.primitives import ReportPlot
from fifthwheel.report.html import tables
from fifthwheel.report.html.page import write_page
from fifthwheel.report.html.page_builder import CaptionedPlot, PageBuilder
from fifthwheel.report.text.comparison import EXPLANATION


def write_comparison_page(path: Path, comparison: Comparison) -> None:
    """Write table, notes and plots of a comparison as one HTML file."""
    page = PageBuilder("Comparison", f"{', '.join(comparison.runs)}; fifthwheel {fifthwheel.__version__}")
    page.heading("estimates", "Estimates")
    page.hint(EXPLANATION)
    page.html(table(comparison))
    page.html("<ul>", *[f"<li>{escape(note)}</li>" for note in comparison.notes], "</ul>")
    page.heading("plots", "Plots")
    plots = [
        CaptionedPlot(
            escape(plot.panels[0].title), "", ReportPlot(group=name, figure=figure(plot), name=("", "comparison", name))
        )
        for name, plot in comparison.plots().items()
    ]
    page.figures(plots)
    write_page(path, title="Comparison: fifthwheel", body=page.body(), plots=page.plots)


def table(comparison: Comparison) -> str:
    """The estimates with their differences, as HTML."""
    columns = [
        tables.Column("Parameter", "name"),
        tables.Column("Run", "name"),
        tables.Column("Estimate", "n", "Estimate: "),
        tables.Column("Difference", "n", "Difference: "),
    ]
    return tables.table(columns, [("", [tables.code(name), *map(escape, cells)]) for name, *cells in comparison.rows()])
