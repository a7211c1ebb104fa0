"""Small figures that tell noise from what the model lacks: autocorrelation, histogram, size stretch by stretch."""

import numpy as np
from numpy.typing import NDArray

from fifthwheel.report import lines, whiteness
from fifthwheel.report.lines import BLUE, DARK, GREY, SKY, VERMILLION, Figure, Plot

Array = NDArray[np.float64]

BINS = 31
REACH = 4.0
"""A histogram goes so many standard deviations to either side; what is beyond counts in its last bars."""
MARGIN = {"l": 46, "r": 10, "t": 26, "b": 40}


def autocorrelation(found: whiteness.Correlation, name: tuple[str, str, str]) -> Plot:
    """A residual against itself some time later, with the band of white noise."""
    ends = np.array([0.0, float(found.lag[-1])])
    limit = np.full(2, found.limit)
    data = [
        lines.band(ends, -limit, limit, "95 % of white noise"),
        lines.line(found.lag, found.value, [np.flatnonzero(np.isfinite(found.value))], "autocorrelation", BLUE),
    ]
    layout = _small("lag, s", "")
    layout["yaxis"]["range"] = lines.reach([found.value, limit, -limit, np.array([1.0])])
    return _plot(data, layout, name, "autocorrelation")


def histogram(values: Array, name: tuple[str, str, str]) -> Plot:
    """Values in units of their own standard deviation, beside the normal law."""
    seen = values[np.isfinite(values)]
    scaled = np.clip((seen - seen.mean()) / seen.std(), -REACH, REACH)
    height, edges = np.histogram(scaled, bins=BINS, range=(-REACH, REACH), density=True)
    middle = (edges[1:] + edges[:-1]) / 2
    at = np.linspace(-REACH, REACH, 81)
    normal = np.exp(-(at**2) / 2) / np.sqrt(2 * np.pi)
    data = [
        lines.bars(middle, height, "samples", SKY),
        lines.line(at, normal, [np.arange(len(at))], "normal", DARK, width=1.5, dash="dash"),
    ]
    return _plot(data, _small("in units of its rms", ""), name, "histogram")


def sizes(found: whiteness.Stretches, group: str, name: tuple[str, str, str]) -> Plot:
    """The rms of normalised innovations stretch by stretch, with the band in which 95 % should lie."""
    data = [
        lines.band(found.time, found.low, found.high, "95 % by chance"),
        lines.level(found.time[[0, -1]], 1.0, "expected", GREY, "dot"),
        lines.line(found.time, found.rms, [np.arange(len(found.rms))], "innovation rms", VERMILLION),
    ]
    layout = _small("time, s", "sigma")
    layout["yaxis"]["rangemode"] = "tozero"
    return _plot(data, layout, name, "size", group)


def _small(x: str, y: str) -> Figure:
    return lines.layout(x, y, []) | {"margin": dict(MARGIN), "bargap": 0}


def _plot(data: list[Figure], layout: Figure, name: tuple[str, str, str], kind: str, group: str | None = None) -> Plot:
    log, section, signal = name
    own = group or " ".join(("alone", kind, *name))
    place = (log, section, f"{signal}.{kind}")
    return Plot(group=own, figure={"data": data, "layout": layout}, name=place, size="small")
