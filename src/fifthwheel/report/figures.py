"""Plots as plain dictionaries for plotly.js: histories, fits, states, innovations.

Colours are those of Okabe and Ito, which people with a colour vision deficiency can tell apart; line styles differ too.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fifthwheel.report import facts, thin
from fifthwheel.report.numbers import shown

if TYPE_CHECKING:
    from fifthwheel.identify import Estimate, Fit, Trace
    from fifthwheel.logs import Record
    from fifthwheel.observe import States

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Figure = dict[str, Any]

BLUE, ORANGE, VERMILLION, GREY, DARK = "#0072B2", "#E69F00", "#D55E00", "#8c8c8c", "#333333"
BAND = "rgba(0,114,178,0.18)"
STATUS_COLOURS = {
    "COASTING": "rgba(230,159,0,0.25)",
    "TOO_SLOW": "rgba(0,0,0,0.10)",
    "INPUT_MISSING": "rgba(204,121,167,0.30)",
}
REJECTED_SHOWN = 1000
"""Most marks of samples that were not used."""
BAND_STRETCHES = 800
"""A band is drawn in so many stretches."""


@dataclass(frozen=True, kw_only=True)
class Plot:
    """One figure and what zooms with it."""

    group: str
    """Plots of the same group share their time axis."""
    figure: Figure
    tall: bool = False


def history(trace: "Trace", estimate: "Estimate", group: str) -> Plot:
    """One parameter over driving time, with a band of one sigma, its initial and its final value."""
    unit = shown(estimate.unit)
    column = trace.names.index(estimate.name)
    values, sigma = trace.values[:, column] * unit.factor, trace.sigma[:, column] * unit.factor
    rows = thin.rows(trace.time, values, thin.LIMIT // 2)
    ends = np.array([trace.time[0], trace.time[-1]])
    data = [
        _band(trace.time, values - sigma, values + sigma, "± 1 sigma"),
        _level(ends, estimate.initial * unit.factor, "initial", GREY, "dot"),
        _level(ends, estimate.value * unit.factor, "final", VERMILLION, "dash"),
        _line(trace.time, values, rows, "estimate", BLUE),
    ]
    passes = [_vertical(float(trace.time[start])) for start in trace.starts[1:] if start < len(trace.time)]
    layout = _layout("driving time, s", unit.name, passes)
    spread = (estimate.sigma or 0.0) * unit.factor
    marks = np.array([estimate.initial * unit.factor, estimate.value * unit.factor])
    layout["yaxis"]["range"] = _range([marks, marks[1] - spread, marks[1] + spread, _middle(values, 0.002)])
    return Plot(group=group, figure={"data": data, "layout": layout})


def fit(found: "Fit", group: str, unit: str) -> Plot:
    """A channel as measured and as the truck, running free, predicts it; the residual below."""
    name, factor = shown(unit)
    measured, predicted = found.measured * factor, found.predicted * factor
    residual = measured - predicted
    lines = [
        _line(found.time, measured, thin.rows(found.time, measured), "measured", GREY, width=1.2),
        _line(found.time, predicted, thin.rows(found.time, predicted), "predicted", BLUE),
        _line(found.time, residual, thin.rows(found.time, residual), "residual", DARK, width=0.8)
        | {"yaxis": "y2", "showlegend": False},
    ]
    layout = _layout("time, s", name, [])
    layout["xaxis"]["anchor"] = "y2"
    layout["yaxis"]["domain"] = [0.36, 1.0]
    layout["yaxis2"] = _axis(f"residual, {name}") | {"domain": [0.0, 0.26], "nticks": 4}
    return Plot(group=group, figure={"data": lines, "layout": layout}, tall=True)


def state(states: "States", record: "Record | None", name: str, group: str, si_unit: str) -> Plot:
    """A state with a band of two sigma, beside its reference and its sensor where there is one."""
    unit = shown(si_unit)
    values, sigma = states.values[name] * unit.factor, states.sigma[name] * unit.factor
    rows = thin.rows(states.time, values)
    data, seen = [], [values, _middle(values - 2 * sigma, 0.05), _middle(values + 2 * sigma, 0.05)]
    if record is not None and name in record.signals:
        measured = record.signals[name] * unit.factor
        data.append(_line(record.time, measured, thin.rows(record.time, measured), "measured", "#b8b8b8", width=1))
        seen.append(_middle(measured, 0.01))
    data.append(_band(states.time, values - 2 * sigma, values + 2 * sigma, "± 2 sigma"))
    data.append(_line(states.time, values, rows, "estimate", BLUE))
    if record is not None and name in record.reference:
        reference = record.reference[name] * unit.factor
        kept = thin.rows(record.time, reference)
        data.append(_line(record.time, reference, kept, "reference", VERMILLION, dash="dash"))
        seen.append(reference)
    layout = _layout("time, s", unit.name, _status_shapes(states))
    layout["yaxis"]["range"] = _range(seen)
    return Plot(group=group, figure={"data": data, "layout": layout})


def innovation(states: "States", name: str, group: str) -> Plot:
    """Normalised innovations of a channel; 95 % should lie between the lines, without a pattern."""
    values, out = facts.normalised(states, name), facts.rejected(states, name)
    used = np.where(out, np.nan, values)
    reach = max(4.0, 1.05 * float(np.nanmax(np.abs(used), initial=0.0)))
    points = _line(states.time, used, thin.rows(states.time, used), "innovation", "#56A0D3", width=0.8)
    data = [points]
    rows = np.flatnonzero(out)
    if rows.size:
        rows = rows[:: -(-rows.size // REJECTED_SHOWN)]
        data.append(
            {
                "type": "scatter",
                "mode": "markers",
                "name": "not used",
                "x": thin.numbers(states.time[rows], 6),
                "y": thin.numbers(np.clip(values[rows], -reach, reach)),
                "text": [f"{value:.1f} sigma" for value in values[rows]],
                "marker": {"symbol": "x", "color": VERMILLION, "size": 7},
            }
        )
    shapes = [_horizontal(2.0), _horizontal(-2.0), *_status_shapes(states)]
    layout = _layout("time, s", "sigma", shapes)
    layout["yaxis"]["range"] = [-1.05 * reach, 1.05 * reach]
    return Plot(group=group, figure={"data": data, "layout": layout})


def _middle(values: Array, part: float) -> Array:
    """The values without so great a part of them at either end."""
    finite = values[np.isfinite(values)]
    return np.quantile(finite, [part, 1 - part]) if finite.size else finite


def _range(seen: Sequence[Array]) -> list[float]:
    """Axis that shows all of these; what is beyond, such as a wide band at the start, is found by zooming out."""
    everything = np.concatenate([np.atleast_1d(values) for values in seen])
    finite = everything[np.isfinite(everything)]
    if not finite.size:
        return [-1.0, 1.0]
    low, high = float(finite.min()), float(finite.max())
    margin = 0.06 * (high - low) or 1.0
    return [low - margin, high + margin]


def _line(
    time: Array,
    values: Array,
    rows: Sequence[Index],
    name: str,
    colour: str,
    *,
    width: float = 1.8,
    dash: str = "solid",
) -> Figure:
    joined, gaps = _joined(rows)
    alone = bool(rows) and max(len(part) for part in rows) == 1
    return {
        "type": "scatter",
        "mode": "markers" if alone else "lines",
        "name": name,
        "x": _broken(thin.numbers(time[joined], 6), gaps),
        "y": _broken(thin.numbers(values[joined]), gaps),
        "line": {"color": colour, "width": width, "dash": dash},
    }


def _band(time: Array, lower: Array, upper: Array, name: str) -> Figure:
    """A filled polygon for every stretch."""
    parts = thin.pieces(time, lower + upper)
    total = max(sum(len(part) for part in parts), 1)
    x: list[float | None] = []
    y: list[float | None] = []
    for part in parts:
        count = max(int(BAND_STRETCHES * len(part) / total), 4)
        place, low, high = thin.envelope(time[part], lower[part], upper[part], count)
        if x:
            x.append(None)
            y.append(None)
        at = thin.numbers(place, 6)
        x += at + at[::-1]
        y += thin.numbers(np.concatenate([high, low[::-1]]))
    return {
        "type": "scatter",
        "mode": "lines",
        "name": name,
        "x": x,
        "y": y,
        "fill": "toself",
        "fillcolor": BAND,
        "line": {"width": 0},
        "hoverinfo": "skip",
    }


def _joined(rows: Sequence[Index]) -> tuple[Index, list[int]]:
    """All rows behind one another, and the places where one stretch ends and the next begins."""
    if not rows:
        return np.zeros(0, dtype=np.int64), []
    return np.concatenate(rows), np.cumsum([len(part) for part in rows])[:-1].tolist()


def _broken(values: list[float | None], gaps: Sequence[int]) -> list[float | None]:
    for place in reversed(gaps):
        values.insert(place, None)
    return values


def _level(ends: Array, value: float, name: str, colour: str, dash: str) -> Figure:
    return {
        "type": "scatter",
        "mode": "lines",
        "name": name,
        "x": ends.tolist(),
        "y": [value, value],
        "line": {"color": colour, "width": 1.5, "dash": dash},
    }


def _vertical(at: float) -> Figure:
    line = {"color": "#bbbbbb", "width": 1}
    return {"type": "line", "xref": "x", "yref": "paper", "x0": at, "x1": at, "y0": 0, "y1": 1, "line": line}


def _horizontal(at: float) -> Figure:
    line = {"color": "#111111", "width": 1.5, "dash": "dash"}
    return {"type": "line", "xref": "paper", "yref": "y", "x0": 0, "x1": 1, "y0": at, "y1": at, "line": line}


def _status_shapes(states: "States") -> list[Figure]:
    """Shaded where the states may not be believed; stretches closer than a pixel are joined."""
    from fifthwheel.observe import Status

    pixel = (states.time[-1] - states.time[0]) / 1000
    shapes = []
    for status in Status:
        if status == Status.OK:
            continue
        spans: list[list[float]] = []
        for first, last in thin.runs(np.asarray(states.status) == status):
            begin, end = float(states.time[first]), float(states.time[min(last + 1, len(states.time) - 1)])
            if spans and begin - spans[-1][1] < pixel:
                spans[-1][1] = end
            else:
                spans.append([begin, end])
        for begin, end in spans:
            shapes.append(
                {
                    "type": "rect",
                    "xref": "x",
                    "yref": "paper",
                    "x0": begin,
                    "x1": end,
                    "y0": 0,
                    "y1": 1,
                    "fillcolor": STATUS_COLOURS.get(status.name, "rgba(0,0,0,0.1)"),
                    "line": {"width": 0},
                    "layer": "below",
                }
            )
    return shapes


def _axis(title: str) -> Figure:
    return {
        "title": {"text": title, "standoff": 6},
        "automargin": True,
        "gridcolor": "#e8e8e8",
        "zerolinecolor": "#c8c8c8",
        "linecolor": "#999999",
        "ticks": "outside",
        "ticklen": 4,
        "tickcolor": "#999999",
        "exponentformat": "none",
        "separatethousands": True,
    }


def _layout(x: str, y: str, shapes: Sequence[Mapping[str, Any]]) -> Figure:
    return {
        "autosize": True,
        "margin": {"l": 56, "r": 12, "t": 30, "b": 44},
        "font": {"family": "system-ui, -apple-system, Segoe UI, Roboto, Helvetica, Arial, sans-serif", "size": 12},
        "paper_bgcolor": "#ffffff",
        "plot_bgcolor": "#ffffff",
        "hovermode": "x",
        "separators": ".\u202f",
        "showlegend": False,  # the page makes one that wraps
        "xaxis": _axis(x) | {"automargin": False, "tickangle": 0},
        "yaxis": _axis(y),
        "shapes": list(shapes),
    }
