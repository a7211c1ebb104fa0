"""Plots of the room `plots` in a page."""

from typing import Any

from nicegui import ui

from fifthwheel.plots import Plot
from fifthwheel.plots.plotly_figure import figure

CONFIG = {"displaylogo": False, "responsive": True, "modeBarButtonsToRemove": ["lasso2d", "toImage"]}


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


def drawn(plot: Plot, *, height: int) -> dict[str, Any]:
    """A plot as `ui.plotly` takes it."""
    content = figure(plot)
    return content | {"layout": content["layout"] | {"height": height, "autosize": True}, "config": CONFIG}
