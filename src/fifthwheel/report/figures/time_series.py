"""Figures over time: histories of estimates, measured and predicted channels, states, innovations."""

import numpy as np

from fifthwheel.diagnose.state_summary import normalised_innovation, rejected_samples
from fifthwheel.formatting import shown
from fifthwheel.identify import Estimate, Fit
from fifthwheel.identify.history import ParameterHistory
from fifthwheel.observe import States
from fifthwheel.plots import downsample
from fifthwheel.plots.palette import BLUE, DARK, GREY, SKY, VERMILLION
from fifthwheel.plots.plotly_figure import Figure
from fifthwheel.record import Record
from fifthwheel.record.signal_names import si_unit
from fifthwheel.report.figures import primitives
from fifthwheel.report.figures.primitives import ReportPlot

STATUS_COLOURS = {
    "COASTING": "rgba(230,159,0,0.25)",
    "TOO_SLOW": "rgba(0,0,0,0.10)",
    "INPUT_MISSING": "rgba(204,121,167,0.30)",
    "INCONSISTENT": "rgba(213,94,0,0.25)",
}
MAX_MARKS = 1000
"""The largest number of marks of rejected samples."""
FILTER_BAND = "± 1 sigma at that time"
FINAL_SIGMA = "final ± 1 sigma, as in the table"


def history(estimates: ParameterHistory, estimate: Estimate, group: str) -> ReportPlot:
    """The history of one estimate with a band of one sigma of the filter, the initial and the final value.

    An error bar at the end shows the sigma of the result, which includes more than that of the filter.
    """
    unit = shown(estimate.unit)
    column = estimates.names.index(estimate.name)
    time = estimates.time
    values, sigma = estimates.values[:, column] * unit.factor, estimates.sigma[:, column] * unit.factor
    rows = downsample.rows(time, values, downsample.MAX_POINTS // 2)
    begin, end = float(time[0]), float(time[-1])
    initial, final = estimate.initial * unit.factor, estimate.value * unit.factor
    data = [
        primitives.band(time, values - sigma, values + sigma, FILTER_BAND),
        primitives.polyline("initial", [begin, end], [initial, initial], GREY, 1.5, "dot"),
        primitives.polyline("final", [begin, end], [final, final], VERMILLION, 1.5, "dash"),
        primitives.line(time, values, "estimate", BLUE, rows=rows),
    ]
    final_sigma = (estimate.sigma or 0.0) * unit.factor
    if final_sigma:
        at, cap = end + 0.025 * (end - begin), 0.008 * (end - begin)
        low, high = final - final_sigma, final + final_sigma
        x, y = [at - cap, at + cap, at, at, at - cap, at + cap], [low, low, low, high, high, high]
        data.append(primitives.polyline(FINAL_SIGMA, x, y, VERMILLION, 2.2))
    passes = [primitives.vertical(float(time[start])) for start in estimates.starts[1:] if start < len(time)]
    layout = primitives.layout("driving time, s", unit.name, passes)
    marks = np.array([initial, final, final - final_sigma, final + final_sigma])
    layout["yaxis"]["range"] = primitives.axis_range([marks, primitives.trimmed_range(values, 0.002)])
    return ReportPlot(
        group=group, figure={"data": data, "layout": layout}, name=("parameters", "history", estimate.name)
    )


def fit(fit: Fit, group: str) -> ReportPlot:
    """A channel as measured and as predicted by the free-running model, with the residual below."""
    unit = shown(si_unit(fit.signal))
    measured, predicted = fit.measured * unit.factor, fit.predicted * unit.factor
    residual = primitives.line(fit.time, measured - predicted, "residual", DARK, width=0.8)
    data = [
        primitives.line(fit.time, measured, "measured", GREY, width=1.2),
        primitives.line(fit.time, predicted, "predicted", BLUE),
        residual | {"yaxis": "y2", "showlegend": False},
    ]
    layout = primitives.layout("time, s", unit.name)
    layout["xaxis"]["anchor"] = "y2"
    layout["yaxis"]["domain"] = [0.36, 1.0]
    layout["yaxis2"] = primitives.axis(f"residual, {unit.name}") | {"domain": [0.0, 0.26], "nticks": 4}
    name = (fit.log, "fit", fit.signal)
    return ReportPlot(group=group, figure={"data": data, "layout": layout}, name=name, size="tall")


def state(states: States, record: Record | None, name: str, group: str) -> ReportPlot:
    """A state with a band of two sigma, its reference and its measurement where the record has them."""
    unit = shown(si_unit(name))
    values, sigma = states.values[name] * unit.factor, states.sigma[name] * unit.factor
    lower, upper = values - 2 * sigma, values + 2 * sigma
    data, visible = [], [values, *[primitives.trimmed_range(edge, 0.05) for edge in (lower, upper)]]
    if record is not None and name in record.signals:
        measured = record.signals[name] * unit.factor
        data.append(primitives.line(record.time, measured, "measured", "#b8b8b8", width=1))
        visible.append(primitives.trimmed_range(measured, 0.01))
    data.append(primitives.band(states.time, lower, upper, "± 2 sigma"))
    data.append(primitives.line(states.time, values, "estimate", BLUE))
    if record is not None and name in record.reference:
        reference = record.reference[name] * unit.factor
        data.append(primitives.line(record.time, reference, "reference", VERMILLION, dash="dash"))
        visible.append(reference)
    layout = primitives.layout("time, s", unit.name, _shaded_statuses(states))
    layout["yaxis"]["range"] = primitives.axis_range(visible)
    return ReportPlot(group=group, figure={"data": data, "layout": layout}, name=(states.name, "states", name))


def innovation(states: States, name: str, group: str) -> ReportPlot:
    """Normalised innovations of a channel, with lines at ± 2 and a cross for each rejected sample."""
    values, rejected = normalised_innovation(states, name), rejected_samples(states, name)
    accepted = np.where(rejected, np.nan, values)
    limit = max(4.0, 1.05 * float(np.nanmax(np.abs(accepted), initial=0.0)))
    data = [primitives.line(states.time, accepted, "innovation", SKY, width=0.8)]
    marked = np.flatnonzero(rejected)
    if marked.size:
        marked = marked[:: -(-marked.size // MAX_MARKS)]
        texts = [f"{value:.1f} sigma" for value in values[marked]]
        heights = np.clip(values[marked], -limit, limit)
        data.append(primitives.crosses(states.time[marked], heights, texts, "rejected", VERMILLION))
    shapes = [primitives.horizontal(2.0), primitives.horizontal(-2.0), *_shaded_statuses(states)]
    layout = primitives.layout("time, s", "sigma", shapes)
    layout["yaxis"]["range"] = [-1.05 * limit, 1.05 * limit]
    return ReportPlot(group=group, figure={"data": data, "layout": layout}, name=(states.name, "innovations", name))


def _shaded_statuses(states: States) -> list[Figure]:
    """Intervals in which the states are not OK; intervals closer than a pixel are joined."""
    from fifthwheel.observe import Status

    pixel = (states.time[-1] - states.time[0]) / 1000
    shapes = []
    for name, colour in STATUS_COLOURS.items():
        spans: list[list[float]] = []
        for first, last in downsample.runs(np.asarray(states.status) == Status[name]):
            begin, end = float(states.time[first]), float(states.time[min(last + 1, len(states.time) - 1)])
            if spans and begin - spans[-1][1] < pixel:
                spans[-1][1] = end
            else:
                spans.append([begin, end])
        shapes += [primitives.shade(begin, end, colour) for begin, end in spans]
    return shapes
