"""Limits of reading a log, and the environment variables that change them."""

import math
import os
from dataclasses import dataclass
from typing import Self

from fifthwheel.base.errors import SignalError

SECONDS = "FIFTHWHEEL_READER_SECONDS"
"""Environment variable: time without progress after which reading stops, s."""
MEMORY = "FIFTHWHEEL_READER_MEMORY"
"""Environment variable: memory of the reading process, MB; enforced on Linux."""
SAMPLES = "FIFTHWHEEL_READER_SAMPLES"
"""Environment variable: samples of one reading, MB at 8 bytes each."""
DEFAULTS = {SECONDS: 60.0, MEMORY: 4000.0, SAMPLES: 1000.0}
MAX_COLUMNS = 100_000
"""Columns of a log; more are refused."""
MAX_NAME = 1000
"""Characters of a name or a description; a column with a longer name is left out, a description is cut."""
_BYTES_PER_SECOND = 1e6
"""The time limit grows with the file: a library may read all of it before it answers."""
_TOTAL = 10
"""Time limit for a whole reading as a multiple of that without progress."""
_TOTAL_BYTES_PER_SECOND = 5e4
"""The former grows with the file too."""
_EXPANSION = 50
"""Bytes by which the limit of samples grows for each byte of the file."""


@dataclass(frozen=True, kw_only=True)
class FileLimits:
    """Limits for one file."""

    seconds: float
    """Without progress, s."""
    total_seconds: float
    """For one reading, without the time that the program itself takes, s."""
    memory: float
    """Of the reading process, MB."""
    samples: float
    """Of one reading, bytes."""
    written: float
    """Size of each temporary file, bytes."""

    @classmethod
    def of_file(cls, size: int) -> Self:
        """Limits for a file of this size in bytes; SignalError for an environment variable that is no number."""
        return cls(
            seconds=limit(SECONDS) + size / _BYTES_PER_SECOND,
            total_seconds=_TOTAL * limit(SECONDS) + size / _TOTAL_BYTES_PER_SECOND,
            memory=limit(MEMORY),
            samples=1e6 * limit(SAMPLES) + _EXPANSION * size,
            written=1e6 * limit(MEMORY) + size,
        )


def limit(name: str) -> float:
    """The value of an environment variable, or its default."""
    text = os.environ.get(name, "")
    try:
        value = float(text or DEFAULTS[name])
    except ValueError:
        value = 0.0
    if not 0 < value < math.inf:
        raise SignalError(f"{name} is {text!r}, a positive number expected, such as {DEFAULTS[name]:g}")
    return value
