"""CAN frames in batches of arrays, as every reader of a bus log gives them."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fifthwheel.errors import SignalError


@dataclass(frozen=True, kw_only=True, eq=False)
class Frames:
    """Consecutive data frames; error frames and remote frames are not among them."""

    time: NDArray[np.float64]
    """(n,) s, finite, as the log has it: from its beginning, or since 1970."""
    id: NDArray[np.uint32]
    """(n,) 11 or 29 bits, without flags."""
    extended: NDArray[np.bool_]
    """(n,) whether the id has 29 bits."""
    bus: NDArray[np.int32]
    """(n,) number of the bus as the log counts."""
    data: NDArray[np.uint8]
    """(n, width) payload, zeros beyond its length; width >= 8."""
    length: NDArray[np.int32]
    """(n,) bytes of payload."""
    notes: tuple[str, ...] = ()
    """What to tell the user of the reading so far; a reader says it once, with its last batch."""

    def __len__(self) -> int:
        return int(self.time.size)


Batches = Callable[[], Iterator[tuple[Frames, float]]]
"""Reads a log from its beginning whenever it is called: batches, and the share of the log read with each, 0 to 1."""


def no_frames(notes: tuple[str, ...] = ()) -> Frames:
    """A batch without frames, for notes."""
    return Frames(
        time=np.empty(0),
        id=np.empty(0, np.uint32),
        extended=np.empty(0, np.bool_),
        bus=np.empty(0, np.int32),
        data=np.empty((0, 8), np.uint8),
        length=np.empty(0, np.int32),
        notes=notes,
    )


def counted(*said: tuple[int, str]) -> tuple[str, ...]:
    """Notes of how many of what were left out, where there were any."""
    return tuple(f"{count} {what}{'s' * (count > 1)} left out" for count, what in said if count)


def read_frames(path: Path) -> Iterator[tuple[Frames, float]]:
    """The frames of a BLF, ASC, PCAN or candump file, told by its content, about 50 000 at a time.

    What is damaged is left out and told in the notes of the last batch. Raises SignalError for a file that is none of
    these or cannot be read; one that holds no frame gives one empty batch.
    """
    from fifthwheel.logs.can.blf import read_blf
    from fifthwheel.logs.can.dialects import dialect_of
    from fifthwheel.logs.can.text import read_text

    try:
        with path.open("rb") as file:
            head = file.read(1 << 16)
        if head.startswith(b"LOGG"):
            yield from read_blf(path)
            return
        dialect = dialect_of(head)
        if dialect is None:
            raise SignalError(
                f"{path.name}: no CAN log, it begins with {head[:20]!r}; expected BLF, ASC, candump or PCAN trace"
            )
        yield from read_text(path, dialect)
    except OSError as error:
        raise SignalError(f"{path.name}: cannot be read ({error.strerror or error}); check the file") from error
