"""What the page Explore shows: a log and the linear model, with the numbers of the vehicle and with changed ones."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial

from fifthwheel import pages, plot
from fifthwheel.diagnose import LogPrediction
from fifthwheel.dynamics import linear_system
from fifthwheel.formatting import approximate, percent, shown
from fifthwheel.identify import Fit
from fifthwheel.plots import Axis, Line, Panel, Plot, Points
from fifthwheel.plots.palette import BLUE, GREY, VERMILLION
from fifthwheel.record import Record
from fifthwheel.record.signal_names import si_unit
from fifthwheel.vehicle import Vehicle


@dataclass(frozen=True, kw_only=True)
class Exploration:
    """A log, a vehicle, and its prediction for other numbers."""

    vehicle: Vehicle
    record: Record
    prediction: LogPrediction

    @classmethod
    def of(cls, record: Record, vehicle: Vehicle) -> "Exploration":
        """Errors as of `LogPrediction.of`."""
        return cls(vehicle=vehicle, record=record, prediction=LogPrediction.of(record, vehicle))

    def fits(self, values: Mapping[str, float]) -> list[Fit]:
        """Measured and predicted signals with changed numbers."""
        return self.prediction.fits(values)


def fit_plot(given: list[Fit], changed: list[Fit]) -> Plot:
    """Each signal as measured, as predicted by the vehicle file, and as predicted with the changed numbers."""
    panels = []
    for before, after in zip(given, changed, strict=True):
        unit = shown(si_unit(after.signal))
        line = partial(Line, after.time, gaps=True)
        items = [
            line(after.measured * unit.factor, name="measured", colour=GREY),
            line(before.predicted * unit.factor, name="vehicle file", colour=BLUE, dash="dash"),
            line(after.predicted * unit.factor, name="sliders", colour=VERMILLION),
        ]
        panels.append(Panel(items=items, title=after.signal, x=Axis(label="time", unit="s"), y=Axis(unit=unit.name)))
    return Plot(panels=panels)


def fit_table(given: list[Fit], changed: list[Fit]) -> pages.Table:
    """Signal, and explained fraction and residual of both."""
    rows = []
    for before, after in zip(given, changed, strict=True):
        cells = [
            f"{percent(max(fit.explained, 0.0), round_down=True)}, {approximate(fit.rms, si_unit(fit.signal))}"
            for fit in (before, after)
        ]
        rows.append((pages.Code(after.signal), *cells))
    return pages.Table(("Explained, residual rms", "vehicle file>", "sliders>"), rows, label="Fit of each signal")


KINDS = ("step response", "Bode diagram", "handling diagram")


def model_plot(kind: str, given: Vehicle, changed: Vehicle, speed: float, record: Record | None = None) -> Plot:
    """A plot of the linear model with both sets of numbers.

    Args:
        kind: one of `KINDS`.
        speed: m/s.
        record: for the points of the handling diagram.

    Raises:
        FifthwheelError: the vehicle has no such response.
    """
    return Plot(panels=list(map(_together, *[_panels(kind, v, speed, record) for v in (given, changed)])))


def _panels(kind: str, vehicle: Vehicle, speed: float, record: Record | None) -> list[Panel]:
    """Panels with one line each."""
    if kind == "handling diagram":
        return list(plot.handling_diagram(vehicle, [record] if record is not None else []).panels)
    yaw = [f"yaw_rate.{unit.name}" for unit in vehicle.units]
    system = linear_system(vehicle, speed, [*yaw, *[f"roll.{unit.name}" for unit in vehicle.units]])
    if kind == "step response":
        return list(plot.step_response(system).panels)
    return [replace(panel, title=name) for name in yaw for panel in plot.bode(system, name).panels]


def _together(given: Panel, changed: Panel) -> Panel:
    """The line of the vehicle file, dashed, then that of the sliders; points of the first are left out."""
    old = [replace(i, colour=BLUE, dash="dash", name="vehicle file") for i in given.items if isinstance(i, Line)]
    new = [replace(i, colour=VERMILLION, name="sliders") if isinstance(i, Line) else i for i in changed.items]
    points = [item for item in new if isinstance(item, Points)]
    rest = [item for item in new if not isinstance(item, Points)]
    return replace(changed, items=[*points, *old, *rest])
