"""Bus logs: BLF, ASC, PCAN trace and candump."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from fifthwheel.logs.can.frames import read_frames
from fifthwheel.logs.can.log import CanLog
from fifthwheel.logs.log import Progress, quiet


def open_log(path: Path, databases: Sequence[str | Path] = (), progress: Progress = quiet) -> CanLog:
    """The log in a file of CAN frames; SignalError where it has none, or none that is known."""
    return CanLog(path.name, partial(read_frames, path), databases, progress)
