"""The figures of the page drawn by matplotlib, as SVG, PNG or PDF files."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fifthwheel._atomic import atomic_write
from fifthwheel._extras import require
from fifthwheel.errors import FifthwheelError
from fifthwheel.plots.matplotlib_figure import DASHES, STYLE
from fifthwheel.plots.plotly_figure import Figure
from fifthwheel.report.figures.primitives import ReportPlot

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

FORMATS = ("svg", "png", "pdf")
SIZES = {"": (6.4, 3.4), "tall": (6.4, 4.6), "small": (4.2, 3.0)}
"""Inches, by the size of a plot."""
DPI = 150
NO_DATE = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}
"""Metadata by format, so that the same figure gives the same file at any time."""


def checked_format(file_format: str) -> str:
    """The format, if figures can be written in it.

    Raises:
        FifthwheelError: the format is unknown, or matplotlib is not installed.
    """
    if file_format not in FORMATS:
        raise FifthwheelError(f"--figures: expected {', '.join(FORMATS)}, got {file_format}")
    try:
        require("matplotlib", "figures")
    except FifthwheelError as error:
        raise FifthwheelError(f"--figures: {error}") from None
    return file_format


def save_figures(folder: Path, plots: Sequence[ReportPlot], file_format: str) -> list[Path]:
    """Write every figure as folder/log/section/signal.format; returns the paths; errors as of `checked_format`."""
    checked_format(file_format)
    import matplotlib as mpl

    written: list[Path] = []
    for plot in plots:
        path = folder.joinpath(*map(file_name, plot.name))
        path, number = path.with_name(f"{path.name}.{file_format}"), 2
        while path in written:
            path, number = path.with_name(f"{path.stem} {number}.{file_format}"), number + 1
        path.parent.mkdir(parents=True, exist_ok=True)
        with mpl.rc_context(STYLE), atomic_write(path) as temporary:
            draw(plot).savefig(temporary, format=file_format, dpi=DPI, metadata=NO_DATE.get(file_format))
        written.append(path)
    return written


def file_name(text: str) -> str:
    """A text as a file name that every file system accepts."""
    return re.sub(r"[^\w.+ -]+", "_", text).strip(" .")[:80] or "_"


def draw(plot: ReportPlot) -> "Canvas":
    """A plot as a figure of matplotlib."""
    from matplotlib.figure import Figure as Canvas

    layout = plot.figure["layout"]
    canvas = Canvas(figsize=SIZES[plot.size], layout="constrained")
    canvas.suptitle(f"{plot.name[0]}: {plot.name[2]}", fontsize=8 if plot.size == "small" else 10)
    axes = _axes(canvas, layout)
    for trace in plot.figure["data"]:
        _draw_trace(axes[trace.get("yaxis", "y")], trace)
    for shape in layout.get("shapes", ()):
        _draw_shape(axes["y"], shape)
    for key, drawn in axes.items():
        axis = layout["yaxis" + key[1:]]
        drawn.set_ylabel(axis["title"]["text"])
        if "range" in axis:
            drawn.set_ylim(axis["range"])
        elif axis.get("rangemode") == "tozero":
            drawn.set_ylim(bottom=0)
    if "scaleanchor" in layout["yaxis"]:
        axes["y"].set_aspect("equal", adjustable="datalim")
    handles, names = axes["y"].get_legend_handles_labels()
    if handles:
        columns = min(len(names), 2 if plot.size == "small" else 3)
        canvas.legend(handles, names, loc="outside lower center", ncols=columns, frameon=False, fontsize=8)
    return canvas


def _axes(canvas: "Canvas", layout: Figure) -> "dict[str, Axes]":
    """The axes by their plotly name; two have a common time and the heights of their domains."""
    if "yaxis2" in layout:
        heights = [axis["domain"][1] - axis["domain"][0] for axis in (layout["yaxis"], layout["yaxis2"])]
        upper, lower = canvas.subplots(2, 1, sharex=True, height_ratios=heights)
        axes = {"y": upper, "y2": lower}
    else:
        axes = {"y": canvas.add_subplot()}
    [*axes.values()][-1].set_xlabel(layout["xaxis"]["title"]["text"])
    return axes


def _draw_trace(axes: "Axes", trace: Figure) -> None:
    x, y = (np.array(trace[key], dtype=np.float64) for key in "xy")
    name = trace["name"] if trace.get("showlegend", True) else None
    if trace["type"] == "bar":
        axes.bar(x, y, width=trace["width"], color=trace["marker"]["color"], label=name)
    elif trace.get("fill") == "toself":
        colour, opacity = _colour(trace["fillcolor"])
        finite = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
        for segment in np.split(finite, np.flatnonzero(np.diff(finite) > 1) + 1):
            if len(segment):
                axes.fill(x[segment], y[segment], color=colour, alpha=opacity, linewidth=0, label=name)
                name = None
    elif trace["mode"] == "markers":
        colour = (trace["marker"] if "marker" in trace else trace["line"])["color"]
        axes.plot(x, y, linestyle="none", marker="x", markersize=4, color=colour, label=name)
    else:
        line = trace["line"]
        axes.plot(x, y, color=line["color"], linewidth=0.7 * line["width"], linestyle=DASHES[line["dash"]], label=name)


def _draw_shape(axes: "Axes", shape: Figure) -> None:
    """A line across the figure, or a shaded interval of time."""
    if shape["type"] == "rect":
        colour, opacity = _colour(shape["fillcolor"])
        axes.axvspan(shape["x0"], shape["x1"], color=colour, alpha=opacity, linewidth=0)
    elif shape["xref"] == "paper":
        axes.axhline(shape["y0"], color=shape["line"]["color"], linewidth=1, linestyle=DASHES[shape["line"]["dash"]])
    else:
        axes.axvline(shape["x0"], color=shape["line"]["color"], linewidth=0.8)


def _colour(text: str) -> tuple[Any, float]:
    """Colour and opacity of a text such as "rgba(0,114,178,0.18)"."""
    red, green, blue, opacity = (float(word) for word in text[5:-1].split(","))
    return (red / 255, green / 255, blue / 255), opacity
