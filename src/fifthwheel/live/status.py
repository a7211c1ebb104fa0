"""Status and faults of a live node."""

from enum import IntEnum, IntFlag

from fifthwheel.observe import Status


class NodeStatus(IntEnum):
    """Status of an output. The first values are those of `observe.Status`."""

    OK = Status.OK
    COASTING = Status.COASTING
    TOO_SLOW = Status.TOO_SLOW
    INPUT_MISSING = Status.INPUT_MISSING
    INCONSISTENT = Status.INCONSISTENT
    DEGRADED = 8
    """The states are valid, and a fault limits their quality; see `LiveFault`."""
    FAILED = 9
    """The estimator gave a state that is not finite; it starts again."""


class LiveFault(IntFlag):
    """What is wrong now; several may be."""

    NONE = 0
    SILENT = 1
    """No mapped signal arrives."""
    BUS_OFF = 2
    """The interface is off the bus or cannot be opened; the node tries again."""
    SIGNAL_MISSING = 4
    """A mapped signal does not arrive."""
    NOT_AVAILABLE = 8
    """A sender reports an error, or that it has no value."""
    WRONG_LENGTH = 16
    """A frame is too short for a mapped signal."""
    TIME_JUMP = 32
    """The clock of the bus has jumped, or a timestamp was wrong, in the last second."""
    OVERLOAD = 64
    """The node is late or has dropped frames in the last second."""
    CHANGED = 128
    """Load or trailer differ from those of the estimates."""
    NOT_RECORDED = 256
    """The record or the estimates cannot be written."""
    NOT_SENT = 512
    """Frames cannot be sent."""
    WHEEL_LIFT = 1024
    """A wheel is about to lift: see `observe.states.wheel_lifts`. A fault of the truck's motion."""


HARMLESS = LiveFault.NOT_RECORDED | LiveFault.NOT_SENT | LiveFault.WHEEL_LIFT
"""Faults that do not limit the quality of the states."""
