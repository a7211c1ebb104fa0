"""One reader for each format. The content of a file decides which; its name does not count."""

import re
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from fifthwheel.base.errors import FifthwheelError, SignalError
from fifthwheel.base.input_files import require_regular
from fifthwheel.data.logs.readers.can_text import text_trace
from fifthwheel.data.logs.readers.isolated import open_isolated
from fifthwheel.data.logs.source import LogSource, ReadProgress, no_progress

_HEAD_SIZE = 4096
_MATLAB = (b"MATLAB 5.0 MAT", b"MATLAB 7.3 MAT", b"\x89HDF\r\n\x1a\n")
_ASC_HEADER = (b"date ", b"base hex", b"base dec")
_ASC_FRAME = re.compile(rb"^[ \t]*\d+\.\d+[ \t]+(\d+[ \t]+[0-9A-Fa-f]+x?|CANFD[ \t]+\d+)[ \t]+[RT]x[ \t]", re.MULTILINE)
_CANDUMP = re.compile(
    rb"^[ \t]*\(\d{1,12}\.\d{1,9}\)[ \t]+\S+[ \t]+[^\n#]*?[0-9A-Fa-f]{3,8}(?:#|[ \t]+\[\d)", re.MULTILINE
)
_WORKBOOK = re.compile(
    rb"PK\x03\x04.{26}(\[Content_Types\]|_rels/|docProps/|xl/|mimetype.{0,64}application/vnd\.oasis\.opendocument\.spreads)|"
    rb"\xd0\xcf\x11\xe0",
    re.DOTALL,
)
"""A zip archive whose first file is one of .xlsx or .ods; what .xls and other old files of Office are."""


@dataclass(frozen=True, kw_only=True)
class Format:
    """A kind of file."""

    name: str
    """For messages."""
    module: str
    """Module of this package; its open_log(path, databases, progress) gives the LogSource."""
    begins: Callable[[bytes], bool]
    """Whether a file that begins with these bytes has this format."""
    has_frames: bool = False
    """Whether it may hold CAN frames, which a database decodes."""


def trace_kind(head: bytes) -> str | None:
    """The format of a CAN trace that begins with these bytes: "blf", "asc", "trc", "candump", or the program that wrote
    the text (`can_text`); None for any other file."""
    start = head.lstrip()
    if head.startswith(b"LOGG"):
        return "blf"
    if start.startswith(_ASC_HEADER) or _ASC_FRAME.search(head):
        return "asc"
    if start.startswith((b";$FILEVERSION", b";##")):
        return "trc"
    return "candump" if _CANDUMP.search(head) else text_trace(head.decode("latin-1"))


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
    Format(name="ASAM MDF", module="mdf", begins=lambda head: head[:8] in (b"MDF     ", b"UnFinMF "), has_frames=True),
    Format(name="MATLAB", module="mat", begins=lambda head: head.startswith(_MATLAB) or bool(matlab_4_order(head))),
    Format(name="MCAP", module="mcap", begins=lambda head: head.startswith(b"\x89MCAP")),
    Format(name="LabVIEW TDMS", module="tdms", begins=lambda head: head.startswith(b"TDSm")),
    Format(name="PX4 ULog", module="ulog", begins=lambda head: head.startswith(b"ULog\x01\x12\x35")),
    Format(name="Excel or OpenDocument", module="workbook", begins=lambda head: bool(_WORKBOOK.match(head))),
    Format(name="CAN trace", module="can", begins=lambda head: trace_kind(head) is not None, has_frames=True),
    Format(name="CSV", module="text", begins=lambda head: True),
)
"""In the order in which they are tried; what nothing else recognises is text."""
_FROM_CARSIM = "results of CarSim or TruckSim; write the outputs as CSV or MATLAB (.mat)"
_FROM_DIADEM = "saved by DIAdem; save it as TDMS or CSV"
_UNPACK = "unpack it first, and if that is an rlog of openpilot, write its messages as CSV or Parquet"
PACKED = {
    rb"PK\x03\x04": "a zip archive; unpack it",
    rb"\x1f\x8b": "compressed by gzip; unpack it first",
    rb"7z\xbc\xaf": "compressed by 7-Zip; unpack it first",
    rb"BZh[1-9]1AY&SY": f"compressed by bzip2; {_UNPACK}",
    rb"\xfd7zXZ\0": "compressed by xz; unpack it first",
    rb"\(\xb5/\xfd": f"compressed by zstd; {_UNPACK}",
    rb"version https://git-lfs\.github\.com/spec/": "a Git LFS pointer, not the file; run `git lfs pull`",
    rb"SQLite format 3\0": "an SQLite database, as ROS 2 writes bags (.db3); convert the bag to MCAP, for example with "
    "`mcap convert run.db3 run.mcap`",
    rb"#ROSBAG V": "a bag of ROS 1; convert it to MCAP with messages of ROS 2, for example with "
    "`rosbags-convert --src run.bag --dst run --dst-storage mcap`",
    rb"TDSh": "the index of a TDMS file; give the .tdms file",
    rb"ERDFILEV": _FROM_CARSIM,
    rb'\s*\{\s*"VsChannelGroup"': _FROM_CARSIM,
    rb"@\0{7}": "a log of MoTeC (.ld); export CSV or MATLAB (.mat) from i2",
    rb"DIAEXTENDED": _FROM_DIADEM,
    rb"(\xef\xbb\xbf)?<\?xml[^>]*>\s*<usi:tdm": _FROM_DIADEM,
    rb"\x00{4}.{4}\x00{4}[\x02\x03]\x00\x01\x00": "an rlog of openpilot; write its messages as CSV or Parquet",
    rb"\xa1\xb2(\xc3\xd4|<M)|(\xd4\xc3|M<)\xb2\xa1|\n\r\r\n.{4}(\x1a\+<M|M<\+\x1a)": "a pcap capture of a "
    "network; record CAN frames with `candump -l`, or as BLF or ASC",
    rb'\s*\[?\s*\{\s*"': "JSON; export it as CSV or Parquet, for example by pandas.read_json and DataFrame.to_parquet",
}
"""Beginnings of files that are no log that is read, as patterns, and what to do."""


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
    kind = next(candidate for candidate in FORMATS if candidate.begins(head))
    for pattern, what in PACKED.items():
        if kind.module in ("can", "text") and re.match(pattern, head, re.DOTALL):  # what they begin with is not unique
            raise SignalError(f"{path.name}: {what}")
    notes: tuple[str, ...] = ()
    if databases and not kind.has_frames:
        named = ", ".join(Path(database).name for database in databases)
        notes, databases = (f"{named} not used: {path.name} is read as {kind.name} and has no CAN frames",), ()
    return open_isolated(path, f"{__name__}.{kind.module}", kind.name, databases, progress, notes, sample=sample)
