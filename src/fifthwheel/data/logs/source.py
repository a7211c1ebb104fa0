"""A log file of any format: named columns of samples, described when it is opened and read in chunks."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Self

from fifthwheel.base.errors import SignalError, suggestion
from fifthwheel.base.names import split_source
from fifthwheel.base.types import Array
from fifthwheel.data.channels import split_header
from fifthwheel.data.record.timestamps import TimestampFilter

PARTS = 8
"""Of a large file that are read as its sample."""
_LARGE = 100e6
"""Bytes of a file from which on it is sampled, if the caller wants a sample."""
_PART = 3e6
"""Bytes of a part, at least."""
_SAMPLED = 0.08
"""Fraction of a file that its parts hold, at least; checks of a record with less refuse it as mostly gaps."""

ReadProgress = Callable[[float], None]
"""Receives the fraction of the file that has been read, 0 to 1; may raise an exception to stop."""


def no_progress(done: float) -> None:
    """Ignores the progress."""


def reason(error: Exception) -> str:
    """What an exception of a library says, in one line; its type where it says nothing."""
    return " ".join(str(error).split())[:200] or type(error).__name__


@contextmanager
def damage() -> Iterator[list[str]]:
    """A list that gets the reason where the block fails: in a library, damaged bytes can cause any exception.

    A MemoryError passes, because the reading process has a limit.
    """
    troubles: list[str] = []
    try:
        yield troubles
    except MemoryError:
        raise
    except Exception as error:
        troubles.append(reason(error))


@dataclass(frozen=True, kw_only=True)
class Column:
    """A column of a table, a channel of a recording, or a signal of a message."""

    name: str
    """As in the file and unique in it, without the unit."""
    unit: str | None = None
    """As in the file; None where the file has none."""
    clock: str = ""
    """Columns with the same one are sampled together; "" is that of the rows of a table."""
    time_base: str = ""
    """Name of the physical clock behind the timestamps, where it is not that of the logger; "" is the logger's."""
    sensor: str = ""
    """What the file states of the sensor: a `data.channels.sensors.SensorPrior` as JSON."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Chunk:
    """Consecutive samples of the columns of one time base."""

    values: Mapping[str, Array]
    """Column name to (n,) values in the file's unit, NaN where missing."""
    time: Array | None = None
    """(n,) s, timestamps of the samples; None in a table, where time is one of the columns."""
    clock: str = ""
    """Time base of the columns."""
    done: float = 0.0
    """Fraction of the file that has been read, 0 to 1."""


def find_column(text: str, columns: Collection[str], log: str) -> str:
    """`LogSource.find` among the names of columns; `log` is for messages."""
    if text in columns:
        return text
    name = split_header(text)[0]
    if name in columns:
        return name
    alike = [column for column in columns if split_source(column)[0] == name]
    if len(alike) == 1:
        return alike[0]
    if alike:
        raise SignalError(f"{log}: column {name!r} has several sources; say which: {', '.join(alike)}")
    raise SignalError(f"{log}: no column {name!r}; {suggestion(name, list(columns))}")


def unused_name(name: str, used: Collection[str]) -> str:
    """The name with as many apostrophes as make it unique."""
    while name in used:
        name += "'"
    return name


class LogSource(ABC):
    """An open log: its columns, and its samples in chunks, so that memory does not grow with the file."""

    def __init__(self, name: str, columns: Mapping[str, Column]) -> None:
        self.name = name
        """File name, for messages."""
        self.columns = columns
        """By name, in the order of the file."""
        self.notes: list[str] = []
        """What was left out or is damaged, one sentence each; complete after all chunks are read."""
        self.unusable: dict[str, str] = {}
        """Requested columns without numbers, with the reason; all NaN. Complete after all chunks are read."""
        self.time: str | None = None
        """The column with the time of a table's rows, as far as it was found; see `row_time`."""
        self.start: float | None = None
        """Date and time of instant 0, s since 1970, where the file has one and its timestamps count from there."""
        self.sampled = False
        """Whether only a sample of the file is read; see `sample`."""
        self.pauses = 0.0
        """s, of all pauses between the logs that it joins."""
        self.size = 0
        """Bytes of a file that can be sampled; 0 where the reader cannot skip a part."""
        self.opening_notes: list[str] = []
        """Notes that do not depend on the columns that are read."""

    @abstractmethod
    def chunks(self, columns: Collection[str]) -> Iterator[Chunk]:
        """The samples of the requested columns in the order of time, one time base in each chunk.

        May be called again. A damaged file gives its intact samples, and a note that says where the damage begins.
        """

    def sample(self) -> None:
        """Read only a sample of a large file, which a note describes: parts that are spread evenly over it."""
        if self.size > _LARGE:
            self.sampled = True
            read = f"a sample of {PARTS * part_size(self.size) / 1e6:.0f} of {self.size / 1e6:.0f} MB was read"
            self.opening_notes.append(
                f"{read}, in {PARTS} parts of the file: ranges, missing samples and findings are those of the sample"
            )
            self.note(*self.opening_notes)

    def find(self, text: str) -> str:
        """Name of the column that a text refers to: its name, its name with a unit in brackets, or without "@source".

        A SignalError if no column, or more than one, has that name.
        """
        return find_column(text, self.columns, self.name)

    def by_clock(self, columns: Collection[str]) -> dict[str, list[str]]:
        """Columns by their clocks, in the order of the log; SignalError for one that is not there."""
        for name in columns:
            if name not in self.columns:
                raise SignalError(f"{self.name}: no column {name!r}; {suggestion(name, list(self.columns))}")
        requested = set(columns)
        clocks: dict[str, list[str]] = {}
        for name, column in self.columns.items():
            if name in requested:
                clocks.setdefault(column.clock, []).append(name)
        return clocks

    def note(self, *notes: str) -> None:
        """Add notes that are not there yet; a log that is read twice repeats them."""
        self.notes.extend(note for note in notes if note not in self.notes)

    def increasing(self, chunks: Iterable[Chunk]) -> Iterator[Chunk]:
        """The samples whose timestamps increase on their time base, and at the end a note on those left out."""
        stamps = TimestampFilter()
        for chunk in chunks:
            assert chunk.time is not None
            kept = stamps.keep(chunk.clock, chunk.time)
            if kept.any():
                values = {name: values[kept] for name, values in chunk.values.items()}
                yield replace(chunk, values=values, time=chunk.time[kept])
        self.note(*stamps.notes)

    def close(self) -> None:  # noqa: B027  what holds no file has nothing to close
        """Close the file."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


def part_size(size: int) -> int:
    """Bytes of each part of a file of this size, bytes."""
    return int(max(_PART, _SAMPLED * size / PARTS))


def parts_of(count: int, size: int) -> list[tuple[int, int]]:
    """First of each part, and the one after its last, of `count` samples of a file of this size, bytes."""
    length = min(count, max(1, round(count * part_size(size) / size)))
    starts = [k * (count - length) // (PARTS - 1) for k in range(PARTS)]
    parts: list[tuple[int, int]] = []
    for start in starts:  # those of few samples overlap
        first = max(start, parts[-1][1]) if parts else start
        parts += [(first, start + length)] if start + length > first else []
    return parts
