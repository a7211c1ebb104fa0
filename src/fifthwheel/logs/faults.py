"""What can be wrong with a log, by name."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from typing import Literal

from fifthwheel.errors import SignalError

Severity = Literal["error", "warning"]


class Fault(Enum):
    """Kinds of faults that check() looks for."""

    DROPOUT = "dropout"
    """Samples missing."""
    SPIKE = "spike"
    """Lone samples far from their neighbours."""
    STUCK = "stuck"
    """The same value again and again while the truck turns."""
    ZERO_SPEED = "zero speed"
    """Too slow for lateral dynamics."""
    OUT_OF_RANGE = "out of range"
    """Beyond what a truck can do."""
    DEGREES = "degrees"
    """Degrees taken for radians."""
    UNIT = "unit"
    """Another wrong unit: km/h, g."""
    STEERING_WHEEL = "steering wheel"
    """The angle at the driver's hands taken for that of the road wheels."""
    GAIN = "gain"
    """Another steering ratio than said, or a speed in another unit."""
    SWAPPED_SIGN = "swapped sign"
    """Right counted positive."""
    WRONG_COLUMN = "wrong column"
    """No relation to the other signals at all."""
    UNKNOWN_UNIT = "unknown unit"
    """Of a unit or axle that the vehicle does not have."""
    OFFSET = "offset"
    """Not zero where the other signals say zero."""


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One fault of one signal."""

    signal: str
    """Name of the signal, or "time"."""
    fault: Fault
    severity: Severity
    """An error is sure and ruins an estimate; a warning is doubtful, or a filter copes with it."""
    message: str
    """Signal, what was expected, what came, and the cure."""

    def __str__(self) -> str:
        return f"{self.severity}: {self.message}"


def raise_errors(findings: Iterable[Finding]) -> None:
    """Raise one SignalError with the message of every error among the findings, if there is any."""
    errors = [finding.message for finding in findings if finding.severity == "error"]
    if errors:
        raise SignalError("\n".join(errors))
