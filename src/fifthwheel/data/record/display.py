"""A record as a plot and as a table of its channels."""

from collections.abc import Mapping, Sequence

import numpy as np

from fifthwheel.base import pages
from fifthwheel.base.errors import SignalError, suggestion
from fifthwheel.base.formatting import digits, percent, shown
from fifthwheel.base.pages.html import course, notebook
from fifthwheel.base.plots import Axis, Line, Panel, Plot
from fifthwheel.base.plots.items import CYCLE
from fifthwheel.base.types import Array
from fifthwheel.data.channels import CHANNELS, SignalName, split_reference
from fifthwheel.data.record.timestamps import missing_fraction, typical_step


def channel_plot(time: Array, channels: Mapping[str, Array], names: Sequence[str], title: str) -> Plot:
    """One panel for each quantity, with one line for each of its channels (N,), SI, over the time (N,), s.

    Channels named "reference.<name>" are dashed. Without names all are drawn; a SignalError for an unknown name.
    """
    for name in names:
        if name not in channels:
            raise SignalError(f"{name}: not in {title}; {suggestion(name, channels)}")
    signals = {name: SignalName.of(split_reference(name)[0]) for name in names or channels}
    by_quantity: dict[str, list[str]] = {}
    for name, signal in signals.items():
        by_quantity.setdefault(signal.quantity, []).append(name)
    places = dict.fromkeys(signal.place for signal in signals.values())
    colours = {place: CYCLE[k % len(CYCLE)] for k, place in enumerate(places)}
    panels = []
    for quantity, members in by_quantity.items():
        unit = shown(CHANNELS[quantity].unit)
        lines = [_line(time, channels[name] * unit.factor, name, colours) for name in members]
        label = Axis(label=quantity.replace("_", " "), unit=unit.name)
        panels.append(Panel(items=lines, x=Axis(label="time", unit="s"), y=label))
    return Plot(panels=panels, title=title)


def _line(time: Array, values: Array, name: str, colours: Mapping[str, str]) -> Line:
    signal, reference = split_reference(name)
    place = SignalName.of(signal).place
    label = ", ".join(filter(None, (place, "reference" if reference else "")))
    return Line(time, values, name=label, colour=colours[place], dash="dash" if reference else "solid", gaps=True)


def channel_page(time: Array, channels: Mapping[str, Array], name: str, extent: str, notes: Sequence[str]) -> str:
    """What a notebook shows of a record: a table of its channels, and its notes."""
    table = channel_table(time, channels)
    return notebook(pages.Document(name, [pages.Paragraph(extent), table, pages.Items(notes)]))


def channel_table(time: Array, channels: Mapping[str, Array]) -> pages.Table:
    """Unit, rate, range, missing samples and course of each channel."""
    rows = [_row(time, name, values) for name, values in channels.items()]
    return pages.Table(("Signal", "Unit", "Rate", "Lowest", "Highest", "Missing", "Course"), rows)


def _row(time: Array, name: str, values: Array) -> tuple[pages.Cell, ...]:
    present = np.isfinite(values)
    unit = shown(CHANNELS[SignalName.of(split_reference(name)[0]).quantity].unit)
    step = typical_step(time[present])
    rate = f"{1 / step:.3g} Hz" if step > 0 else "–"
    ends = [values[present].min(), values[present].max()] if present.any() else [np.nan, np.nan]
    low, high = (digits(float(end) * unit.factor, 3) for end in ends)
    missing = percent(fraction) if (fraction := missing_fraction(time, values)) else ""
    return name, unit.name, rate, low, high, missing, course(time, values)
