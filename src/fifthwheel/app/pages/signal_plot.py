"""The plot of a measured signal and its prediction."""

from fifthwheel.plots import Axis, Band, Item, Line, Panel, Plot
from fifthwheel.plots.palette import BLUE, GREY
from fifthwheel.record.signal_names import si_unit
from fifthwheel.workflow import SignalEvidence

HEIGHT = 170
"""Height of the plot of a signal, pixels."""
_PREDICTED = "#d55e00"


def signal_plot(evidence: SignalEvidence | None, signal: str) -> Plot:
    """A signal, and what is predicted for it."""
    items: list[Item] = []
    if evidence is not None and signal in evidence.others:
        time, values = evidence.others[signal]
        items = [Line(time, values, name="measured", colour=BLUE, gaps=False)]
    elif evidence is not None and signal in evidence.channels:
        time, channel = evidence.time, evidence.channels[signal]
        items = [
            Band(time, channel.lowest, channel.highest, name="range of the prediction", colour=GREY),
            Line(time, channel.measured, name="measured", colour=BLUE),
            Line(time, channel.predicted, name="predicted", colour=_PREDICTED, width=1.5),
        ]
    return Plot(panels=[Panel(items=items, x=Axis(label="time", unit="s"), y=Axis(unit=si_unit(signal) or ""))])
