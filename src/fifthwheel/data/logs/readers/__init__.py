"""One reader for each format. The content of a file decides which; its name does not count."""

import re
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from fifthwheel.base.errors import FifthwheelError, SignalError
from fifthwheel.base.input_files import require_regular
from fifthwheel.data.logs.readers.isolated import open_isolated
from fifthwheel.data.logs.source import LogSource, ReadProgress, no_progress

TraceKind = Literal["blf", "asc", "trc", "candump"]
_HEAD_SIZE = 4096
_MATLAB = (b"MATLAB 5.0 MAT", b"MATLAB 7.3 MAT", b"\x89HDF\r\n\x1a\n")
_ASC_HEADER = (b"date ", b"base hex", b"base dec")
_ASC_FRAME = re.compile(rb"^[ \t]*\d+\.\d+[ \t]+(\d+[ \t]+[0-9A-Fa-f]+x?|CANFD[ \t]+\d+)[ \t]+[RT]x[ \t]", re.MULTILINE)
_CANDUMP = re.compile(
    rb"^[ \t]*\(\d{1,12}\.\d{1,9}\)[ \t]+\S+[ \t]+[^\n#]*?[0-9A-Fa-f]{3,8}(?:#|[ \t]+\[\d)", re.MULTILINE
)


@dataclass(frozen=True, kw_only=True)
class Format:
    """A kind of file."""

    name: str
    """For messages."""
    module: str
    """Module of this package; its open_log(path, databases, progress) gives the LogSource."""
    begins: Callable[[bytes], bool]
    """Whether a file that begins with these bytes has this format."""


def trace_kind(head: bytes) -> TraceKind | None:
    """The format of a CAN trace that begins with these bytes; None for any other file."""
    start = head.lstrip()
    if head.startswith(b"LOGG"):
        return "blf"
    if start.startswith(_ASC_HEADER) or _ASC_FRAME.search(head):
        return "asc"
    if start.startswith((b";$FILEVERSION", b";##")):
        return "trc"
    return "candump" if _CANDUMP.search(head) else None


def has_asc_header(head: bytes) -> bool:
    """Whether an ASC file that begins with these bytes says how its numbers are written."""
    return head.lstrip().startswith(_ASC_HEADER)


def matlab_4_order(head: bytes) -> Literal["<", ">"] | None:
    """Byte order of a file that begins with a variable of MATLAB's version 4, which has no header; else None."""
    orders: tuple[tuple[Literal["<", ">"], int], ...] = (("<", 0), (">", 1000))
    for order, base in orders if len(head) > 20 else ():
        kind, rows, columns, imaginary, length = struct.unpack(f"{order}5i", head[:20])
        number, shape = divmod(kind - base, 10)
        is_kind = number in range(0, 60, 10) and shape in (0, 1, 2) and imaginary in (0, 1)
        name = head[20 : 20 + length] if 1 < length <= 64 else b""
        if is_kind and min(rows, columns) >= 0 and re.fullmatch(rb"[A-Za-z]\w*\0", name):
            return order
    return None


FORMATS = (
    Format(name="Parquet", module="parquet", begins=lambda head: head.startswith(b"PAR1")),
    Format(name="ASAM MDF", module="mdf", begins=lambda head: head[:8] in (b"MDF     ", b"UnFinMF ")),
    Format(name="MATLAB", module="mat", begins=lambda head: head.startswith(_MATLAB) or bool(matlab_4_order(head))),
    Format(name="MCAP", module="mcap", begins=lambda head: head.startswith(b"\x89MCAP")),
    Format(name="CAN trace", module="can", begins=lambda head: trace_kind(head) is not None),
    Format(name="CSV", module="text", begins=lambda head: True),
)
"""In the order in which they are tried; what nothing else recognises is text."""


PACKED = {
    b"PK\x03\x04": "a zip archive or an Excel workbook; unpack it, or save the sheet as CSV",
    b"\x1f\x8b": "compressed by gzip; unpack it first",
    b"7z\xbc\xaf": "compressed by 7-Zip; unpack it first",
    b"\xd0\xcf\x11\xe0": "an old Excel workbook; save the sheet as CSV",
    b"(\xb5/\xfd": "compressed by zstd; unpack it first",
    b"version https://git-lfs.github.com/spec/": "a Git LFS pointer, not the file; run `git lfs pull`",
    b"SQLite format 3\0": "an SQLite database, as ROS 2 writes bags (.db3); convert the bag to MCAP, for example with "
    "`mcap convert run.db3 run.mcap`",
    b"#ROSBAG V": "a bag of ROS 1; convert it to MCAP with messages of ROS 2, for example with "
    "`rosbags-convert --src run.bag --dst run --dst-storage mcap`",
}
"""Beginnings of files that contain a log, or stand for one, but are none, and what to do."""


def open_log(
    path: str | Path,
    databases: Sequence[str | Path] = (),
    progress: ReadProgress = no_progress,
    *,
    sample: bool = False,
) -> LogSource:
    """Open a log of any format, in a child process with limits of time, memory and samples.

    `databases` are DBC or ARXML files for CAN frames, searched in order before the built-in J1939 messages. `progress`
    receives the fraction read where opening needs the whole file. With `sample`, only a sample of a large file is read
    (`LogSource.sample`). A SignalError if the file is not a regular one, cannot be read, is no log, exceeds a limit, or
    needs a library that is not installed.
    """
    path = Path(path)
    try:
        require_regular(path)
        with path.open("rb") as file:
            head = file.read(_HEAD_SIZE)
    except FifthwheelError as error:
        raise SignalError(str(error)) from None
    except OSError as error:
        raise SignalError(f"{path}: cannot be read ({error.strerror}); check the path") from error
    if not head:
        raise SignalError(f"{path.name}: empty, 0 bytes; the log was never written")
    for magic, what in PACKED.items():
        if head.startswith(magic):
            raise SignalError(f"{path.name}: {what}")
    kind = next(candidate for candidate in FORMATS if candidate.begins(head))
    return open_isolated(path, f"{__name__}.{kind.module}", kind.name, databases, progress, sample=sample)
