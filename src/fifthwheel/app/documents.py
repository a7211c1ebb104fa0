"""The renderer of documents and plots for the pages of the workbench."""

from typing import Any

from nicegui import ui

from fifthwheel import pages
from fifthwheel.app import layout
from fifthwheel.pages import html
from fifthwheel.plots import Plot
from fifthwheel.plots.plotly_figure import figure

_UNUSED_BUTTONS = ["zoom2d", "select2d", "lasso2d", "toImage"]
_CLEAR = "rgba(0,0,0,0)"
CONFIG = {"displaylogo": False, "responsive": True, "modeBarButtonsToRemove": _UNUSED_BUTTONS}


def show(*blocks: pages.Block) -> None:
    """Show blocks of a document in the page; a wide table scrolls."""
    for block in blocks:
        match block:
            case pages.Headline():
                ui.label(block.text).classes("text-weight-bold").props("role=status")
                for column in block.columns:
                    show(*column)
            case pages.Heading():
                layout.heading(block.title)
            case pages.Items():
                if block.lines and block.title:
                    layout.heading(block.title)
                if block.lines:
                    ui.html(html.blocks([pages.Items(block.lines)]), sanitize=False).classes("fw-list")
            case pages.Folded():
                with ui.expansion(block.summary).classes("w-full"):
                    show(*block.blocks)
            case pages.Beside():
                show(*block.blocks)
            case pages.Plots():
                for each in block.plots:
                    show_plot(each.plot)
            case _:
                ui.html(html.blocks([block]), sanitize=False).classes("fw-scroll fw-table")


def show_plot(plot: Plot, *, height: int = 300, label: str = "") -> ui.plotly:
    """Show a plot in the width of the page; the label is for screen readers, by default the title."""
    element = ui.plotly(drawn(plot, height=height)).classes("w-full").style(f"height: {height}px")
    element.props["role"] = "img"
    element.props["aria-label"] = label or plot.title
    return element


def preload() -> None:
    """Let the browser load plotly.js before the first plot, while a log is read."""
    ui.plotly({"data": []}).style("position: absolute; width: 1px; height: 1px; visibility: hidden").props(
        'aria-hidden="true"'
    )


def drawn(plot: Plot, *, height: int) -> dict[str, Any]:
    """A plot as `ui.plotly` takes it."""
    content = figure(plot)
    own = {"height": height, "autosize": True, "paper_bgcolor": _CLEAR, "plot_bgcolor": _CLEAR}
    return content | {"layout": content["layout"] | own, "config": CONFIG}
