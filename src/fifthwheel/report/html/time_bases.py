"""The page of `check --plot`: measured channels with their predictions, before and after the offset is corrected."""

from collections.abc import Sequence
from html import escape
from pathlib import Path

import numpy as np

from fifthwheel.formatting import shown
from fifthwheel.plots.palette import BLUE, GREY, VERMILLION
from fifthwheel.record import Record
from fifthwheel.record.signal_names import si_unit
from fifthwheel.report.figures import primitives
from fifthwheel.report.figures.primitives import ReportPlot
from fifthwheel.report.html.page import write_page
from fifthwheel.report.html.page_builder import CaptionedPlot, PageBuilder
from fifthwheel.time_bases.offsets import TimeOffset, offsets_of
from fifthwheel.time_bases.predictions import Prediction, predict_channels
from fifthwheel.vehicle import Vehicle


def write_time_offsets(path: Path, records: Sequence[Record], vehicle: Vehicle) -> None:
    """Write a page with a figure for each predicted channel of each record.

    Raises:
        OSError: the file cannot be written.
    """
    page = PageBuilder(f"Time offsets, {vehicle.name}", "Measured channels and their predictions from speed and steer")
    for k, record in enumerate(records):
        prediction = predict_channels(record, vehicle)
        page.heading(f"log{k}", record.name)
        if prediction is None:
            page.hint("No channel can be predicted from speed and steer angle.")
            continue
        offsets = {offset.name: offset for offset in offsets_of(record, prediction)}
        page.figures(
            CaptionedPlot(escape(name), _note(offsets.get(name)), _plot(prediction, c, offsets.get(name), record.name))
            for c, name in enumerate(prediction.names)
        )
    write_page(path, title=page.title, body=page.body(), plots=page.plots)


def _note(offset: TimeOffset | None) -> str:
    if offset is None:
        return "without offset: the reference, or not measurable"
    late = f"{offset.offset:+.2f} ± {offset.sigma:.2f} s late" if offset.offset else "on time"
    return f"{late}{'' if offset.significant else ' (not significant)'}, explained {offset.explained:.0%}"


def _plot(prediction: Prediction, channel: int, offset: TimeOffset | None, log: str) -> ReportPlot:
    """A channel as measured, its prediction, and the prediction delayed by the offset, fitted with gain and bias."""
    name, time = prediction.names[channel], prediction.time
    unit, measured, predicted = (
        shown(si_unit(name)),
        prediction.measured[:, channel],
        prediction.predicted[0, :, channel],
    )
    delayed = predicted if offset is None else np.interp(time - offset.offset, time, predicted)
    both = np.isfinite(measured) & np.isfinite(delayed)
    gain, bias = np.polyfit(delayed[both], measured[both], 1) if both.sum() > 2 else (1.0, 0.0)
    data = [
        primitives.line(time, measured * unit.factor, "measured", GREY, width=1.2),
        primitives.line(time, (gain * predicted + bias) * unit.factor, "predicted", BLUE),
    ]
    if offset is not None and offset.significant:
        data.append(
            primitives.line(time, (gain * delayed + bias) * unit.factor, "predicted, delayed", VERMILLION, dash="dash")
        )
    layout = primitives.layout("time, s", unit.name)
    return ReportPlot(group=f"time {log}", figure={"data": data, "layout": layout}, name=(log, "time", name))
