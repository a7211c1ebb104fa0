"""The content of logs on a terminal: columns, mapped signals, axle loads."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from fifthwheel.checks import Finding
from fifthwheel.checks.axle_loads import StaticLoad
from fifthwheel.formatting import digits, percent, with_sigma
from fifthwheel.logs.mapping.propose import MapProposal
from fifthwheel.logs.mapping.survey import LogSurvey
from fifthwheel.record import Record
from fifthwheel.record.signal_names import si_unit
from fifthwheel.report.terminal.page import TerminalPage
from fifthwheel.vehicle import Vehicle, unit_of

if TYPE_CHECKING:
    from rich.console import Console


def show_survey(survey: LogSurvey, proposal: MapProposal, console: "Console | None" = None) -> None:
    """Print each column of a log with unit, rate, range and missing samples, and the signal it is proposed for."""
    page = TerminalPage(console)
    duration = survey.stop - survey.start
    span = f", {duration:.1f} s" if np.isfinite(duration) else ""
    page.headline(f"{survey.name}: {len(survey.contents)} columns{span}")
    heads = ("Column", "Unit", "Hz>", "From>", "To>", "Missing>", "Proposed for")
    page.table(heads, _columns(survey, proposal))
    page.lists(
        ("Not found", proposal.missing),
        ("Cautions", [str(finding) for finding in proposal.findings]),
        ("Notes", survey.notes),
    )


def _columns(survey: LogSurvey, proposal: MapProposal) -> Iterator[tuple[str, ...]]:
    proposed: dict[str | None, str] = {}
    for channels in (proposal.signals.signals, proposal.signals.reference):
        proposed |= {channel.column: signal for signal, channel in channels.items()}
    for name, content in survey.contents.items():
        present = content.missing < content.samples
        yield (
            name,
            content.column.unit or "",
            f"{content.rate:.3g}" if np.isfinite(content.rate) else "–",
            "text" if content.fault else digits(content.low) if present else "–",
            "" if content.fault else digits(content.high) if present else "–",
            "" if content.fault else percent(content.missing / max(content.samples, 1)) if present else "all",
            proposed.get(name, ""),
        )


def show_record(record: Record, findings: Sequence[Finding], console: "Console | None" = None) -> None:
    """Print the signals of a mapped log in SI, and what looks wrong."""
    page = TerminalPage(console)
    first, last = record.span
    page.headline(f"{record.name}: {len(record)} samples, {first:.2f} to {last:.2f} s, {record.rate:.3g} Hz")
    page.table(("Signal", "Unit", "From>", "To>", "Mean>", "Missing>"), _signals(record))
    page.lists(("Cautions", [str(finding) for finding in findings]), ("Notes", record.notes))


def _signals(record: Record) -> Iterator[tuple[str, ...]]:
    for prefix, columns in (("", record.signals), ("reference.", record.reference)):
        for name, values in columns.items():
            finite = values[np.isfinite(values)]
            numbers = [digits(v) for v in (finite.min(), finite.max(), finite.mean())] if finite.size else ["–"] * 3
            missing = percent(1 - finite.size / values.size) if finite.size else "all"
            yield f"{prefix}{name}", si_unit(name) or "", *numbers, missing


def show_weighed(
    loads: "Mapping[str, StaticLoad]", before: Vehicle, after: Vehicle, console: "Console | None" = None
) -> None:
    """Print measured axle loads and those of the vehicle file, and the masses and CoG positions from them.

    Args:
        before: the vehicle of the file.
        after: the vehicle with masses and CoG positions from the measured loads.
    """
    page = TerminalPage(console)
    old_loads, new_loads = before.axle_loads(), after.axle_loads()
    rows = []
    for path in old_loads:
        load = loads.get(path)
        measured = ("–", "–") if load is None else (f"{load.value / 1e3:.2f}", f"{load.scatter / 1e3:.2f}")
        rows.append((path, *measured, f"{old_loads[path] / 1e3:.2f}", f"{new_loads[path] / 1e3:.2f}"))
    page.table(("Axle group", "Measured, kN>", "Scatter>", "File, kN>", "New, kN>"), rows)
    page.table(
        ("Unit", "New mass, kg>", "File>", "New CoG, m>", "File>"),
        [
            (new.name, f"{new.mass:.0f}", f"{old.mass:.0f}", f"{new.cog:.3f}", f"{old.cog:.3f}")
            for old, new in zip(before.units, after.units, strict=True)
        ],
    )


def show_roll_test(before: Vehicle, after: Vehicle, console: "Console | None" = None) -> None:
    """Print the numbers that a roll test has set.

    Args:
        before: the vehicle of the file.
        after: the vehicle with the result of the test.
    """
    old, new = before.parameters(), after.parameters()
    rows = [
        (path, with_sigma(value, after.stated[path], unit_of(path)), with_sigma(old[path], None, unit_of(path)))
        for path, value in new.items()
        if value != old[path]
    ]
    TerminalPage(console).table(("Parameter", "New>", "File>"), rows)
