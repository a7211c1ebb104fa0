"""The content of a log: its columns, or its mapped signals."""

from collections.abc import Iterator, Sequence

import numpy as np

from fifthwheel.base import pages
from fifthwheel.base.formatting import digits, percent
from fifthwheel.data.channels import si_unit
from fifthwheel.data.checks import Finding
from fifthwheel.data.logs.propose import ColumnContent, LogSurvey, MapProposal
from fifthwheel.data.record import Record
from fifthwheel.data.record.timestamps import missing_fraction


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
