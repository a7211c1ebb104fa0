"""Exceptions of fifthwheel: one family under ValueError; each message names the signal or key and the cure."""

import re
from collections.abc import Iterable
from difflib import get_close_matches

MAX_MESSAGE = 10_000
"""Characters of a message that are shown: a name in a damaged file may be of any length."""
_CONTROL = re.compile("[\x00-\x08\x0a-\x1f\x7f-\x9f\u061c\u200b-\u200f\u2028-\u202e\u2060-\u2069\ufeff\ud800-\udfff]")
"""Control characters except the tab, marks of text direction, and bytes of a file name that are not UTF-8."""


class FifthwheelError(ValueError):
    """Base of every error that a user's input can cause. Its text is safe for a terminal.

    Example:
        >>> import fifthwheel as fw
        >>> try:
        ...     fw.vehicle("cheng_cebon")
        ... except fw.FifthwheelError as error:
        ...     print(error)
        cheng_cebon: no such vehicle in the catalogue; did you mean 'cheng_cebon_2011' or 'cheng_cebon_2011_vehicle'?
    """

    def __str__(self) -> str:
        text = printable_lines(super().__str__())
        more = len(text) - MAX_MESSAGE
        return text if more <= 0 else f"{text[:MAX_MESSAGE]}... ({more} more characters)"


class VehicleError(FifthwheelError):
    """A vehicle description that is impossible: an unknown key, a unit that does not fit, an impossible number.

    Example:
        >>> import fifthwheel as fw
        >>> try:
        ...     fw.vehicle("cheng_cebon_2011").replace({"tractor.mass": -1.0})
        ... except fw.VehicleError as error:
        ...     print(error)
        tractor.mass: expected a number > 0, got -1.0; correct it
    """


class SignalError(FifthwheelError):
    """A log, or one of its signals, that cannot be used as it is.

    Example:
        >>> import fifthwheel as fw
        >>> try:
        ...     fw.Record(time=[0.0, 1.0], signals={"speeed": [20.0, 20.0]})
        ... except fw.SignalError as error:
        ...     print(error)
        speeed: not the name of a signal; did you mean 'speed'?
    """


class UnitError(SignalError):
    """A text that is not a unit, or a unit of another dimension."""


def suggestion(name: str, known: Iterable[str]) -> str:
    """The cure in a message about an unknown name: up to three similar known names, or all known names.

    >>> suggestion("masss", ["mass", "cog"])
    "did you mean 'mass'?"
    >>> suggestion("yaw", ["raw", "yaw_inertia"])
    "did you mean 'yaw_inertia' or 'raw'?"
    >>> suggestion("x", ["mass", "cog"])
    'available: mass, cog'
    """
    known = list(known)
    longer = [each for each in known if name and each.startswith(name)]
    similar = [*longer, *(each for each in get_close_matches(name, known, n=3, cutoff=0.5) if each not in longer)][:3]
    return f"did you mean {' or '.join(map(repr, similar))}?" if similar else f"available: {', '.join(known) or 'none'}"


def printable(text: str) -> str:
    r"""A text from a file as one line that cannot control a terminal: control characters become escapes.

    >>> print(printable("yaw\x1b[2J rate"))
    yaw\u001b[2J rate
    """
    return _CONTROL.sub(lambda match: f"\\u{ord(match[0]):04x}", text)


def printable_lines(text: str) -> str:
    """The same for a text of several lines, which stay."""
    return "\n".join(map(printable, text.split("\n")))
