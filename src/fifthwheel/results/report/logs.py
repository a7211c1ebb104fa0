"""Logs: their columns or mapped signals, and the time offsets of their channels."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fifthwheel.base import pages
from fifthwheel.base.formatting import digits, percent, shown
from fifthwheel.base.pages import html
from fifthwheel.base.plots import Axis, Item, Line, Panel, Plot
from fifthwheel.base.plots.items import BLUE, GREY, VERMILLION
from fifthwheel.base.types import Array
from fifthwheel.data.channels import si_unit
from fifthwheel.data.checks import Finding
from fifthwheel.data.logs.propose import MapProposal
from fifthwheel.data.logs.survey import ColumnContent, LogSurvey
from fifthwheel.data.record import Record
from fifthwheel.data.record.timestamps import missing_fraction
from fifthwheel.estimate.time_bases.offsets import TimeOffset, offsets_of
from fifthwheel.estimate.time_bases.predictions import Prediction, predict_channels
from fifthwheel.truck import Vehicle


def survey_document(survey: LogSurvey, proposal: MapProposal) -> pages.Document:
    """Each column of a log with unit, rate, range and empty cells, and the signal it is proposed for."""
    duration = survey.stop - survey.start
    span = f", {duration:.1f} s" if np.isfinite(duration) else ""
    heads = ("Column", "Unit", "Hz>", "From>", "To>", "Empty>", "Proposed for")
    blocks = (
        pages.Headline(f"{survey.name}: {len(survey.contents)} columns{span}"),
        pages.Table(heads, list(_columns(survey, proposal))),
        pages.Items(proposal.missing, "Not found"),
        pages.Items(list(map(str, proposal.findings)), "Cautions"),
        pages.Items(survey.notes, "Notes"),
    )
    return pages.Document(survey.name, blocks)


def _columns(survey: LogSurvey, proposal: MapProposal) -> Iterator[tuple[str, ...]]:
    proposed: dict[str | None, str] = {}
    for channels in (proposal.signals.signals, proposal.signals.reference):
        proposed |= {channel.column: signal for signal, channel in channels.items()}
    for name, content in survey.contents.items():
        yield name, *column_cells(content), proposed.get(name, "")


def column_cells(content: ColumnContent) -> tuple[str, str, str, str, str]:
    """Unit, rate, range and the fraction of empty cells of a column."""
    unit, rate = content.column.unit or "", f"{content.rate:.3g}" if np.isfinite(content.rate) else "–"
    if content.fault:
        return unit, rate, "text", "", ""
    if content.missing >= content.samples:
        return unit, rate, "–", "–", "all"
    return unit, rate, digits(content.low), digits(content.high), percent(content.missing / content.samples)


def record_document(record: Record, findings: Sequence[Finding]) -> pages.Document:
    """The signals of a mapped log in SI, and what looks wrong."""
    first, last = record.span
    extent = f"{len(record)} samples, {first:.2f} to {last:.2f} s, {record.rate:.3g} Hz"
    blocks = (
        pages.Headline(f"{record.name}: {extent}"),
        pages.Table(("Signal", "Unit", "From>", "To>", "Mean>", "Missing>"), list(_signals(record))),
        pages.Items(list(map(str, findings)), "Cautions"),
        pages.Items(record.notes, "Notes"),
    )
    return pages.Document(record.name, blocks)


def _signals(record: Record) -> Iterator[tuple[str, ...]]:
    for prefix, columns in (("", record.signals), ("reference.", record.reference)):
        for name, values in columns.items():
            finite = values[np.isfinite(values)]
            numbers = [digits(v) for v in (finite.min(), finite.max(), finite.mean())] if finite.size else ["–"] * 3
            missing = percent(missing_fraction(record.time, values)) if finite.size else "all"
            yield f"{prefix}{name}", si_unit(name) or "", *numbers, missing


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
