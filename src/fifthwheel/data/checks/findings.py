"""Faults of signals, and findings that name the signal, the fault and the cure."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, Literal

from fifthwheel.base.errors import SignalError

Severity = Literal["error", "warning"]


class Fault(StrEnum):
    """Faults of a record."""

    DROPOUT = "dropout"
    """Missing samples."""
    SPIKE = "spike"
    """Single samples far from their neighbours."""
    STUCK = "stuck"
    """A constant value while the truck turns."""
    ZERO_SPEED = "zero speed"
    """A speed too low for lateral dynamics."""
    OUT_OF_RANGE = "out of range"
    """A magnitude that a truck cannot reach."""
    DEGREES = "degrees"
    """Degrees read as radians."""
    UNIT = "unit"
    """Another wrong unit: km/h, g."""
    STEERING_WHEEL = "steering wheel"
    """The steering-wheel angle read as the road-wheel angle."""
    GAIN = "gain"
    """A wrong steering ratio, or a speed in another unit."""
    SWAPPED_SIGN = "swapped sign"
    """Positive to the right instead of to the left."""
    WRONG_COLUMN = "wrong column"
    """No relation to the other signals."""
    UNUSED = "unused"
    """A quantity that no check and no estimator uses, in this log."""
    MASS = "mass"
    """A gross mass, by the forces of driving, that is not that of the vehicle file."""
    UNKNOWN_UNIT = "unknown unit"
    """A unit or steered axle that the vehicle does not have."""
    OFFSET = "offset"
    """A mean that is not zero where the other signals are zero."""
    DUPLICATE = "duplicate"
    """The samples of another signal."""
    EXCHANGED = "exchanged"
    """The signal of another unit, or of the other side of an axle."""
    TIME_OFFSET = "time offset"
    """Timestamps that are late or early."""
    CLOCK_RATE = "clock rate"
    """Timestamps of a clock that is fast or slow."""


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One fault of one signal."""

    signal: str
    """Name of the signal, or "time"."""
    fault: Fault
    severity: Severity
    """An error is certain and makes estimates wrong; a warning is uncertain, or an estimator tolerates the fault."""
    message: str
    """The signal, the expected and the actual value, and the cure."""
    remedy: Mapping[str, str | float] = field(default_factory=dict)
    """Keys of signals.toml whose values remove the fault; empty where the user must decide."""
    sigma: float | None = None
    """Standard deviation of a delay that is the remedy, s."""
    others: tuple[str, ...] = ()
    """Further signals with the same fault and the same remedy."""
    log: str | None = None
    """Name of the log, where there are several."""

    def __str__(self) -> str:
        return f"{self.severity}: {self.message}"


def uncertain_delay(delay: float, sigma: float) -> str:
    """A delay, s, as a signals.toml has it: "0.28 s +- 0.05 s"."""
    return f"{round(delay, 3):g} s +- {sigma:.1g} s"


def remedy_text(remedy: Mapping[str, str | float]) -> str:
    """The instruction in a message: {"unit": "deg"} -> 'set unit = "deg" in signals.toml'."""
    if "sign" in remedy:
        return "invert it in signals.toml: sign = -1, or no sign if it has one"
    keys = (f'{key} = "{value}"' if isinstance(value, str) else f"{key} = {value:.3g}" for key, value in remedy.items())
    return f"set {' and '.join(keys)} in signals.toml"


def error(signal: str, fault: Fault, problem: str, **further: Any) -> Finding:
    """An error whose message is the name of the signal and the problem; `further` are fields of `Finding`."""
    return Finding(signal=signal, fault=fault, severity="error", message=f"{signal}: {problem}", **further)


def warning(signal: str, fault: Fault, problem: str, **further: Any) -> Finding:
    """The same as a warning."""
    return Finding(signal=signal, fault=fault, severity="warning", message=f"{signal}: {problem}", **further)


def is_gap(finding: Finding) -> bool:
    """Whether it is the finding on a gap of the time base."""
    return finding.signal == "time" and finding.fault is Fault.DROPOUT


def raise_errors(findings: Iterable[Finding]) -> None:
    """Raise one SignalError with the messages of all errors among the findings, if there are any."""
    errors = [finding.message for finding in findings if finding.severity == "error"]
    if errors:
        raise SignalError("\n".join(errors))
