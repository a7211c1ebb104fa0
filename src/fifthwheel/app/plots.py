"""Plots of the room `plots` in a page."""

from typing import Any

from nicegui import ui

from fifthwheel.plots import Plot
from fifthwheel.plots.plotly_figure import figure

_UNUSED_BUTTONS = ["zoom2d", "select2d", "lasso2d", "toImage"]
CONFIG = {"displaylogo": False, "responsive": True, "modeBarButtonsToRemove": _UNUSED_BUTTONS}


def show(plot: Plot, *, height: int = 300) -> ui.plotly:
    """Show a plot in the width of the page.

    Args:
        plot: what to show; its title is its label for screen readers.
        height: pixels.
    """
    element = ui.plotly(drawn(plot, height=height)).classes("w-full").style(f"height: {height}px")
    element.props["role"] = "img"
    element.props["aria-label"] = plot.title
    return element


def preload() -> None:
    """Let the browser load plotly.js before the first plot, while a log is read."""
    ui.plotly({"data": []}).style("position: absolute; width: 1px; height: 1px; visibility: hidden").props(
        'aria-hidden="true"'
    )


def drawn(plot: Plot, *, height: int) -> dict[str, Any]:
    """A plot as `ui.plotly` takes it."""
    content = figure(plot)
    return content | {"layout": content["layout"] | {"height": height, "autosize": True}, "config": CONFIG}
