"""Dates and times of day in text, as seconds."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from fifthwheel.logs.log import Array

_CLOCK = r"(?P<H>\d{1,2}):(?P<M>\d{2}):(?P<S>\d{2}(?:[.,]\d+)?)(?: ?(?P<half>[AaPp])[Mm])?"
_ZONE = r"(?: ?(?:Z|UTC|[+-]\d{2}:?\d{2}))?"
_DAYS = (
    r"(?P<y>\d{4})[-/.](?P<m>\d{1,2})[-/.](?P<d>\d{1,2})",
    r"(?P<d>\d{1,2})\.(?P<m>\d{1,2})\.(?P<y>\d{4})",
    r"(?P<m>\d{1,2})/(?P<d>\d{1,2})/(?P<y>\d{4})",
    r"(?P<d>\d{1,2})/(?P<m>\d{1,2})/(?P<y>\d{4})",
)
_DAY = 86400.0


@dataclass(frozen=True, kw_only=True)
class Style:
    """One way of writing an instant."""

    pattern: str
    """Regular expression with groups y, m, d (all or none), H, M, S, half."""

    @property
    def dated(self) -> bool:
        """Whether it says the day too; else it is the time of day."""
        return "(?P<y>" in self.pattern

    def matches(self, cell: str) -> bool:
        """Whether a cell is written so, and is a date at all."""
        found = re.fullmatch(self.pattern, cell.strip())
        return found is not None and (not self.dated or (int(found["m"]) <= 12 and int(found["d"]) <= 31))

    def seconds(self, text: pa.Array) -> Array:
        """Seconds (n,) since 1970, or since midnight where there is no day; NaN for what is written otherwise."""
        parts = pc.extract_regex(pc.utf8_trim_whitespace(text), f"^{self.pattern}$")

        def part(name: str) -> Array:
            cells = pc.replace_substring(parts.field(name), ",", ".")
            filled = pc.if_else(pc.equal(cells, ""), pa.scalar(None, cells.type), cells)
            return np.asarray(filled.cast(pa.float64()).to_numpy(zero_copy_only=False), dtype=np.float64)

        hour = part("H")
        half = np.array([(cell or "").lower() for cell in parts.field("half").to_pylist()])
        hour = np.where(half == "p", hour % 12 + 12, np.where(half == "a", hour % 12, hour))
        seconds = hour * 3600 + part("M") * 60 + part("S")
        if self.dated:
            known = np.isfinite(seconds)
            year, month, day = (np.where(known, part(name), 1).astype(int) for name in "ymd")
            days = (year - 1970).astype("datetime64[Y]").astype("datetime64[M]") + (month - 1)
            seconds = seconds + ((days.astype("datetime64[D]").astype(np.int64) + day - 1) * _DAY)
        return seconds


STYLES = (*[Style(pattern=rf"{day}[T ] ?{_CLOCK}{_ZONE}") for day in _DAYS], Style(pattern=_CLOCK))


def style(cells: Sequence[str]) -> Style | None:
    """The way in which nearly all cells that hold something write an instant; None where they do not."""
    filled = [cell for cell in cells if cell.strip()]
    return next((one for one in STYLES if filled and sum(map(one.matches, filled)) > 0.8 * len(filled)), None)


def unwrapped(seconds: Array, last: float) -> Array:
    """Times of day (n,) that go on over midnight; `last` is what came before, unwrapped, NaN at the start."""
    if not seconds.size:
        return seconds
    days = 0.0 if np.isnan(last) else _DAY * (last // _DAY)
    with np.errstate(invalid="ignore"):
        midnight = np.diff(seconds, prepend=seconds[0] if np.isnan(last) else last - days) < -_DAY / 2
    return np.asarray(seconds + days + _DAY * np.cumsum(midnight))
