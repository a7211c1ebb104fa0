"""What a log holds, on a terminal."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from fifthwheel.report.facts import unit_of
from fifthwheel.report.numbers import digits, percent
from fifthwheel.report.terminal import Page

if TYPE_CHECKING:
    from rich.console import Console

    from fifthwheel.logs import Finding, Record
    from fifthwheel.logs.propose import Proposal
    from fifthwheel.logs.survey import Survey
    from fifthwheel.logs.weigh import Load
    from fifthwheel.vehicle import Vehicle


def show_survey(found: "Survey", proposal: "Proposal", console: "Console | None" = None) -> None:
    """Print every column of a log with unit, rate, range and what is missing, and which signal it is proposed for."""
    page = Page(console)
    chosen: dict[str | None, str] = {}
    for part in (proposal.signals.signals, proposal.signals.reference):
        chosen |= {channel.column: signal for signal, channel in part.items()}
    seconds = found.stop - found.start
    span = f", {seconds:.1f} s" if np.isfinite(seconds) else ""
    page.console.print(page.text(f"{found.name}: {len(found.contents)} columns{span}"), style="bold", highlight=False)
    table = page.table("Column", "Unit", "Hz:>", "From:>", "To:>", "Missing:>", "Proposed for")
    for name, content in found.contents.items():
        there = content.missing < content.samples
        page.row(
            table,
            name,
            content.column.unit or "",
            f"{content.rate:.3g}" if np.isfinite(content.rate) else "–",
            "text" if content.fault else digits(content.low) if there else "–",
            "" if content.fault else digits(content.high) if there else "–",
            "" if content.fault else "all" if not there else percent(content.missing / max(content.samples, 1)),
            chosen.get(name, ""),
        )
    page.show(table)
    page.lists(
        ("Not found", proposal.missing),
        ("Beware", [str(finding) for finding in proposal.findings]),
        ("Notes", found.notes),
    )


def show_record(record: "Record", findings: "Sequence[Finding]", console: "Console | None" = None) -> None:
    """Print what a map made of a log, in SI, and what looks wrong with it."""
    page = Page(console)
    first, last = record.span
    head = f"{record.name}: {len(record)} samples, {first:.2f} to {last:.2f} s, {record.rate:.3g} Hz"
    page.console.print(page.text(head), style="bold", highlight=False)
    table = page.table("Signal", "Unit", "From:>", "To:>", "Mean:>", "Missing:>")
    for part, columns in (("", record.signals), ("reference.", record.reference)):
        for name, values in columns.items():
            seen = values[np.isfinite(values)]
            told = [digits(v) for v in (seen.min(), seen.max(), seen.mean())] if seen.size else ["–"] * 3
            missing = "all" if not seen.size else percent(1 - seen.size / values.size)
            page.row(table, f"{part}{name}", unit_of(name), *told, missing)
    page.show(table)
    page.lists(("Beware", [str(finding) for finding in findings]), ("Notes", record.notes))


def show_weighed(
    loads: "Mapping[str, Load]", before: "Vehicle", after: "Vehicle", console: "Console | None" = None
) -> None:
    """Print axle loads beside those of the vehicle file, and what masses and CoG positions become by them."""
    page = Page(console)
    table = page.table("Axle group", "Weighed, kN:>", "Scatter:>", "File, kN:>", "Now, kN:>")
    expected, now = before.axle_loads(), after.axle_loads()
    for path in expected:
        load = loads.get(path)
        told = ("–", "–") if load is None else (f"{load.value / 1e3:.2f}", f"{load.scatter / 1e3:.2f}")
        page.row(table, path, *told, f"{expected[path] / 1e3:.2f}", f"{now[path] / 1e3:.2f}")
    page.show(table)
    table = page.table("Unit", "Mass, kg:>", "before:>", "CoG, m:>", "before:>")
    for old, new in zip(before.units, after.units, strict=True):
        page.row(table, new.name, f"{new.mass:.0f}", f"{old.mass:.0f}", f"{new.cog:.3f}", f"{old.cog:.3f}")
    page.show(table)
