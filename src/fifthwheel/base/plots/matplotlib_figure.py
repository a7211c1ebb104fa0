"""A plot drawn by matplotlib, for images and print."""

from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import numpy as np

from fifthwheel.base.lazy import require
from fifthwheel.base.plots import downsample
from fifthwheel.base.plots.items import (
    GRID,
    Area,
    Axis,
    Band,
    Bars,
    Guide,
    Item,
    Label,
    Line,
    Panel,
    PanelGrid,
    Points,
    as_array,
    rgb,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH = 6.4
"""Inches."""
HEIGHTS = {1: 3.4, 2: 4.6}
"""Inches, by the number of rows; more rows have `ROW_HEIGHT` each."""
ROW_HEIGHT = 1.7
NARROW = 5.0
"""Width of a figure, inches, below which title and legend are smaller."""
DASHES: dict[str, Any] = {"solid": "-", "dash": (0, (5, 3)), "dot": (0, (1, 2))}
MARKERS = {"circle": "o", "cross": "x", "diamond": "D", "square": "s"}
POINTS = 0.7
"""Width in points of a line of one pixel."""
STYLE: Any = {
    "font.size": 9,
    "svg.hashsalt": "fifthwheel",
    "svg.fonttype": "none",
    "axes.grid": True,
    "grid.color": GRID,
    "axes.axisbelow": True,
}


def figure(plot: PanelGrid, size: tuple[float, float] | None = None) -> "Figure":
    """The plot as a figure of matplotlib that no window or global state belongs to; its size in inches."""
    mpl = require("matplotlib", "figures")
    from matplotlib.figure import Figure

    with mpl.rc_context(STYLE):
        size = size or (WIDTH, HEIGHTS.get(plot.rows, ROW_HEIGHT * plot.rows))
        canvas = Figure(figsize=size, layout="constrained")
        if plot.title:
            canvas.suptitle(plot.title, fontsize=8 if size[0] < NARROW else 10)
        axes = canvas.subplots(
            plot.rows, plot.columns, squeeze=False, sharex=plot.shared_x, height_ratios=plot.row_heights()
        )
        for k, (panel, drawn) in enumerate(zip(plot.panels, axes.flat, strict=False)):
            _draw_panel(panel, drawn)
            if not plot.one_x_axis or k == len(plot.panels) - 1:
                drawn.set_xlabel(panel.x.title)
                drawn.tick_params(labelbottom=True)
        for unused in axes.flat[len(plot.panels) :]:
            unused.remove()
        _draw_legend(canvas)
    return canvas


def _draw_panel(panel: Panel, axes: "Axes") -> None:
    if panel.title:
        axes.set_title(panel.title, loc="left", fontsize=9)
    axes.set_ylabel(panel.y.title)
    if panel.x.log:
        axes.set_xscale("log")
    if panel.y.log:
        axes.set_yscale("log")
    for item, colour in panel.coloured():
        _draw_item(item, colour, axes)
    if panel.equal:
        axes.set_aspect("equal", adjustable="datalim")
    _set_axis(panel.x, axes, "x")
    _set_axis(panel.y, axes, "y")


def _set_axis(axis: Axis, axes: "Axes", which: str) -> None:
    if axis.date:
        axes.xaxis.set_major_formatter(lambda ms, _: f"{datetime.fromtimestamp(ms / 1000, UTC):%Y-%m-%d}")
    if axis.range is not None:
        axes.set(**{f"{which}lim": axis.range})
    elif axis.from_zero:
        axes.set(**{f"{which}lim": (0, None)})
    if axis.ticks:
        axes.set(**{f"{which}ticks": list(axis.ticks), f"{which}ticklabels": list(axis.ticks.values())})


def _draw_item(item: Item, colour: str, axes: "Axes") -> None:
    name = getattr(item, "name", "") or None
    if isinstance(item, Line):
        x, y = as_array(item.x), as_array(item.y)
        style: dict[str, Any] = {"color": colour, "linewidth": POINTS * item.width, "linestyle": DASHES[item.dash]}
        for rows in downsample.rows(x, y, gaps=item.gaps):
            single: dict[str, Any] = {"marker": "x", "markersize": 4} if len(rows) == 1 else {}
            axes.plot(x[rows], y[rows], label=name, **style, **single)
            name = None
    elif isinstance(item, Band):
        x, lower, upper = as_array(item.x), as_array(item.lower), as_array(item.upper)
        for rows in downsample.segments(x, lower + upper, gaps=item.gaps):
            band: dict[str, Any] = {"color": colour, "alpha": item.opacity, "linewidth": 0}
            axes.fill_between(x[rows], lower[rows], upper[rows], label=name, **band)
            name = None
    elif isinstance(item, Points):
        point: dict[str, Any] = {"marker": MARKERS[item.marker], "markersize": POINTS * item.size, "linestyle": "none"}
        bars: dict[str, Any] = {"xerr": item.x_sigma, "yerr": item.y_sigma, "elinewidth": 1.2}
        axes.errorbar(as_array(item.x), as_array(item.y), color=colour, label=name, **point, **bars)
    elif isinstance(item, Bars):
        x = as_array(item.x)
        width = float(x[1] - x[0]) if len(x) > 1 else 1.0
        axes.bar(x, as_array(item.heights), width=width, color=colour, label=name)
    elif isinstance(item, Area):
        edge: dict[str, Any] = {"edgecolor": colour, "linewidth": POINTS * item.outline}
        face = (*(np.array(rgb(colour)) / 255), item.opacity)
        axes.fill(as_array(item.x), as_array(item.y), facecolor=face, label=name, **edge)
    elif isinstance(item, Label):
        axes.text(item.x, item.y, item.text, color=item.colour, ha="center", va="center", fontsize=8)
    elif isinstance(item, Guide):
        _draw_guide(item, axes)
    else:
        axes.axvspan(item.start, item.stop, color=colour, alpha=item.opacity, linewidth=0)


def _draw_guide(item: Guide, axes: "Axes") -> None:
    style: dict[str, Any] = {"color": item.colour, "linewidth": POINTS * item.width, "linestyle": DASHES[item.dash]}
    text: dict[str, Any] = {"fontsize": 8, "color": item.colour, "ha": "right"}
    if item.x is not None:
        axes.axvline(item.x, **style)
        axes.text(item.x, 0.98, f"{item.text} ", transform=axes.get_xaxis_transform(), va="top", **text)
    elif item.y is not None:
        axes.axhline(item.y, **style)
        axes.text(0.99, item.y, item.text, transform=axes.get_yaxis_transform(), va="bottom", **text)


def _draw_legend(canvas: "Figure") -> None:
    """One legend below all panels, with each name once."""
    entries: dict[str, Any] = {}
    for axes in canvas.axes:
        for handle, name in zip(*axes.get_legend_handles_labels(), strict=True):
            entries.setdefault(name, handle)
    if entries:
        columns = min(len(entries), 2 if canvas.get_figwidth() < NARROW else 3)
        canvas.legend(
            list(entries.values()), list(entries), loc="outside lower center", ncols=columns, frameon=False, fontsize=8
        )
