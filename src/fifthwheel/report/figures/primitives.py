"""Parts of figures as plotly.js takes them: lines, bands, bars, axes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fifthwheel._types import Array
from fifthwheel.plots import Axis, downsample
from fifthwheel.plots.downsample import Index
from fifthwheel.plots.palette import BLUE, rgba
from fifthwheel.plots.plotly_figure import BAND_POINTS, FONT, TIME_DIGITS, VALUE_DIGITS, Figure, axis_style

BAND = rgba(BLUE, 0.18)


@dataclass(frozen=True, kw_only=True)
class ReportPlot:
    """One figure of the page."""

    group: str  # plots of one group have a common time axis
    figure: Figure
    name: tuple[str, str, str]  # log, section, and signal or parameter: where the figure is saved
    size: str = ""
    """"tall" for two axes one above the other, "small" for one of three in a row."""


def trimmed_range(values: Array, fraction: float) -> Array:
    """Lowest and highest of the finite values without this fraction at either end; empty without finite values."""
    finite = values[np.isfinite(values)]
    return np.quantile(finite, [fraction, 1 - fraction]) if finite.size else finite


def axis_range(values: Sequence[Array]) -> list[float]:
    """Range of an axis that shows all finite values with a margin."""
    joined = np.concatenate([np.atleast_1d(v) for v in values])
    finite = joined[np.isfinite(joined)]
    if not finite.size:
        return [-1.0, 1.0]
    low, high = float(finite.min()), float(finite.max())
    margin = 0.06 * (high - low) or 1.0
    return [low - margin, high + margin]


def polyline(name: str, x: Sequence[Any], y: Sequence[Any], colour: str, width: float, dash: str = "solid") -> Figure:
    """A line through points; None interrupts it."""
    style = {"color": colour, "width": width, "dash": dash}
    return {"type": "scatter", "mode": "lines", "name": name, "x": list(x), "y": list(y), "line": style}


def line(
    time: Array,
    values: Array,
    name: str,
    colour: str,
    *,
    rows: Sequence[Index] | None = None,
    width: float = 1.8,
    dash: str = "solid",
) -> Figure:
    """A line that is interrupted at gaps; `rows` are those to draw of each segment, by default `downsample.rows`."""
    rows = downsample.rows(time, values) if rows is None else rows
    joined = np.concatenate(rows) if rows else np.zeros(0, dtype=np.int64)
    x, y = downsample.numbers(time[joined], TIME_DIGITS), downsample.numbers(values[joined], VALUE_DIGITS)
    for gap in reversed(np.cumsum([len(segment) for segment in rows])[:-1].tolist()):
        x.insert(gap, None)
        y.insert(gap, None)
    isolated = bool(rows) and max(map(len, rows)) == 1
    return polyline(name, x, y, colour, width, dash) | {"mode": "markers" if isolated else "lines"}


def band(time: Array, lower: Array, upper: Array, name: str) -> Figure:
    """A band, a filled polygon for each segment."""
    segments = downsample.segments(time, lower + upper)
    total = max(sum(map(len, segments)), 1)
    x: list[float | None] = []
    y: list[float | None] = []
    for rows in segments:
        count = max(int(BAND_POINTS * len(rows) / total), 4)
        middle, low, high = downsample.envelope(time[rows], lower[rows], upper[rows], count)
        at = downsample.numbers(middle, TIME_DIGITS)
        gap = [None] if x else []
        x += gap + at + at[::-1]
        y += gap + downsample.numbers(np.concatenate([high, low[::-1]]), VALUE_DIGITS)
    fill = {"fill": "toself", "fillcolor": BAND, "line": {"width": 0}, "hoverinfo": "skip"}
    return polyline(name, x, y, BAND, 0) | fill


def bars(middle: Array, height: Array, name: str, colour: str) -> Figure:
    """Adjacent bars of equal width."""
    width = float(middle[1] - middle[0]) if len(middle) > 1 else 1.0
    x, y = downsample.numbers(middle, TIME_DIGITS), downsample.numbers(height, VALUE_DIGITS)
    return {"type": "bar", "name": name, "x": x, "y": y, "width": width, "marker": {"color": colour}}


def crosses(time: Array, values: Array, texts: Sequence[str], name: str, colour: str) -> Figure:
    """Samples marked by crosses, with a text each."""
    x, y = downsample.numbers(time, TIME_DIGITS), downsample.numbers(values, VALUE_DIGITS)
    marker = {"symbol": "x", "color": colour, "size": 7}
    return {"type": "scatter", "mode": "markers", "name": name, "x": x, "y": y, "text": list(texts), "marker": marker}


def vertical(at: float | str) -> Figure:
    """A vertical line across the figure, at a number or a date."""
    style = {"color": "#bbbbbb", "width": 1}
    return {"type": "line", "xref": "x", "yref": "paper", "x0": at, "x1": at, "y0": 0, "y1": 1, "line": style}


def horizontal(at: float) -> Figure:
    """A dashed horizontal line across the figure."""
    style = {"color": "#111111", "width": 1.5, "dash": "dash"}
    return {"type": "line", "xref": "paper", "yref": "y", "x0": 0, "x1": 1, "y0": at, "y1": at, "line": style}


def shade(begin: float, end: float, colour: str) -> Figure:
    """A shaded interval of time."""
    place = {"xref": "x", "yref": "paper", "x0": begin, "x1": end, "y0": 0, "y1": 1}
    return {"type": "rect", **place, "fillcolor": colour, "line": {"width": 0}, "layer": "below"}


def axis(title: str) -> Figure:
    return axis_style(Axis(label=title))


def layout(x: str, y: str, shapes: Sequence[Mapping[str, Any]] = ()) -> Figure:
    """Layout of a figure with these axis titles; its legend is made by the page, where it wraps."""
    return {
        "autosize": True,
        "margin": {"l": 56, "r": 12, "t": 30, "b": 44},
        "font": {"family": FONT, "size": 12},
        "paper_bgcolor": "#ffffff",
        "plot_bgcolor": "#ffffff",
        "hovermode": "x",
        "separators": ".\u202f",
        "showlegend": False,
        "xaxis": axis(x) | {"automargin": False, "tickangle": 0},
        "yaxis": axis(y),
        "shapes": list(shapes),
    }
