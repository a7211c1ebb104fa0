"""Figures of an assessment: the lane change and the low-speed turn from above, roll and load transfer over time."""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from fifthwheel._types import Array
from fifthwheel.assess.lane_change import LaneChange
from fifthwheel.assess.low_speed_turn import RADIUS, LowSpeedTurn
from fifthwheel.assess.rollover import Rollover
from fifthwheel.assess.truck import Truck
from fifthwheel.plots.palette import CYCLE, GREY
from fifthwheel.plots.plotly_figure import Figure
from fifthwheel.report.figures import primitives
from fifthwheel.report.figures.primitives import ReportPlot

Runs = Mapping[str, LaneChange]
"""The lane change by model, "linear" and "nonlinear"."""
DASH = {"linear": "solid", "nonlinear": "dash"}
SHOWN = 15.0
"""Distance that the last coupling drives beyond the circle in the picture, m."""
OUTLINES = 7
"""Drawn positions of the truck in the low-speed turn."""


def lane_change_paths(runs: Runs) -> ReportPlot:
    """Path of the front axle and of the last axle of each unit from above."""
    data = []
    for model, run in runs.items():
        for k, name in enumerate(("front", *run.roll)):
            title = "front axle" if name == "front" else name
            data.append(_line(f"{title}, {model}", run.x[name], run.y[name], CYCLE[k], DASH[model]))
    return _plot("paths", data, "along the road, m", "across the road, m")


def lane_change_acceleration(runs: Runs) -> ReportPlot:
    """Lateral acceleration of the front axle and of each CoG."""
    return _over_time("lateral acceleration", "m/s²", runs, lambda run: run.acceleration, 1.0)


def lane_change_roll(runs: Runs) -> ReportPlot:
    """Roll angle of each unit."""
    return _over_time("roll", "deg", runs, lambda run: run.roll, 180 / np.pi)


def load_transfer(runs: Runs) -> ReportPlot:
    """Load transfer ratio; at 1 all inner wheels of the following axles lift."""
    return _over_time("load transfer ratio", "", runs, lambda run: {"load transfer ratio": run.load_transfer}, 1.0)


def turn_from_above(truck: Truck, run: LowSpeedTurn) -> ReportPlot:
    """The units at some instants of the low-speed turn, and the paths of the first and the last axle."""
    data: list[Figure] = []
    shown = int(np.argmax(np.append(run.origins[:, -1].imag > RADIUS + SHOWN, True))) or len(run.steer)
    width, last = truck.body.width, len(truck.vehicle.units) - 1
    for i, (unit, front) in enumerate(zip(truck.vehicle.units, truck.front_ends(), strict=True)):
        rear = min(axle.position for axle in unit.axles) - ((truck.body.rear_overhang or 0.0) if i == last else 0.0)
        corners = np.array([front + 0.5j * width, rear + 0.5j * width, rear - 0.5j * width, front - 0.5j * width])
        outline: list[complex] = []
        for row in np.linspace(0, shown - 1, OUTLINES).astype(int):
            points = run.origins[row, i] + np.append(corners, corners[0]) * np.exp(1j * run.headings[row, i])
            outline += [*points.tolist(), complex(np.nan, np.nan)]
        x, y = ([None if np.isnan(v) else round(v, 3) for v in part] for part in _parts(np.array(outline)))
        data.append(primitives.polyline(unit.name, x, y, CYCLE[i % len(CYCLE)], 1.2))
    for name, i, position in (
        ("first axle", 0, truck.front_axle.position),
        ("last axle", last, truck.rear_axle.position),
    ):
        path = (run.origins[:, i] + position * np.exp(1j * run.headings[:, i]))[:shown]
        x, y = (part.round(3).tolist() for part in _parts(path))
        data.append(primitives.polyline(name, x, y, GREY, 1.5, "dash"))
    plot = _plot("low-speed turn", data, "x, m", "y, m", size="tall")
    plot.figure["layout"]["yaxis"] |= {"scaleanchor": "x", "scaleratio": 1}
    return plot


def roll_by_acceleration(sets: tuple[Rollover, ...]) -> ReportPlot:
    """Roll angle of each unit against the lateral acceleration of a steady turn, with the lift of each axle group."""
    data = []
    for k, (name, (acceleration, roll)) in enumerate(item for s in sets for item in s.roll.items()):
        data.append(_line(name, acceleration, np.degrees(roll), CYCLE[k % len(CYCLE)], "solid"))
    shapes = [primitives.vertical(lift) for s in sets for lift in s.lifts.values()]
    return _plot("roll in a steady turn", data, "lateral acceleration, g", "roll, deg", shapes=shapes)


def _parts(values: NDArray[np.complex128]) -> tuple[Array, Array]:
    return values.real, values.imag


def _over_time(
    title: str, unit: str, runs: Runs, series: Callable[[LaneChange], Mapping[str, Array]], factor: float
) -> ReportPlot:
    data = []
    for model, run in runs.items():
        same_order = sorted(series(run).items(), key=lambda item: item[0] != "front")  # so that models share colours
        for k, (name, values) in enumerate(same_order):
            text = f"front axle, {model}" if name == "front" else f"{name}, {model}"
            data.append(_line(text, run.time, factor * values, CYCLE[k], DASH[model]))
    return _plot(title, data, "time, s", unit, group="lane change")


def _line(name: str, x: Array, y: Array, colour: str, dash: str) -> Figure:
    return primitives.line(x, y, name, colour, rows=[np.arange(len(x))], dash=dash)


def _plot(
    title: str,
    data: list[Figure],
    x: str,
    y: str,
    *,
    group: str = "",
    size: str = "",
    shapes: "list[Figure] | None" = None,
) -> ReportPlot:
    layout = primitives.layout(x, y, shapes or ())
    return ReportPlot(
        group=group or title, figure={"data": data, "layout": layout}, name=("truck", "assessment", title), size=size
    )
