"""The page of `check --plot`: measured channels with their predictions, before and after the offset is corrected."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fifthwheel.base import pages
from fifthwheel.base.formatting import shown
from fifthwheel.base.pages import html
from fifthwheel.base.plots import Axis, Item, Line, Panel, Plot
from fifthwheel.base.plots.items import BLUE, GREY, VERMILLION
from fifthwheel.base.types import Array
from fifthwheel.data.channels import si_unit
from fifthwheel.data.record import Record
from fifthwheel.estimate.time_bases.offsets import TimeOffset, offsets_of
from fifthwheel.estimate.time_bases.predictions import Prediction, predict_channels
from fifthwheel.truck import Vehicle


def write_time_offsets(path: Path, records: Sequence[Record], vehicle: Vehicle) -> None:
    """Write a page with a figure for each predicted channel of each record.

    Raises:
        OSError: the file cannot be written.
    """
    blocks: list[pages.Block] = []
    for k, record in enumerate(records):
        blocks.append(pages.Heading(record.name, key=f"log{k}"))
        prediction = predict_channels(record, vehicle)
        if prediction is None:
            blocks.append(pages.Hint("No channel can be predicted from speed and steer angle."))
        else:
            offsets = {offset.name: offset for offset in offsets_of(record, prediction)}
            channels = enumerate(prediction.names)
            blocks.append(pages.Plots([_figure(prediction, c, offsets.get(n), record.name) for c, n in channels]))
    subtitle = "Measured channels and their predictions from speed and steer"
    html.write(path, pages.Document(f"Time offsets, {vehicle.name}", blocks, subtitle))


def _note(offset: TimeOffset | None) -> str:
    if offset is None:
        return "without offset: the reference, or not measurable"
    late = f"{offset.offset:+.2f} ± {offset.sigma:.2f} s late" if offset.offset else "on time"
    return f"{late}{'' if offset.significant else ' (not significant)'}, explained {offset.explained:.0%}"


def _figure(prediction: Prediction, channel: int, offset: TimeOffset | None, log: str) -> pages.CaptionedPlot:
    """A channel as measured, its prediction, and the prediction delayed by the offset, fitted with gain and bias."""
    name, time = prediction.names[channel], prediction.time
    unit, measured = shown(si_unit(name)), prediction.measured[:, channel]
    predicted = prediction.predicted[0, :, channel]
    delayed = predicted if offset is None else np.interp(time - offset.offset, time, predicted)
    both = np.isfinite(measured) & np.isfinite(delayed)
    gain, bias = np.polyfit(delayed[both], measured[both], 1) if both.sum() > 2 else (1.0, 0.0)

    def line(values: Array, **style: Any) -> Line:
        return Line(time, values * unit.factor, gaps=True, **style)

    items: list[Item] = [
        line(measured, name="measured", colour=GREY, width=1.2),
        line(gain * predicted + bias, name="predicted", colour=BLUE),
    ]
    if offset is not None and offset.significant:
        items.append(line(gain * delayed + bias, name="predicted, delayed", colour=VERMILLION, dash="dash"))
    plot = Plot(panels=[Panel(items=items, x=Axis(label="time", unit="s"), y=Axis(unit=unit.name))])
    return pages.CaptionedPlot(name, plot, group=f"time {log}", path=(log, "time", name), note=_note(offset))
