"""CAN traces as text that python-can does not read: each line becomes one of candump."""

import base64
import re
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime

_DAY = 86400.0


@dataclass(frozen=True, kw_only=True)
class TextTrace:
    """How a program writes frames, one in a line."""

    frame: re.Pattern[str]
    """Groups time, id and data; extended where the width of the id does not show it, bus and remote where written."""
    seconds: Callable[[str], float]
    """Of the text of a time."""
    extended: str = ""
    """What stands in its group for an id of 29 bits."""
    bytes_of: Callable[[str], str] = lambda data: re.sub(r"[^0-9A-Fa-f]", "", data)
    """Hexadecimal digits of the text of the data."""

    def candump(self, line: str) -> str:
        """The line as candump writes it; empty without a frame."""
        found = self.frame.match(line)
        if found is None:
            return "\n"
        parts = found.groupdict("")
        extended = parts["extended"] == self.extended if self.extended else len(parts["id"]) > 3
        payload = "R" if parts.get("remote") else self.bytes_of(parts["data"])
        number = f"{int(parts['id'], 16):0{8 if extended else 3}X}"
        return f"({self.seconds(parts['time']):.6f}) can{parts.get('bus') or 0} {number}#{payload}\n"


def _of_day(text: str) -> float:
    """Seconds of HH:MM:SS:ffff."""
    hours, minutes, seconds, fraction = text.split(":")
    return int(hours) * 3600 + int(minutes) * 60 + float(f"{seconds}.{fraction}")


def _of_date(text: str) -> float:
    """Seconds since 1970 of YYYY-MM-DD HH:MM:SS.ffffff, which has no zone, as in UTC."""
    return datetime.fromisoformat(text).replace(tzinfo=UTC).timestamp()


def _of_css(text: str) -> float:
    """Seconds of [[YYYY[MM]]DD]THHMMSSmmm, of the month or since 1970."""
    day, _, clock = text.rpartition("T")
    seconds = int(clock[:2]) * 3600 + int(clock[2:4]) * 60 + int(clock[4:6]) + float(f"0.{clock[6:] or 0}")
    if len(day) == 8:
        return seconds + datetime.strptime(day, "%Y%m%d").replace(tzinfo=UTC).timestamp()
    return seconds + _DAY * int(day[-2:] or 0)


def _base64(data: str) -> str:
    return base64.b64decode(data).hex()


_HEX = "[0-9A-Fa-f]"
TEXT_TRACES = {
    "SavvyCAN": TextTrace(
        frame=re.compile(
            rf"(?P<time>\d+),(?P<id>{_HEX}{{1,8}}),(?P<extended>true|false),(?:[RT]x,)?(?P<bus>\d+),\d+,"
            rf"(?P<data>(?:{_HEX}{{2}},?)*)",
            re.IGNORECASE,
        ),
        seconds=lambda text: int(text) * 1e-6,
        extended="true",
    ),
    "BUSMASTER": TextTrace(
        frame=re.compile(
            rf"(?P<time>\d+:\d\d:\d\d:\d+) [RT]x (?P<bus>\d+) 0x(?P<id>{_HEX}+) (?P<extended>[sx])(?P<remote>r?) \d+"
            rf"(?P<data>(?: {_HEX}{{2}})*)"
        ),
        seconds=_of_day,
        extended="x",
    ),
    "CRTD": TextTrace(
        frame=re.compile(
            rf"(?P<time>\d+\.\d+) (?P<bus>\d*)[RT](?P<extended>11|29) (?P<id>{_HEX}+)(?P<data>(?: {_HEX}{{2}})*)"
        ),
        seconds=float,
        extended="29",
    ),
    "python-can": TextTrace(
        frame=re.compile(
            rf"(?P<time>\d+\.?[\de.+-]*),0x(?P<id>{_HEX}+),(?P<extended>[01]),(?:(?P<remote>1)|0),0,\d+,"
            r"(?P<data>[A-Za-z0-9+/=]*)"
        ),
        seconds=float,
        extended="1",
        bytes_of=_base64,
    ),
    "CSS Electronics": TextTrace(
        frame=re.compile(
            rf"(?P<time>[\dT]+);(?P<extended>[01]);(?P<id>{_HEX}+);(?:\d+;)?(?P<data>(?:{_HEX}{{2}})*);?$"
        ),
        seconds=_of_css,
        extended="1",
    ),
    "candump -t A": TextTrace(
        frame=re.compile(
            r"\s*\((?P<time>\d{4}-\d\d-\d\d \d\d:\d\d:\d\d\.\d+)\)\s+\D*(?P<bus>\d*)\s+"
            rf"(?:[RT]X\s+\S+\s+\S+\s+)?(?P<id>{_HEX}{{3,8}})\s+\[\d+\](?:\s+(?P<remote>remote)\b)?"
            rf"(?P<data>(?:\s+{_HEX}{{2}}\b)*)"
        ),
        seconds=_of_date,
    ),
}
"""By the program that writes them."""


def text_trace(head: str) -> str | None:
    """The program whose trace begins with this text: the first whose frame stands in a line; None for other files."""
    lines = head.splitlines()
    return next((name for name, trace in TEXT_TRACES.items() if any(map(trace.frame.match, lines))), None)
