"""The plot of measured and predicted signals."""

from collections.abc import Iterator

from fifthwheel.app.layout import plain
from fifthwheel.plots import Axis, Band, Line, Panel, Plot
from fifthwheel.plots.palette import BLUE, GREY
from fifthwheel.record.signal_names import si_unit
from fifthwheel.workflow import SignalEvidence

_PANEL = 150
"""Height of a panel, pixels."""
_PREDICTED = "#d55e00"


def evidence_plot(evidence: SignalEvidence) -> Plot | None:
    """A panel for each signal; None where there is none."""
    panels = list(_panels(evidence))
    return Plot(panels=panels) if panels else None


def height_of(plot: Plot) -> int:
    """Height of the plot, pixels."""
    return 110 + _PANEL * len(plot.panels)


def _panels(evidence: SignalEvidence) -> Iterator[Panel]:
    axis = Axis(label="time", unit="s")
    for name, (time, values) in evidence.others.items():
        items = [Line(time, values, name="measured", colour=BLUE, gaps=False)]
        yield Panel(title=plain(name), items=items, x=axis, y=Axis(unit=si_unit(name) or ""))
    for name, channel in evidence.channels.items():
        time = evidence.time
        yield Panel(
            title=plain(name),
            items=[
                Band(time, channel.lowest, channel.highest, name="range of the prediction", colour=GREY),
                Line(time, channel.measured, name="measured", colour=BLUE),
                Line(time, channel.predicted, name="predicted", colour=_PREDICTED, width=1.5),
            ],
            x=axis,
            y=Axis(unit=si_unit(name) or ""),
        )
