"""CAN frames in batches of arrays, as every reader of a bus log gives them."""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from typing import Literal

import numpy as np
from numpy.typing import NDArray

TraceKind = Literal["blf", "asc", "trc", "candump"]
_CANDUMP = re.compile(
    rb"^[ \t]*\(\d{1,12}\.\d{1,9}\)[ \t]+\S+[ \t]+[^\n#]*?[0-9A-Fa-f]{3,8}(?:#|[ \t]+\[\d)", re.MULTILINE
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Frames:
    """Consecutive data frames, without error frames and remote frames."""

    time: NDArray[np.float64]
    """(n,) s, finite, as in the log: since its start or since 1970."""
    id: NDArray[np.uint32]
    """(n,) 11 or 29 bits, without flags."""
    extended: NDArray[np.bool_]
    """(n,) whether the id has 29 bits."""
    bus: NDArray[np.int32]
    """(n,) number of the bus as in the log."""
    data: NDArray[np.uint8]
    """(n, width) payload, zeros beyond its length; width >= 8."""
    length: NDArray[np.int32]
    """(n,) bytes of payload."""

    def __len__(self) -> int:
        return int(self.time.size)

    def take(self, rows: NDArray[np.intp]) -> "Frames":
        """Some of the frames."""
        return Frames(**{part.name: getattr(self, part.name)[rows] for part in fields(self)})


Batches = Callable[[list[str]], Iterator[tuple[Frames, float]]]
"""Each call reads the log from its start: batches of frames, and the fraction of the log read with each, 0 to 1. The
argument gets a sentence for all that is left out, once all is read."""


def trace_kind(head: bytes) -> TraceKind | None:
    """The format of a CAN trace that begins with these bytes; None for any other file."""
    start = head.lstrip()
    if head.startswith(b"LOGG"):
        return "blf"
    if start.startswith((b"date ", b"base hex", b"base dec")):
        return "asc"
    if start.startswith((b";$FILEVERSION", b";##")):
        return "trc"
    return "candump" if _CANDUMP.search(head) else None
