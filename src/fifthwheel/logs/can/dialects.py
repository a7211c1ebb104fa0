"""How candump, Vector ASC and the versions of PCAN trace write a frame."""

import re
from datetime import UTC, datetime, timedelta

from fifthwheel.logs.can.text import Dialect

_SIZES = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)
_TRC_COLUMNS = {
    "N": rb"\d+",
    "O": rb"(?P<time>\d{1,12}(?:\.\d{1,9})?)",
    "T": rb"(?P<kind>DT|FD|FB|FE|BI|RR)",
    "B": rb"(?P<bus>\d{1,3})",
    "I": rb"(?P<id>[0-9A-Fa-f]{4,8})",
    "d": rb"(?:Rx|Tx)",
    "l": rb"(?P<length>\d{1,2})",
    "L": rb"(?P<length>\d{1,2})",
    "D": rb"",
}


def dialect_of(head: bytes) -> Dialect | None:
    """How a file that begins with these bytes is written; None for what is no text log."""
    start = head.lstrip()
    if start.startswith((b"date ", b"base hex", b"base dec")):
        return _asc(head)
    if start.startswith((b";$FILEVERSION", b";##")):
        return _trc(head)
    if any(row[0] for row in _CANDUMP.frame.findall(head[: head.rfind(b"\n") + 1] or head)):
        return _CANDUMP
    return None


def _line(frame: bytes) -> re.Pattern[bytes]:
    """One match a line: the groups of a frame, or group rest."""
    return re.compile(rb"^(?:[ \t]*" + frame + rb"[ \t\r]*|(?P<rest>.*))$", re.MULTILINE)


def _trailing_number(name: bytes) -> int | None:
    digits = re.search(rb"\d{1,6}$", name)
    return int(digits[0]) if digits else None


def _first(name: bytes) -> int:
    """Number of a bus where the format may leave it out: there is only one then."""
    return int(name) if name else 1


_CANDUMP = Dialect(
    frame=_line(
        rb"\((?P<time>\d{1,12}\.\d{1,9})\)[ \t]+(?P<bus>[^ \t#]{1,32})[ \t]+"
        rb"(?:[RT]X[ \t]+\S+[ \t]+\S+[ \t]+)?"  # with -x
        rb"(?P<id>[0-9A-Fa-f]{8}|[0-9A-Fa-f]{3})"
        rb"(?:(?:##[0-9A-Fa-f]|#)(?P<data>[0-9A-Fa-f]*)(?P<kind>R[0-9A-Fa-f]?)?"
        rb"|[ \t]+\[(?P<length>\d{1,2})\](?P<data_2>[0-9A-Fa-f \t]*)(?P<kind_2>remote request)?)"
        rb"(?:_[0-9A-Fa-f])?(?:[ \t]+[RT])?(?:[ \t]+'.*'|[ \t]+ERRORFRAME.*)?"
    ),
    other=re.compile(rb"(?!)"),
    extended=lambda text: len(text) == 8,
    bus=_trailing_number,
    remote=lambda text: text.startswith((b"R", b"remote")),
)


def _asc(head: bytes) -> Dialect:
    base = re.search(rb"^\s*base\s+(hex|dec)\b(?:\s+timestamps\s+(absolute|relative))?", head, re.MULTILINE)
    decimal = base is not None and base[1] == b"dec"
    byte = rb"(?:[ \t]+\d{1,3}(?![^ \t\r\n]))" if decimal else rb"(?:[ \t]+[0-9A-Fa-f]{2}(?![^ \t\r\n]))"
    number = rb"(?P<id>\d{1,10}x?)" if decimal else rb"(?P<id>[0-9A-Fa-f]{1,8}x?)"
    direction = rb"[ \t]+(?:Rx|Tx|TxRq)[ \t]+"
    return Dialect(
        frame=_line(
            rb"(?P<time>\d{1,12}\.\d{1,9})[ \t]+(?:CANFD[ \t]+)?(?P<bus>\d{1,5})[ \t]+"
            rb"(?:"
            + number
            + direction
            + rb"(?P<kind>[dr])(?:[ \t]+(?P<length>[0-9A-Fa-f]{1,2}))?(?P<data>"
            + byte
            + rb"*)"
            rb"|(?:Rx|Tx|TxRq)[ \t]+"
            + number.replace(b"<id>", b"<id_2>")
            + rb"(?:[ \t]+[A-Za-z_]\w*)?[ \t]+[01][ \t]+[01][ \t]+"
            rb"[0-9A-Fa-f]{1,2}[ \t]+(?P<length_2>\d{1,2})(?P<data_2>" + byte + rb"*))(?:[ \t].*)?"
        ),
        error=re.compile(rb"\s*\d+\.\d+\s+(?:CANFD\s+)?\d+\s+(?:(?:Rx|Tx)\s+)?ErrorFrame", re.IGNORECASE),
        other=re.compile(
            rb"\s*(?://|date\b|base\b|begin\b|end\b|(?:no\s+)?internal\b|\d+\.\d+\s+(?!\d+\s+\S+\s+(?:Rx|Tx)\b|CANFD\b))",
            re.IGNORECASE,
        ),
        extended=lambda text: text.endswith(b"x"),
        bus=_first,
        size=_asc_size,
        decimal=decimal,
        more=True,
        remote=lambda text: text == b"r",
        relative=base is not None and base[2] == b"relative",
    )


def _asc_size(text: bytes) -> int:
    """Of a DLC, one hex digit, or of an FD frame's data, decimal; more than any frame has where it is neither."""
    if len(text) == 1:
        return min(int(text, 16), 8)
    return int(text) if text.isdigit() else 1 << 15


def _trc(head: bytes) -> Dialect:
    version = re.search(rb"^\s*;\$FILEVERSION=(\d)\.(\d)", head, re.MULTILINE)
    major, minor = (int(version[1]), int(version[2])) if version else (1, 0)
    columns = re.search(rb"^\s*;\$COLUMNS=([A-Za-z,]+)", head, re.MULTILINE)
    coded = False
    if major >= 2:
        names = columns[1].decode().split(",") if columns else []
        if not {"O", "I"} <= set(names):  # none said, or a damaged one
            names = ["N", "O", "T", "B", "I", "d", "R", "L", "D"]
        coded = "L" in names and "l" not in names
        known = [_TRC_COLUMNS.get(name, rb"\S+") for name in names if name != "D"]
        groups = [re.findall(rb"<(\w+)>", column) for column in known]
        fields = [
            rb"\S+" if mine and mine in groups[:k] else column
            for k, (column, mine) in enumerate(zip(known, groups, strict=True))
        ]
    else:
        fields = [rb"\d+\)", _TRC_COLUMNS["O"]]
        fields += [_TRC_COLUMNS["B"]] if minor >= 2 else []
        fields += [_TRC_COLUMNS["d"]] if minor >= 1 else []
        fields += [_TRC_COLUMNS["I"]]
        fields += [rb"-"] if minor >= 3 else []
        fields += [_TRC_COLUMNS["l"]]
    return Dialect(
        frame=_line(
            rb"[ \t]+".join(fields)
            + rb"(?:[ \t]+(?P<"
            + (rb"kind_2" if major >= 2 else rb"kind")
            + rb">RTR)|(?P<data>(?:[ \t]+[0-9A-Fa-f]{2})*))"
        ),
        error=re.compile(rb"\s*\d+\)?\s+[\d.]+\s+(?:\d+\s+)?(?:ER|Error)\b"),
        other=re.compile(rb"\s*(?:;|\d+\)?\s+[\d.]+\s+(?:\d+\s+)?(?:ST|EC|EV|Warng|Event)\b)"),
        extended=lambda text: len(text) > 4,
        bus=_first,
        size=(lambda text: _SIZES[min(int(text), 15)]) if coded else int,
        remote=lambda text: text in (b"RR", b"RTR"),
        unit=1e-3,
        start=_trc_start(head) if (major, minor) > (1, 0) else 0.0,
    )


def _trc_start(head: bytes) -> float:
    """Seconds since 1970 of the beginning of a PCAN trace, which counts days since 1899; 0 where it does not say."""
    days = re.search(rb"^\s*;\$STARTTIME=(\d{1,6}(?:\.\d+)?)\s*$", head, re.MULTILINE)
    if days is None:
        return 0.0
    return (datetime(1899, 12, 30, tzinfo=UTC) + timedelta(days=float(days[1]))).timestamp()
