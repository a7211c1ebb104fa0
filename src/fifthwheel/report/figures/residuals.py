"""Small figures of residuals: autocorrelation, histogram, rms by segment."""

import numpy as np

from fifthwheel._types import Array
from fifthwheel.diagnose.whiteness import Autocorrelation, SegmentRms
from fifthwheel.plots.palette import BLUE, DARK, GREY, SKY, VERMILLION
from fifthwheel.plots.plotly_figure import Figure
from fifthwheel.report.figures import primitives
from fifthwheel.report.figures.primitives import ReportPlot

BINS = 31
HISTOGRAM_LIMIT = 4.0
"""A histogram spans so many standard deviations to either side; values beyond count in its outer bars."""
MARGIN = {"l": 46, "r": 10, "t": 26, "b": 40}

Name = tuple[str, str, str]
"""Log, section, signal."""


def autocorrelation(correlation: Autocorrelation, name: Name) -> ReportPlot:
    """The autocorrelation of a residual with the band of white noise."""
    ends = np.array([0.0, float(correlation.lag[-1])])
    limit = np.full(2, correlation.limit)
    rows = [np.flatnonzero(np.isfinite(correlation.value))]
    data = [
        primitives.band(ends, -limit, limit, "95 % of white noise"),
        primitives.line(correlation.lag, correlation.value, "autocorrelation", BLUE, rows=rows),
    ]
    layout = primitives.layout("lag, s", "")
    layout["yaxis"]["range"] = primitives.axis_range([correlation.value, limit, -limit, np.array([1.0])])
    return _small_plot(data, layout, name, "autocorrelation")


def histogram(values: Array, name: Name) -> ReportPlot:
    """Values in units of their own standard deviation, with the normal distribution."""
    finite = values[np.isfinite(values)]
    scaled = np.clip((finite - finite.mean()) / finite.std(), -HISTOGRAM_LIMIT, HISTOGRAM_LIMIT)
    height, edges = np.histogram(scaled, bins=BINS, range=(-HISTOGRAM_LIMIT, HISTOGRAM_LIMIT), density=True)
    middle = (edges[1:] + edges[:-1]) / 2
    x = np.linspace(-HISTOGRAM_LIMIT, HISTOGRAM_LIMIT, 81)
    normal = np.exp(-(x**2) / 2) / np.sqrt(2 * np.pi)
    data = [
        primitives.bars(middle, height, "samples", SKY),
        primitives.line(x, normal, "normal distribution", DARK, rows=[np.arange(len(x))], width=1.5, dash="dash"),
    ]
    return _small_plot(data, primitives.layout("standard deviations", ""), name, "histogram")


def rms_by_segment(segments: SegmentRms, group: str, name: Name) -> ReportPlot:
    """The rms of normalised innovations by segment, with the band in which 95 % should lie."""
    data = [
        primitives.band(segments.time, segments.low, segments.high, "95 % expected"),
        primitives.polyline("expected", segments.time[[0, -1]].tolist(), [1.0, 1.0], GREY, 1.5, "dot"),
        primitives.line(segments.time, segments.rms, "innovation rms", VERMILLION, rows=[np.arange(len(segments.rms))]),
    ]
    layout = primitives.layout("time, s", "sigma")
    layout["yaxis"]["rangemode"] = "tozero"
    return _small_plot(data, layout, name, "size", group)


def _small_plot(data: list[Figure], layout: Figure, name: Name, kind: str, group: str | None = None) -> ReportPlot:
    log, section, signal = name
    return ReportPlot(
        group=group or " ".join(("alone", kind, *name)),
        figure={"data": data, "layout": layout | {"margin": dict(MARGIN), "bargap": 0}},
        name=(log, section, f"{signal}.{kind}"),
        size="small",
    )
