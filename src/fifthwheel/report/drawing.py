"""The same figures without a browser: from a plot's description to matplotlib, and to SVG, PNG or PDF."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fifthwheel.errors import FifthwheelError
from fifthwheel.report.lines import Figure, Plot
from fifthwheel.whole import whole

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawn

KINDS = ("svg", "png", "pdf")
SIZES = {"": (6.4, 3.4), "tall": (6.4, 4.6), "small": (4.2, 3.0)}
"""Inches, by the size of a plot."""
DASHES = {"solid": "-", "dash": (0, (5, 3)), "dot": (0, (1, 2))}
RULES: Any = {
    "font.size": 9,
    "svg.hashsalt": "fifthwheel",
    "svg.fonttype": "none",
    "axes.grid": True,
    "grid.color": "#e8e8e8",
    "axes.axisbelow": True,
}
DPI = 150


def checked(kind: str) -> str:
    """The kind, if figures can be drawn as such.

    Raises:
        FifthwheelError: they cannot, and what to do.
    """
    if kind not in KINDS:
        raise FifthwheelError(f"--figures: expected {', '.join(KINDS)}, got {kind}")
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        raise FifthwheelError(
            "--figures: needs matplotlib, which is not installed; pip install '.[figures]' in the checkout"
        ) from None
    return kind


def save(folder: Path, plots: Sequence[Plot], kind: str) -> list[Path]:
    """Write every figure as folder/log/section/signal.kind, each whole or not at all."""
    import matplotlib as mpl

    written: list[Path] = []
    for plot in plots:
        path = folder.joinpath(*map(plain, plot.name))
        path, number = path.with_name(f"{path.name}.{kind}"), 2
        while path in written:
            path, number = path.with_name(f"{path.stem} {number}.{kind}"), number + 1
        path.parent.mkdir(parents=True, exist_ok=True)
        with mpl.rc_context(RULES), whole(path) as part:
            draw(plot).savefig(part, format=kind, dpi=DPI, metadata=_undated(kind))
        written.append(path)
    return written


def plain(name: str) -> str:
    """A name that every file system takes."""
    return re.sub(r"[^\w.+ -]+", "_", name).strip(" .")[:80] or "_"


def draw(plot: Plot) -> "Drawn":
    """A plot as a figure of matplotlib."""
    from matplotlib.figure import Figure as Canvas

    layout = plot.figure["layout"]
    figure = Canvas(figsize=SIZES[plot.size], layout="constrained")
    figure.suptitle(f"{plot.name[0]}: {plot.name[2]}", fontsize=8 if plot.size == "small" else 10)
    axes = {"y": _axes(figure, layout)} if "yaxis2" not in layout else _two(figure, layout)
    for trace in plot.figure["data"]:
        _trace(axes[trace.get("yaxis", "y")], trace)
    for shape in layout.get("shapes", ()):
        _shape(axes["y"], shape)
    for key, one in axes.items():
        axis = layout["yaxis" + key[1:]]
        one.set_ylabel(axis["title"]["text"])
        if "range" in axis:
            one.set_ylim(axis["range"])
        elif axis.get("rangemode") == "tozero":
            one.set_ylim(bottom=0)
    handles, names = axes["y"].get_legend_handles_labels()
    if handles:
        figure.legend(
            handles,
            names,
            loc="outside lower center",
            ncols=min(len(names), 2 if plot.size == "small" else 3),
            frameon=False,
            fontsize=8,
        )
    return figure


def _axes(figure: "Drawn", layout: Figure) -> "Axes":
    one = figure.add_subplot()
    one.set_xlabel(layout["xaxis"]["title"]["text"])
    return one


def _two(figure: "Drawn", layout: Figure) -> "dict[str, Axes]":
    """Two axes above one another, as tall as their domains, that share their time."""
    heights = [axis["domain"][1] - axis["domain"][0] for axis in (layout["yaxis"], layout["yaxis2"])]
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=heights)
    lower.set_xlabel(layout["xaxis"]["title"]["text"])
    return {"y": upper, "y2": lower}


def _trace(axes: "Axes", trace: Figure) -> None:
    x, y = (np.array(trace[key], dtype=np.float64) for key in "xy")
    name = trace["name"] if trace.get("showlegend", True) else None
    if trace["type"] == "bar":
        axes.bar(x, y, width=trace["width"], color=trace["marker"]["color"], label=name)
    elif trace.get("fill") == "toself":
        colour, opacity = _colour(trace["fillcolor"])
        for part in _unbroken(x, y):
            axes.fill(x[part], y[part], color=colour, alpha=opacity, linewidth=0, label=name)
            name = None
    elif trace["mode"] == "markers":
        colour = (trace["marker"] if "marker" in trace else trace["line"])["color"]
        axes.plot(x, y, linestyle="none", marker="x", markersize=4, color=colour, label=name)
    else:
        line = trace["line"]
        axes.plot(x, y, color=line["color"], linewidth=0.7 * line["width"], linestyle=DASHES[line["dash"]], label=name)


def _shape(axes: "Axes", shape: Figure) -> None:
    """A line across the figure, or a shaded stretch of time."""
    if shape["type"] == "rect":
        colour, opacity = _colour(shape["fillcolor"])
        axes.axvspan(shape["x0"], shape["x1"], color=colour, alpha=opacity, linewidth=0)
    elif shape["xref"] == "paper":
        axes.axhline(shape["y0"], color=shape["line"]["color"], linewidth=1, linestyle=DASHES[shape["line"]["dash"]])
    else:
        axes.axvline(shape["x0"], color=shape["line"]["color"], linewidth=0.8)


def _unbroken(x: Any, y: Any) -> list[Any]:
    """Rows of every stretch without a gap."""
    there = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    return [part for part in np.split(there, np.flatnonzero(np.diff(there) > 1) + 1) if len(part)]


def _colour(text: str) -> tuple[Any, float]:
    """ "rgba(0,114,178,0.18)" as colour and opacity."""
    red, green, blue, opacity = (float(word) for word in text[5:-1].split(","))
    return (red / 255, green / 255, blue / 255), opacity


def _undated(kind: str) -> dict[str, None] | None:
    """The same figure is the same file, whenever it is drawn."""
    return {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind)
