"""A plot as plotly.js takes it: nested dictionaries of traces and layout."""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from fifthwheel.base.plots import downsample
from fifthwheel.base.plots.items import (
    DARK,
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
    Span,
    as_array,
    rgba,
)
from fifthwheel.base.types import Array

Figure = dict[str, Any]

FONT = "system-ui, -apple-system, Segoe UI, Roboto, Helvetica, Arial, sans-serif"
VALUE_DIGITS = 4
"""Of the range of an axis: less than one pixel, even after zooming in by a factor of 20."""
TIME_DIGITS = 5
DATES = [
    {"dtickrange": [None, 86_400_000], "value": "%H:%M\n%Y-%m-%d"},
    {"dtickrange": [86_400_000, "M1"], "value": "%Y-%m-%d"},
    {"dtickrange": ["M1", None], "value": "%Y-%m"},
]
"""Form of a date by the distance of the ticks, ms or months."""
SPACE, HEAD = 0.05, 0.03
"""Between two rows, and above a row with titles, as a fraction of the height."""


def figure(plot: PanelGrid) -> Figure:
    """Traces and layout of a plot; long lines have fewer points, without losing an extreme."""
    layout = _layout(plot)
    traces: list[Figure] = []
    named: set[str] = set()
    for k, panel in enumerate(plot.panels):
        x, y = _references(plot, k)
        for item, colour in panel.coloured():
            if isinstance(item, Guide | Span):
                layout["shapes"].append(_shape(item, colour, x, y))
                continue
            trace = _trace(item, colour, panel) | ({} if (x, y) == ("x", "y") else {"xaxis": x, "yaxis": y})
            if not trace["name"] or trace["name"] in named:
                trace["showlegend"] = False
            named.add(trace["name"])
            traces.append(trace)
    layout["showlegend"] = bool(named - {""})
    return {"data": traces, "layout": layout}


def _trace(item: Item, colour: str, panel: Panel) -> Figure:
    if isinstance(item, Line):
        trace = _line(item, colour, panel)
    elif isinstance(item, Band):
        trace = _band(item, colour, panel)
    elif isinstance(item, Points):
        trace = _points(item, colour, panel)
    elif isinstance(item, Bars):
        x = as_array(item.x)
        width = float(x[1] - x[0]) if len(x) > 1 else 1.0
        trace = {"type": "bar", "width": width, "marker": {"color": colour}}
        trace |= {"x": _numbers(x, TIME_DIGITS), "y": _numbers(as_array(item.heights))}
    elif isinstance(item, Area):
        corners = [_numbers(as_array(values)) for values in (item.x, item.y)]
        trace = {"type": "scatter", "mode": "lines", "fill": "toself", "fillcolor": rgba(colour, item.opacity)}
        trace |= {axis: values + values[:1] for axis, values in zip("xy", corners, strict=True)}
        trace["line"] = {"color": colour, "width": item.outline}
    elif isinstance(item, Label):
        trace = {"type": "scatter", "mode": "text", "x": [item.x], "y": [item.y], "text": [item.text]}
        trace |= {"textfont": {"color": item.colour}, "hoverinfo": "skip"}
    return {"name": getattr(item, "name", "")} | trace


def _line(item: Line, colour: str, panel: Panel) -> Figure:
    x, y = downsample.course(as_array(item.x), as_array(item.y), gaps=item.gaps)
    shown = np.isfinite(x)
    isolated = shown.any() and not (shown[1:] & shown[:-1]).any()
    return {
        "type": "scatter",
        "mode": "markers" if isolated else "lines",
        "x": _numbers(x, TIME_DIGITS, log=panel.x.log),
        "y": _numbers(y, log=panel.y.log),
        "line": {"color": colour, "width": item.width, "dash": item.dash},
    }


def _band(item: Band, colour: str, panel: Panel) -> Figure:
    """A filled polygon for each segment without a gap."""
    edges = as_array(item.x), as_array(item.lower), as_array(item.upper)
    time, lower, upper = downsample.band(*edges, gaps=item.gaps)
    x: list[float | None] = []
    y: list[float | None] = []
    for rows in downsample.segments(time, lower, gaps=False):
        at = _numbers(time[rows], TIME_DIGITS, log=panel.x.log)
        gap: list[float | None] = [None] if x else []
        x += gap + at + at[::-1]
        y += gap + _numbers(np.concatenate([upper[rows], lower[rows][::-1]]), log=panel.y.log)
    fill = {"fill": "toself", "fillcolor": rgba(colour, item.opacity), "hoverinfo": "skip"}
    return {"type": "scatter", "mode": "lines", "x": x, "y": y, "line": {"color": colour, "width": 0}} | fill


def _points(item: Points, colour: str, panel: Panel) -> Figure:
    marker = {"symbol": "x" if item.marker == "cross" else item.marker, "color": colour, "size": item.size}
    trace: Figure = {"type": "scatter", "mode": "markers", "marker": marker}
    for axis, sigma, digits in (("x", item.x_sigma, TIME_DIGITS), ("y", item.y_sigma, VALUE_DIGITS)):
        trace[axis] = _numbers(as_array(getattr(item, axis)), digits, log=getattr(panel, axis).log)
        if sigma is not None:
            bar = _numbers(as_array(sigma), digits, log=True)
            trace[f"error_{axis}"] = {"type": "data", "array": bar, "color": colour, "thickness": 1.6}
    return trace | ({"text": list(item.texts)} if item.texts else {})


def _numbers(values: Array, digits: int = VALUE_DIGITS, *, log: bool = False) -> list[float | None]:
    return downsample.significant(values, digits + 1) if log else downsample.numbers(values, digits)


def _shape(item: Guide | Span, colour: str, x: str, y: str) -> Figure:
    if isinstance(item, Span):
        place = {"xref": x, "yref": f"{y} domain", "x0": item.start, "x1": item.stop, "y0": 0, "y1": 1}
        fill = {"fillcolor": rgba(colour, item.opacity), "line": {"width": 0}, "layer": "below"}
        return {"type": "rect", **place, **fill}
    if item.x is not None:
        place = {"xref": x, "yref": f"{y} domain", "x0": item.x, "x1": item.x, "y0": 0, "y1": 1}
    else:
        place = {"xref": f"{x} domain", "yref": y, "x0": 0, "x1": 1, "y0": item.y, "y1": item.y}
    text = {"label": {"text": item.text, "textposition": "end", "textangle": 0}} if item.text else {}
    return {"type": "line", **place, "line": {"color": colour, "width": item.width, "dash": item.dash}, **text}


def _references(plot: PanelGrid, k: int) -> tuple[str, str]:
    """Names of the axes of panel k in plotly: x, y, x2, y2, ..."""
    number = str(k + 1) if k else ""
    return "x" if plot.one_x_axis else f"x{number}", f"y{number}"


def _layout(plot: PanelGrid) -> Figure:
    layout: Figure = {
        "autosize": True,
        "margin": {"l": 64, "r": 12, "t": 40 if plot.title else 30, "b": 44},
        "font": {"family": FONT, "size": 12},
        "title": {"text": plot.title, "font": {"size": 14}},
        "paper_bgcolor": "#ffffff",
        "plot_bgcolor": "#ffffff",
        "hovermode": "x" if plot.shared_x else "closest",
        "hoverlabel": {"bgcolor": "#ffffff", "bordercolor": "#999999", "font": {"color": DARK}, "namelength": -1},
        "separators": ".\u202f",
        "legend": {"orientation": "h", "y": -0.3 if any(p.x.date for p in plot.panels) else -0.12, "yanchor": "top"},
        "modebar": {"orientation": "v"},
        "shapes": [],
        "annotations": [],
    }
    domains = list(_domains(plot))
    for k, panel in enumerate(plot.panels):
        x, y = _references(plot, k)
        row, column = divmod(k, plot.columns)
        left, right = (column + 0.08 * (column > 0)) / plot.columns, (column + 1) / plot.columns
        layout[f"yaxis{y[1:]}"] = _axis(panel, "y") | {"domain": domains[row], "anchor": x}
        if panel.equal:
            layout[f"yaxis{y[1:]}"] |= {"scaleanchor": x, "scaleratio": 1}
        lowest = not plot.one_x_axis or k == len(plot.panels) - 1
        if lowest:
            layout[f"xaxis{x[1:]}"] = _axis(panel, "x") | {"domain": [left, right], "anchor": y, "tickangle": 0}
            if plot.shared_x and x != "x":
                layout[f"xaxis{x[1:]}"]["matches"] = "x"
        if panel.title:
            place = {"xref": "paper", "yref": "paper", "x": left, "y": domains[row][1]}
            place |= {"xanchor": "left", "yanchor": "bottom", "showarrow": False}
            layout["annotations"].append({"text": panel.title, **place, "font": {"color": DARK, "size": 12}})
    return layout


def _domains(plot: PanelGrid) -> Iterable[list[float]]:
    """Lower and upper end of each row of panels, as fractions of the height."""
    numbers = 0.0 if plot.one_x_axis else SPACE  # room for the numbers of an x axis
    titles = HEAD if any(panel.title for panel in plot.panels) else 0.0
    gap = min((SPACE + numbers + titles), 0.5 / plot.rows)
    heights = plot.row_heights()
    available = 1 - gap * (plot.rows - 1)
    top = 1.0
    for height in heights:
        bottom = top - available * height / sum(heights)
        yield [max(bottom, 0.0), top]
        top = bottom - gap


def _axis(panel: Panel, name: str) -> Figure:
    axis: Axis = getattr(panel, name)
    if not axis.log:
        return axis_style(axis)
    drawn = [as_array(getattr(item, name)) for item in panel.items if isinstance(item, Line | Points)]
    values = np.concatenate([np.asarray(axis.range), *drawn] if axis.range else [[], *drawn])
    values = values[np.isfinite(values) & (values > 0)]
    return axis_style(axis) | (_log_ticks(values.min(), values.max()) if values.size else {})


def _log_ticks(low: float, high: float) -> Figure:
    """Ticks with their whole value: powers of ten, or 1, 2 and 5 times these if the range is shorter."""
    if high > 100 * low:
        return {"dtick": 1}
    powers = range(math.floor(math.log10(low)), math.floor(math.log10(high)) + 1)
    ticks = [digit * 10.0**power for power in powers for digit in (1, 2, 5)]
    if sum(low <= tick <= high for tick in ticks) < 2:
        return {}  # plotly.js gives such a range the ticks of a linear axis
    return {"tickvals": ticks, "ticktext": [np.format_float_positional(tick, 6, trim="-") for tick in ticks]}


def axis_style(axis: Axis) -> Figure:
    """Title, scale, range and ticks of an axis."""
    style: Figure = {
        "title": {"text": axis.title, "standoff": 6},
        "automargin": True,
        "gridcolor": GRID,
        "zerolinecolor": "#c8c8c8",
        "linecolor": "#999999",
        "ticks": "outside",
        "ticklen": 4,
        "tickcolor": "#999999",
        "exponentformat": "none",
        "separatethousands": True,
    }
    if axis.log:
        style["type"] = "log"
    elif axis.date:
        style |= {"type": "date", "nticks": 5, "tickformatstops": DATES, "hoverformat": "%Y-%m-%d %H:%M"}
    if axis.range is not None:
        style["range"] = np.log10(axis.range).tolist() if axis.log else list(axis.range)
    elif axis.from_zero:
        style["rangemode"] = "tozero"
    if axis.ticks:
        style |= {"tickvals": list(axis.ticks), "ticktext": list(axis.ticks.values())}
    return style
