"""A log as it lies on disk: named columns of samples, told what they are at once and read in pieces, in any format."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from fifthwheel.errors import SignalError
from fifthwheel.logs.names import split_header, suggest

Array = NDArray[np.float64]
Progress = Callable[[float], None]
"""Told how much of the file is read, 0 to 1; may raise to stop."""


def quiet(done: float) -> None:
    """Progress that nobody watches."""


@dataclass(frozen=True, kw_only=True)
class Column:
    """One column of a log, or one channel, or one signal of a message."""

    name: str
    """As in the file and unique in it, without the unit."""
    unit: str | None = None
    """As in the file; None where it does not say."""
    clock: str = ""
    """Columns of one clock are sampled together; "" is that of the rows of a table."""
    about: str = ""
    """What the file says of it besides."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Piece:
    """Consecutive samples of the columns of one clock."""

    values: Mapping[str, Array]
    """Column name to (n,) values in the file's unit, NaN where missing."""
    time: Array | None = None
    """(n,) s, stamps of the samples; None in a table, where time is a column like others."""
    clock: str = ""
    done: float = 0.0
    """Share of the file that has been read, 0 to 1."""


class Log(ABC):
    """A log that has been opened: what it holds, and its samples in pieces, so that memory does not grow with it."""

    def __init__(self, name: str) -> None:
        self.name = name
        """File name, for messages."""
        self.notes: list[str] = []
        """What was left out or is damaged, a sentence each; complete once all pieces are read."""
        self.unusable: dict[str, str] = {}
        """Columns asked for that hold no numbers, and why; all NaN, and complete once all pieces are read."""

    @property
    @abstractmethod
    def columns(self) -> Mapping[str, Column]:
        """What the log holds, by name, in the order of the file."""

    @abstractmethod
    def pieces(self, columns: Collection[str]) -> Iterator[Piece]:
        """The samples of some columns: each piece holds all those asked for of its clock, in the order of time.

        May be called again. A file that is damaged gives what is intact before, and a note that says where it broke.
        """

    def find(self, text: str) -> str:
        """Name of the column that is meant: by its name, with its unit in brackets, or without its "@source".

        Raises SignalError where there is none, or more than one.
        """
        if text in self.columns:
            return text
        name = split_header(text)[0]
        if name in self.columns:
            return name
        alike = [column for column in self.columns if column.partition("@")[0] == name]
        if len(alike) == 1:
            return alike[0]
        if alike:
            raise SignalError(f"{self.name}: column {name!r} has several sources; say which: {', '.join(alike)}")
        raise SignalError(f"{self.name}: no column {name!r}; {suggest(name, list(self.columns))}")

    def close(self) -> None:  # noqa: B027  what holds no file has nothing to close
        """Let go of the file."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
