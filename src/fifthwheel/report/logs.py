"""The logs of a result: how they were driven, and what was used of them."""

from collections.abc import Iterator, Sequence

from fifthwheel import pages
from fifthwheel.diagnose.run_summary import RunSummary
from fifthwheel.formatting import fixed, kmh, percent, seconds
from fifthwheel.identify import Identification
from fifthwheel.record import Record
from fifthwheel.report.provenance import Provenance

LOGS = (
    pages.Head("Log", "name"),
    pages.Head("Use", "w"),
    pages.Head("Span, s", "n", "span, s: "),
    pages.Head("Samples", "n", "samples: "),
    pages.Head("Used", "n", "used: "),
    pages.Head("Speed", "n", "speed: "),
    pages.Head("Lateral acc., m/s²", "n", "lateral acceleration, m/s²: "),
    pages.Head("Most rejected", "", "most rejected: "),
)


def logs_and_origin(
    records: Sequence[Record],
    runs: Sequence[RunSummary],
    provenance: Provenance | None,
    identification: Identification | None = None,
) -> Iterator[pages.Block]:
    """How each log was driven, what an identification used of it, and how to reproduce the result."""
    yield pages.Hint("Lateral acceleration: largest magnitude of speed × yaw rate, averaged over 0.5 s.")
    yield _table(records, runs, identification)
    if provenance is not None:
        yield from provenance.blocks()


def _table(records: Sequence[Record], runs: Sequence[RunSummary], identification: Identification | None) -> pages.Table:
    summaries = {log.name: log for log in identification.logs} if identification else {}
    spans = {record.name: (record.span, len(record)) for record in records}
    spans |= {name: (log.span, log.samples) for name, log in summaries.items()}
    by_name = {run.name: run for run in runs}
    rows = []
    for name in dict.fromkeys([*summaries, *spans]):
        (first, last), samples = spans[name]
        log, run = summaries.get(name), by_name[name]
        channel, rejected = max(log.rejected.items() if log else (), key=lambda item: item[1], default=("", 0.0))
        worst = f"{percent(rejected)} of {channel}" if rejected else "none"
        cells = (
            name,
            "identification" if log else "validation" if identification else "states",
            f"{first:.1f} to {last:.1f}",
            fixed(samples, 0),
            seconds(log.used) if log else "–",
            kmh(log.speed if log else run.speed),
            "–" if run.acceleration != run.acceleration else f"{run.acceleration:.2f}",
            worst if log else "–",
        )
        rows.append(cells if identification else cells[:-1])
    return pages.Table(LOGS if identification else LOGS[:-1], rows)
