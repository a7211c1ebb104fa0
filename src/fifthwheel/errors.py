"""Exceptions of fifthwheel: one family under ValueError; each message names the signal or key and the cure."""

from collections.abc import Iterable
from difflib import get_close_matches


class FifthwheelError(ValueError):
    """Base of every error that a user's input can cause."""


class VehicleError(FifthwheelError):
    """A vehicle description that is impossible: an unknown key, a unit that does not fit, an impossible number."""


class SignalError(FifthwheelError):
    """A log, or one of its signals, that cannot be used as it is."""


class UnitError(SignalError):
    """A text that is not a unit, or a unit of another dimension."""


def suggestion(name: str, known: Iterable[str]) -> str:
    """The cure in a message about an unknown name: up to three similar known names, or all known names.

    >>> suggestion("masss", ["mass", "cog"])
    "did you mean 'mass'?"
    >>> suggestion("x", ["mass", "cog"])
    'available: mass, cog'
    """
    known = list(known)
    similar = get_close_matches(name, known, n=3, cutoff=0.5)
    return f"did you mean {' or '.join(map(repr, similar))}?" if similar else f"available: {', '.join(known) or 'none'}"
