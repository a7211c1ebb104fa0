"""Cells of a table to numbers: text, dates and times of day as float64; what is no number is counted."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from fifthwheel.base.types import Array

BLANK = ("", "nan", "na", "n/a", "#n/a", "null", "none", "-", "?")
"""Cells that stand for a missing sample, in lower case."""
_BLANK_CELLS = pa.StringArray.from_buffers(  # `pyarrow.array` would import pandas
    len(BLANK),
    pa.py_buffer(np.cumsum([0, *map(len, BLANK)], dtype=np.int32)),
    pa.py_buffer("".join(BLANK).encode()),
)
_TIME = r"(?P<H>\d{1,2}):(?P<M>\d{2}):(?P<S>\d{2}(?:[.,]\d+)?)(?: ?(?P<half>[AaPp])[Mm])?"
_ZONE = r"(?: ?(?:Z|UTC|(?P<zone>[+-]\d{2}):?(?P<zone_minutes>\d{2})))?"
_DATES = (
    r"(?P<y>\d{4})[-/.](?P<m>\d{1,2})[-/.](?P<d>\d{1,2})",
    r"(?P<d>\d{1,2})\.(?P<m>\d{1,2})\.(?P<y>\d{4})",
    r"(?P<m>\d{1,2})/(?P<d>\d{1,2})/(?P<y>\d{4})",
    r"(?P<d>\d{1,2})/(?P<m>\d{1,2})/(?P<y>\d{4})",
)
_DAY = 86400.0
_MINUS = re.compile("^ ?(?:[\u2212\u2013\x96]|\u00e2\u0088\u0092|\u00e2\u0080\u0093)")
"""A minus or dash of typography, in Latin-1 and in UTF-8 that is read as Latin-1."""
_EXPONENT = re.compile("(?<=[0-9.])[dD](?=[+-]?[0-9]{1,3}$)")
_PER_SECOND = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}


@dataclass(frozen=True, kw_only=True)
class DateStyle:
    """One notation of an instant."""

    pattern: str
    """Regular expression with groups H, M, S, half; with a date also y, m, d, zone and zone_minutes."""

    @property
    def dated(self) -> bool:
        """Whether it includes the date; else it is the time of day."""
        return "(?P<y>" in self.pattern

    def matches(self, cell: str) -> bool:
        """Whether a cell has this notation and is a possible date."""
        found = re.fullmatch(self.pattern, cell.strip())
        return found is not None and (not self.dated or (int(found["m"]) <= 12 and int(found["d"]) <= 31))

    def seconds(self, text: pa.Array) -> Array:
        """Seconds (n,) since 1970, in UTC if the zone is given, or since midnight without a date; NaN if not valid."""
        parts = pc.extract_regex(pc.utf8_trim_whitespace(text), f"^{self.pattern}$")

        def part(name: str) -> Array:
            cells = pc.replace_substring(pc.replace_substring(parts.field(name), ",", "."), "+", "")
            filled = pc.if_else(pc.equal(cells, ""), pa.scalar(None, cells.type), cells)
            return np.asarray(filled.cast(pa.float64()).to_numpy(zero_copy_only=False), dtype=np.float64)

        hour = part("H")
        half = np.array([(cell or "").lower() for cell in parts.field("half").to_pylist()])
        hour = np.where(half == "p", hour % 12 + 12, np.where(half == "a", hour % 12, hour))
        seconds = hour * 3600 + part("M") * 60 + part("S")
        if self.dated:
            finite = np.isfinite(seconds)
            year, month, day = (np.where(finite, part(name), 1).astype(int) for name in "ymd")
            days = (year - 1970).astype("datetime64[Y]").astype("datetime64[M]") + (month - 1)
            zone = np.nan_to_num(part("zone"))
            seconds = seconds - 3600 * zone - np.copysign(60 * np.nan_to_num(part("zone_minutes")), zone)
            seconds = seconds + ((days.astype("datetime64[D]").astype(np.int64) + day - 1) * _DAY)
        return seconds


DATE_STYLES = (*[DateStyle(pattern=rf"{date}[T ] ?{_TIME}{_ZONE}") for date in _DATES], DateStyle(pattern=_TIME))


def date_style(cells: Sequence[str]) -> DateStyle | None:
    """The notation of more than 80 % of the cells that are not empty; None where they are no instants."""
    filled = [cell for cell in cells if cell.strip()]
    return next((s for s in DATE_STYLES if filled and sum(map(s.matches, filled)) > 0.8 * len(filled)), None)


@dataclass(kw_only=True)
class Cells:
    """Converter of one column, chunk by chunk."""

    source: str
    """File name, for messages."""
    name: str
    """Header of the column, for messages."""
    decimal: str = "."
    dates: DateStyle | None = None
    """Notation of its dates or times of day, if it has such."""
    fault: str | None = None
    """Why the column cannot be used."""
    _filled: int = 0
    """Cells so far that are not empty."""
    _words: int = 0
    """Those of them that are no numbers."""
    _example: str = ""
    _last: float = np.nan
    """Last time of day, with the days before it."""

    def numbers(self, column: pa.Array) -> Array:
        """Values (n,), NaN where empty or no number."""
        if pa.types.is_dictionary(column.type):
            column = column.cast(column.type.value_type)
        if pa.types.is_string(column.type) or pa.types.is_large_string(column.type):
            return self._from_text(column) if self.dates is None else self._from_dates(column, self.dates)
        if pa.types.is_null(column.type):
            return np.full(len(column), np.nan)
        scale = 1.0
        if pa.types.is_temporal(column.type):
            if pa.types.is_date(column.type):
                column = column.cast(pa.timestamp("us"))
            scale = _PER_SECOND[column.type.unit]
            column = column.cast(pa.int32() if column.type.bit_width == 32 else pa.int64())
        try:
            values = column.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False)
        except pa.ArrowException:
            self.fault = f"{self.source}: column {self.name!r} holds {column.type}, numbers expected"
            return np.full(len(column), np.nan)
        self._filled += len(column) - column.null_count
        return np.asarray(values, dtype=np.float64) * scale

    def finish(self) -> str | None:
        """A note on cells that were no numbers, if any; where they are the most, it is a fault."""
        if self._words > self._filled / 2:
            self.fault = (
                f"{self.source}: column {self.name!r} is mostly text ({self._words} of {self._filled} cells, such as "
                f"{self._example[:30]!r}), numbers expected; name another column, or export it as numbers"
            )
        elif self._words:
            cells = f"{self._words} cells of column {self.name!r} are no numbers, such as {self._example[:30]!r}"
            return f"{cells}: taken as missing"
        return None

    def _from_dates(self, text: pa.Array, dates: DateStyle) -> Array:
        values = dates.seconds(text)
        self._filled += values.size
        self._words += int(np.isnan(values).sum())
        if dates.dated or not values.size:
            return values
        days = 0.0 if np.isnan(self._last) else _DAY * (self._last // _DAY)
        with np.errstate(invalid="ignore"):
            before = values[0] if np.isnan(self._last) else self._last - days
            midnight = np.diff(values, prepend=before) < -_DAY / 2
        values = values + days + _DAY * np.cumsum(midnight)
        self._last = float(values[-1])
        return np.asarray(values)

    def _from_text(self, text: pa.Array) -> Array:
        if self.decimal != ".":
            text = pc.replace_substring(text, self.decimal, ".")
        try:
            plain = pc.if_else(pc.equal(text, ""), pa.scalar(None, text.type), text)
            values = plain.cast(pa.float64()).to_numpy(zero_copy_only=False)
            self._filled += len(plain) - plain.null_count
            return np.asarray(values, dtype=np.float64)
        except pa.ArrowInvalid:  # blanks, words, or a number that only Python reads, such as "+1"
            text = pc.utf8_trim_whitespace(text)
        blank = pc.is_in(pc.utf8_lower(text), value_set=_BLANK_CELLS.cast(text.type))
        cells = pc.if_else(blank, pa.scalar(None, text.type), text).to_pylist()
        values = np.array([number(cell) for cell in cells], dtype=np.float64)
        wrong = [cell for cell, value in zip(cells, values, strict=True) if cell is not None and value != value]
        self._filled += sum(cell is not None for cell in cells)
        self._words += len(wrong)
        self._example = self._example or next(iter(wrong), "")
        return values


def number(cell: str | None) -> float:
    """The number in a cell, also with a minus of typography or an exponent of Fortran; NaN where it is none."""
    if cell is None or "_" in cell:
        return np.nan
    try:
        return float(_EXPONENT.sub("e", _MINUS.sub("-", cell)))
    except ValueError:
        return np.nan
