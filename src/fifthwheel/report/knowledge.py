"""The knowledge of a truck for people: its estimates, and the history of its logs."""

from collections.abc import Sequence

from fifthwheel import pages
from fifthwheel.formatting import approximate, with_sigma
from fifthwheel.identify.knowledge.history import LogEntry, SharedEstimate
from fifthwheel.report.words import counted
from fifthwheel.vehicle import unit_of


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
        (
            pages.Code(e.name),
            with_sigma(e.value, e.sigma, e.unit),
            e.belongs_to,
            e.log,
            e.date[:10],
        )
        for e in estimates
    ]
    return pages.Table(("Parameter|name", "Value|main", "Belongs to", "Last log", "Date|w"), rows, label=label)


def history_document(entries: Sequence[LogEntry]) -> pages.Document:
    """The logs in the order of their dates: what each added, what changed before it, doubts."""
    unused = sum(bool(entry.unused) for entry in entries)
    left = f", {unused} of them not used" if unused else ""
    blocks: list[pages.Block] = [pages.Headline(f"{counted(len(entries), 'log')}{left}.")]
    rows = [
        (e.log.name, f"{e.log.date:%Y-%m-%d %H:%M}", e.log.trailer or "–", e.log.load or "–", "; ".join(_remarks(e)))
        for e in entries
    ]
    blocks.append(pages.Table(("Log|name", "Date|w", "Trailer", "Load", "Remark|full-text"), rows, label="Logs"))
    added = [
        (e.log.name, pages.Code(name), approximate(before, unit), approximate(after, unit))
        for e in entries
        for name, (before, after) in e.sigmas.items()
        for unit in [unit_of(name)]
    ]
    blocks += [
        pages.Heading("Sigma before and after each log"),
        pages.Table(("Log|name", "Parameter|name", "Before>", "After>"), added, label="Sigma of each log"),
    ]
    return pages.Document("History", blocks)


def _remarks(entry: LogEntry) -> list[str]:
    doubts = [f"doubtful: {doubt}" for doubt in entry.log.doubts]
    return [*entry.changes, *([f"not used: {entry.unused}"] if entry.unused else []), *doubts]
