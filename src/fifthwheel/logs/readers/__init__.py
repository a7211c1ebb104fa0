"""One reader a format. A file's content says which it is; its name does not count."""

import importlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from fifthwheel.errors import SignalError
from fifthwheel.logs.log import Log, Progress, quiet

_TEXT_HEAD = 4096


@dataclass(frozen=True, kw_only=True)
class Format:
    """A kind of file."""

    name: str
    """In words, for messages."""
    module: str
    """Module of this package; its open_log(path, databases=..., progress=...) gives the Log."""
    begins: Callable[[bytes], bool]
    """Whether a file that begins with these bytes is one."""
    extra: str | None = None
    """What to install besides: pip install '.[extra]' in the checkout."""


def _is_trace(head: bytes) -> bool:
    from fifthwheel.logs.can.dialects import dialect_of

    return head.startswith(b"LOGG") or dialect_of(head) is not None


FORMATS = (
    Format(name="Parquet", module="parquet", begins=lambda head: head.startswith(b"PAR1")),
    Format(name="ASAM MDF", module="mf4", extra="can", begins=lambda head: head[:8] in (b"MDF     ", b"UnFinMF ")),
    Format(
        name="MATLAB",
        module="mat",
        extra="mat",
        begins=lambda head: head.startswith((b"MATLAB 5.0 MAT", b"MATLAB 7.3 MAT", b"\x89HDF\r\n\x1a\n")),
    ),
    Format(name="MCAP", module="mcap", extra="mcap", begins=lambda head: head.startswith(b"\x89MCAP")),
    Format(name="CAN trace", module="can", extra="can", begins=_is_trace),
    Format(name="CSV", module="text", begins=lambda head: True),
)
"""In the order in which they are tried; what nothing else recognises is text, or an error of its reader."""


PACKED = {
    b"PK\x03\x04": "a zip archive or an Excel workbook; unpack it, or save the sheet as CSV",
    b"\x1f\x8b": "packed by gzip; unpack it first",
    b"7z\xbc\xaf": "packed by 7-Zip; unpack it first",
    b"\xd0\xcf\x11\xe0": "an old Excel workbook; save the sheet as CSV",
    b"(\xb5/\xfd": "packed by zstd; unpack it first",
}
"""Beginnings of files that are logs only within, and what to do."""


def open_log(path: str | Path, databases: Sequence[str | Path] = (), progress: Progress = quiet) -> Log:
    """Open a log of any format.

    Args:
        path: the file.
        databases: DBC or ARXML files for CAN frames, tried in order before the built-in J1939 messages.
        progress: is told the share of the file read where opening needs the whole of it.

    Raises:
        SignalError: cannot be read, is no log, or needs an extra that is not installed.
    """
    path = Path(path)
    try:
        with path.open("rb") as file:
            head = file.read(_TEXT_HEAD)
    except OSError as error:
        raise SignalError(f"{path}: cannot be read ({error.strerror}); check the path") from error
    if not head:
        raise SignalError(f"{path.name}: empty, 0 bytes; the log was never written")
    for magic, what in PACKED.items():
        if head.startswith(magic):
            raise SignalError(f"{path.name}: {what}")
    found = next(one for one in FORMATS if one.begins(head))
    try:
        module = importlib.import_module(f"{__name__}.{found.module}")
        log: Log = module.open_log(path, databases=databases, progress=progress)
    except ImportError as error:
        if found.extra is None:
            raise
        raise SignalError(
            f"{path.name}: in the format {found.name}; to read it, pip install '.[{found.extra}]' in the checkout"
        ) from error
    return log
