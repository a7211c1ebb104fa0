"""The knowledge of a truck for people: its estimates, and the history of its logs."""

from collections.abc import Iterator, Sequence

import numpy as np

from fifthwheel.base import pages
from fifthwheel.base.formatting import approximate, shown, with_sigma
from fifthwheel.base.plots import Axis, Band, Guide, Item, Line, Panel, Plot, Points
from fifthwheel.base.plots.items import BLUE
from fifthwheel.estimate.identify.knowledge.history import (
    EstimateHistory,
    LogEntry,
    SharedEstimate,
    estimate_histories,
    history,
)
from fifthwheel.estimate.identify.knowledge.knowledge import Knowledge
from fifthwheel.results.report.words import counted
from fifthwheel.truck import unit_of
from fifthwheel.truck.spoken_names import spoken

LEAST_SPAN = 600e3
"""Of the axis of dates, ms, so that its ticks are whole minutes."""


def knowledge_document(estimates: Sequence[SharedEstimate], logs: int, *, everything: bool = False) -> pages.Document:
    """Estimates of parameters from all logs; with `everything` uncertain numbers and sensor errors too."""
    others = [estimate for estimate in estimates if not estimate.estimated]
    headline = f"{counted(logs, 'log')}, {counted(len(estimates) - len(others), 'estimated parameter')}."
    blocks: list[pages.Block] = [
        pages.Headline(headline),
        _estimates([estimate for estimate in estimates if estimate.estimated], "Estimated parameters"),
    ]
    if everything:
        blocks += [pages.Heading("Uncertain numbers and sensor errors"), _estimates(others, "Other shared unknowns")]
    else:
        blocks.append(pages.Hint(f"{counted(len(others), 'more shared unknown')}: --all"))
    return pages.Document("Knowledge", blocks)


def _estimates(estimates: Sequence[SharedEstimate], label: str) -> pages.Table:
    rows = [
        (pages.Hinted(spoken(e.name), e.name), with_sigma(e.value, e.sigma, e.unit), e.belongs_to, e.log)
        for e in estimates
    ]
    return pages.Table(("Parameter|name", "Value|main", "Belongs to", "Last log"), rows, label=label)


def history_document(entries: Sequence[LogEntry]) -> pages.Document:
    """The logs in the order of their dates: what each added, what changed before it, doubts."""
    blocks: list[pages.Block] = [
        _headline(entries),
        _logs(entries),
        pages.Heading("Sigma before and after each log"),
        _added(entries),
    ]
    return pages.Document("History", blocks)


def truck_history_document(knowledge: Knowledge) -> pages.Document:
    """Estimates, their histories as plots, and the logs, for a page."""
    histories, entries = estimate_histories(knowledge), history(knowledge)
    blocks: list[pages.Block] = [
        _headline(entries),
        _estimates([each.last for each in histories], "Estimated parameters"),
        *_plots(histories),
        pages.Heading("Logs"),
        _logs(entries),
        pages.Folded("Sigma before and after each log", [_added(entries)]),
    ]
    return pages.Document("Truck's history", blocks)


def _plots(histories: Sequence[EstimateHistory]) -> Iterator[pages.Block]:
    yield pages.Heading("Histories")
    if all(len(np.unique(each.time)) < 2 for each in histories):
        yield pages.Hint("A history needs logs of two dates: identify another log with this result as its vehicle.")
        return
    yield pages.Hint("Estimates from all logs at the date of each log; band of two sigma. Vertical lines: changes.")
    yield pages.Plots([_plot(each) for each in histories])


def _plot(each: EstimateHistory) -> pages.CaptionedPlot:
    unit, dates = shown(each.last.unit), 1000 * each.time
    value, sigma = each.value * unit.factor, each.sigma * unit.factor
    items: list[Item] = []
    for part in np.split(np.arange(len(dates)), np.searchsorted(each.time, np.sort(each.changes))):
        if len(part):  # from one change to the next
            name = "" if items else "all logs, ± 2 sigma"
            x, y, spread = dates[part], value[part], sigma[part]
            items += [Band(x, y - 2 * spread, y + 2 * spread, colour=BLUE), Line(x, y, name=name, colour=BLUE)]
    items.append(Points(dates, value, y_sigma=sigma, name="at a log, ± sigma", colour=BLUE, size=6))
    items += [Guide(x=float(1000 * at), colour="#bbbbbb", width=1, dash="solid") for at in each.changes]
    title = f"{spoken(each.last.name)} ({each.last.belongs_to})"
    margin = max(0.05 * np.ptp(dates), (LEAST_SPAN - np.ptp(dates)) / 2)
    visible = (float(dates.min() - margin), float(dates.max() + margin))
    axis = Axis(label="date of the log", date=True, range=visible)
    plot = Plot(title=title, panels=[Panel(items=items, x=axis, y=Axis(unit=unit.name))])
    return pages.CaptionedPlot(spoken(each.last.name), plot, "knowledge", ("", "history", title))


def _headline(entries: Sequence[LogEntry]) -> pages.Headline:
    unused = sum(bool(entry.unused) for entry in entries)
    left = f", {unused} of them not used" if unused else ""
    return pages.Headline(f"{counted(len(entries), 'log')}{left}.")


def _logs(entries: Sequence[LogEntry]) -> pages.Table:
    rows = [
        (e.log.name, f"{e.log.date:%Y-%m-%d %H:%M}", e.log.trailer or "–", e.log.load or "–", "; ".join(_remarks(e)))
        for e in entries
    ]
    return pages.Table(("Log|name", "Date|w", "Trailer", "Load", "Remark|full-text"), rows, label="Logs")


def _added(entries: Sequence[LogEntry]) -> pages.Table:
    rows = [
        (e.log.name, pages.Hinted(spoken(name), name), approximate(before, unit), approximate(after, unit))
        for e in entries
        for name, (before, after) in e.sigmas.items()
        for unit in [unit_of(name)]
    ]
    return pages.Table(("Log|name", "Parameter|name", "Before>", "After>"), rows, label="Sigma of each log")


def _remarks(entry: LogEntry) -> list[str]:
    doubts = [f"doubtful: {doubt}" for doubt in entry.log.doubts]
    return [*entry.changes, *([f"not used: {entry.unused}"] if entry.unused else []), *doubts]
