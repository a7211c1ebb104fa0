"""The figures of a report over time: histories, fits, states, innovations."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fifthwheel.report import facts, lines, thin
from fifthwheel.report.lines import BLUE, DARK, GREY, SKY, VERMILLION, Figure, Plot
from fifthwheel.report.numbers import shown

if TYPE_CHECKING:
    from fifthwheel.identify import Estimate, Fit, Trace
    from fifthwheel.logs import Record
    from fifthwheel.observe import States

Array = NDArray[np.float64]

STATUS_COLOURS = {
    "COASTING": "rgba(230,159,0,0.25)",
    "TOO_SLOW": "rgba(0,0,0,0.10)",
    "INPUT_MISSING": "rgba(204,121,167,0.30)",
}
REJECTED_SHOWN = 1000
"""Most marks of samples that were not used."""
AGREED = "final ± 1 sigma, as in the table"


def history(trace: "Trace", estimate: "Estimate", group: str) -> Plot:
    """One parameter over driving time, with a band of one sigma as the filter has it, its initial and its final value;
    at the end the sigma of the table, which counts more."""
    unit = shown(estimate.unit)
    column = trace.names.index(estimate.name)
    values, sigma = trace.values[:, column] * unit.factor, trace.sigma[:, column] * unit.factor
    rows = thin.rows(trace.time, values, thin.LIMIT // 2)
    ends = np.array([trace.time[0], trace.time[-1]])
    data = [
        lines.band(trace.time, values - sigma, values + sigma, "± 1 sigma by then"),
        lines.level(ends, estimate.initial * unit.factor, "initial", GREY, "dot"),
        lines.level(ends, estimate.value * unit.factor, "final", VERMILLION, "dash"),
        lines.line(trace.time, values, rows, "estimate", BLUE),
    ]
    spread, final = (estimate.sigma or 0.0) * unit.factor, estimate.value * unit.factor
    if spread:
        width = float(ends[1] - ends[0])
        data.append(lines.error_bar(float(ends[1]) + 0.025 * width, final, spread, 0.008 * width, AGREED, VERMILLION))
    passes = [lines.vertical(float(trace.time[start])) for start in trace.starts[1:] if start < len(trace.time)]
    layout = lines.layout("driving time, s", unit.name, passes)
    marks = np.array([estimate.initial * unit.factor, final])
    layout["yaxis"]["range"] = lines.reach([marks, marks[1] - spread, marks[1] + spread, lines.middle(values, 0.002)])
    return Plot(group=group, figure={"data": data, "layout": layout}, name=("parameters", "history", estimate.name))


def fit(found: "Fit", group: str, unit: str) -> Plot:
    """A channel as measured and as the truck, running free, predicts it; the residual below."""
    name, factor = shown(unit)
    measured, predicted = found.measured * factor, found.predicted * factor
    residual = measured - predicted
    data = [
        lines.line(found.time, measured, thin.rows(found.time, measured), "measured", GREY, width=1.2),
        lines.line(found.time, predicted, thin.rows(found.time, predicted), "predicted", BLUE),
        lines.line(found.time, residual, thin.rows(found.time, residual), "residual", DARK, width=0.8)
        | {"yaxis": "y2", "showlegend": False},
    ]
    layout = lines.layout("time, s", name, [])
    layout["xaxis"]["anchor"] = "y2"
    layout["yaxis"]["domain"] = [0.36, 1.0]
    layout["yaxis2"] = lines.axis(f"residual, {name}") | {"domain": [0.0, 0.26], "nticks": 4}
    place = (found.log, "fit", found.signal)
    return Plot(group=group, figure={"data": data, "layout": layout}, name=place, size="tall")


def state(states: "States", record: "Record | None", name: str, group: str, si_unit: str) -> Plot:
    """A state with a band of two sigma, beside its reference and its sensor where there is one."""
    unit = shown(si_unit)
    values, sigma = states.values[name] * unit.factor, states.sigma[name] * unit.factor
    rows = thin.rows(states.time, values)
    data, seen = [], [values, lines.middle(values - 2 * sigma, 0.05), lines.middle(values + 2 * sigma, 0.05)]
    if record is not None and name in record.signals:
        measured = record.signals[name] * unit.factor
        data.append(lines.line(record.time, measured, thin.rows(record.time, measured), "measured", "#b8b8b8", width=1))
        seen.append(lines.middle(measured, 0.01))
    data.append(lines.band(states.time, values - 2 * sigma, values + 2 * sigma, "± 2 sigma"))
    data.append(lines.line(states.time, values, rows, "estimate", BLUE))
    if record is not None and name in record.reference:
        reference = record.reference[name] * unit.factor
        kept = thin.rows(record.time, reference)
        data.append(lines.line(record.time, reference, kept, "reference", VERMILLION, dash="dash"))
        seen.append(reference)
    layout = lines.layout("time, s", unit.name, _status_shapes(states))
    layout["yaxis"]["range"] = lines.reach(seen)
    return Plot(group=group, figure={"data": data, "layout": layout}, name=(states.name, "states", name))


def innovation(states: "States", name: str, group: str) -> Plot:
    """Normalised innovations of a channel; 95 % should lie between the lines, without a pattern."""
    values, out = facts.normalised(states, name), facts.rejected(states, name)
    used = np.where(out, np.nan, values)
    reach = max(4.0, 1.05 * float(np.nanmax(np.abs(used), initial=0.0)))
    points = lines.line(states.time, used, thin.rows(states.time, used), "innovation", SKY, width=0.8)
    data = [points]
    rows = np.flatnonzero(out)
    if rows.size:
        rows = rows[:: -(-rows.size // REJECTED_SHOWN)]
        data.append(
            {
                "type": "scatter",
                "mode": "markers",
                "name": "not used",
                "x": thin.numbers(states.time[rows], lines.DIGITS_OF_TIME),
                "y": thin.numbers(np.clip(values[rows], -reach, reach), lines.DIGITS),
                "text": [f"{value:.1f} sigma" for value in values[rows]],
                "marker": {"symbol": "x", "color": VERMILLION, "size": 7},
            }
        )
    shapes = [lines.horizontal(2.0), lines.horizontal(-2.0), *_status_shapes(states)]
    layout = lines.layout("time, s", "sigma", shapes)
    layout["yaxis"]["range"] = [-1.05 * reach, 1.05 * reach]
    return Plot(group=group, figure={"data": data, "layout": layout}, name=(states.name, "innovations", name))


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
