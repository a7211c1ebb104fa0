"""What figures are made of, as plotly.js has it: lines, bands, levels, bars, axes.

Colours are those of Okabe and Ito, which people with a colour vision deficiency can tell apart; line styles differ too.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fifthwheel.report import thin

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Figure = dict[str, Any]

BLUE, ORANGE, VERMILLION, GREY, DARK, SKY = "#0072B2", "#E69F00", "#D55E00", "#8c8c8c", "#333333", "#56A0D3"
BAND = "rgba(0,114,178,0.18)"
BAND_STRETCHES = 800
"""A band is drawn in so many stretches."""
DIGITS = 4
"""Of an axis: a ten thousandth of it is a twentieth of a pixel, and still less than one when zoomed in twentyfold."""
DIGITS_OF_TIME = 5


@dataclass(frozen=True, kw_only=True)
class Plot:
    """One figure, what zooms with it, and where it is saved."""

    group: str
    """Plots of the same group share their time axis."""
    figure: Figure
    name: tuple[str, str, str]
    """Log, section and signal or parameter."""
    size: str = ""
    """"tall" for two axes above one another, "small" for one of three in a row."""


def middle(values: Array, part: float) -> Array:
    """The values without so great a part of them at either end."""
    finite = values[np.isfinite(values)]
    return np.quantile(finite, [part, 1 - part]) if finite.size else finite


def reach(seen: Sequence[Array]) -> list[float]:
    """Axis that shows all of these; what is beyond, such as a wide band at the start, is found by zooming out."""
    everything = np.concatenate([np.atleast_1d(values) for values in seen])
    finite = everything[np.isfinite(everything)]
    if not finite.size:
        return [-1.0, 1.0]
    low, high = float(finite.min()), float(finite.max())
    margin = 0.06 * (high - low) or 1.0
    return [low - margin, high + margin]


def line(
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
        "x": _broken(thin.numbers(time[joined], DIGITS_OF_TIME), gaps),
        "y": _broken(thin.numbers(values[joined], DIGITS), gaps),
        "line": {"color": colour, "width": width, "dash": dash},
    }


def band(time: Array, lower: Array, upper: Array, name: str, colour: str = BAND) -> Figure:
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
        at = thin.numbers(place, DIGITS_OF_TIME)
        x += at + at[::-1]
        y += thin.numbers(np.concatenate([high, low[::-1]]), DIGITS)
    return {
        "type": "scatter",
        "mode": "lines",
        "name": name,
        "x": x,
        "y": y,
        "fill": "toself",
        "fillcolor": colour,
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


def level(ends: Array, value: float, name: str, colour: str, dash: str) -> Figure:
    return {
        "type": "scatter",
        "mode": "lines",
        "name": name,
        "x": ends.tolist(),
        "y": [value, value],
        "line": {"color": colour, "width": 1.5, "dash": dash},
    }


def bars(middle: Array, height: Array, name: str, colour: str) -> Figure:
    """Bars that touch, all of one width."""
    return {
        "type": "bar",
        "name": name,
        "x": thin.numbers(middle, DIGITS_OF_TIME),
        "y": thin.numbers(height, DIGITS),
        "width": float(middle[1] - middle[0]) if len(middle) > 1 else 1.0,
        "marker": {"color": colour},
    }


def error_bar(at: float, value: float, sigma: float, cap: float, name: str, colour: str) -> Figure:
    """A value with its sigma, as an upright I beside the lines."""
    low, high = value - sigma, value + sigma
    left, right = at - cap, at + cap
    return {
        "type": "scatter",
        "mode": "lines",
        "name": name,
        "x": [left, right, at, at, left, right],
        "y": [low, low, low, high, high, high],
        "line": {"color": colour, "width": 2.2, "dash": "solid"},
    }


def vertical(at: float) -> Figure:
    line = {"color": "#bbbbbb", "width": 1}
    return {"type": "line", "xref": "x", "yref": "paper", "x0": at, "x1": at, "y0": 0, "y1": 1, "line": line}


def horizontal(at: float) -> Figure:
    """Across the whole figure."""
    line = {"color": "#111111", "width": 1.5, "dash": "dash"}
    return {"type": "line", "xref": "paper", "yref": "y", "x0": 0, "x1": 1, "y0": at, "y1": at, "line": line}


def axis(title: str) -> Figure:
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


def layout(x: str, y: str, shapes: Sequence[Mapping[str, Any]]) -> Figure:
    return {
        "autosize": True,
        "margin": {"l": 56, "r": 12, "t": 30, "b": 44},
        "font": {"family": "system-ui, -apple-system, Segoe UI, Roboto, Helvetica, Arial, sans-serif", "size": 12},
        "paper_bgcolor": "#ffffff",
        "plot_bgcolor": "#ffffff",
        "hovermode": "x",
        "separators": ".\u202f",
        "showlegend": False,  # the page makes one that wraps
        "xaxis": axis(x) | {"automargin": False, "tickangle": 0},
        "yaxis": axis(y),
        "shapes": list(shapes),
    }
