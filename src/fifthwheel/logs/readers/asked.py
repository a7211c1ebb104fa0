"""What somebody asks a log for."""

from collections.abc import Collection

from fifthwheel.errors import SignalError
from fifthwheel.logs.log import Log
from fifthwheel.logs.names import suggest


def by_clock(log: Log, columns: Collection[str]) -> dict[str, list[str]]:
    """Columns by their clocks, in the order of the log; SignalError for one that is not there."""
    for name in columns:
        if name not in log.columns:
            raise SignalError(f"{log.name}: no column {name!r}; {suggest(name, list(log.columns))}")
    clocks: dict[str, list[str]] = {}
    asked = set(columns)
    for name, column in log.columns.items():
        if name in asked:
            clocks.setdefault(column.clock, []).append(name)
    return clocks
