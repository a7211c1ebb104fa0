"""Cells to numbers: what stands in a column of a table, as float64, with what is no number counted."""

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from fifthwheel.logs.log import Array
from fifthwheel.logs.readers import dates

BLANK = ("", "nan", "na", "n/a", "#n/a", "null", "none", "-", "?")
"""What stands for a missing sample, in lower case."""


@dataclass(kw_only=True)
class Cells:
    """One column on its way to numbers, piece by piece."""

    source: str
    """File name, for messages."""
    name: str
    """Header of the column, for messages."""
    decimal: str = "."
    dates: "dates.Style | None" = None
    """How its dates or times of day are written, where it holds such."""
    filled: int = 0
    """Cells so far that hold something."""
    words: int = 0
    """Those of them that are no numbers, and are taken as missing."""
    example: str = ""
    fault: str | None = None
    """Why the column is of no use, once that is known."""

    def numbers(self, column: pa.Array) -> Array:
        """Values (n,), NaN where empty or no number."""
        if pa.types.is_dictionary(column.type):
            column = column.cast(column.type.value_type)
        if pa.types.is_string(column.type) or pa.types.is_large_string(column.type):
            return self._parsed(column)
        if pa.types.is_null(column.type):
            return np.full(len(column), np.nan)
        scale = 1.0
        if pa.types.is_temporal(column.type):
            if not (pa.types.is_timestamp(column.type) or pa.types.is_duration(column.type)):
                column = column.cast(pa.timestamp("us")) if pa.types.is_date(column.type) else column
            per_second = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
            scale = per_second[column.type.unit]
            column = column.cast(pa.int32() if column.type.bit_width == 32 else pa.int64())
        try:
            values = column.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False)
        except pa.ArrowException:
            self.fault = f"{self.source}: column {self.name!r} holds {column.type}, numbers expected"
            return np.full(len(column), np.nan)
        return np.asarray(values, dtype=np.float64) * scale

    def finish(self) -> str | None:
        """A note on what was no number, if anything; mostly text is a fault."""
        if self.words > self.filled / 2:
            self.fault = (
                f"{self.source}: column {self.name!r} is mostly text ({self.words} of {self.filled} cells, such as "
                f"{self.example[:30]!r}), numbers expected; name another column, or export it as numbers"
            )
        elif self.words:
            return f"{self.words} cells of column {self.name!r} are no numbers, taken as missing"
        return None

    def _parsed(self, text: pa.Array) -> Array:
        if self.dates is not None:
            values = self.dates.seconds(text)
            self.filled += values.size
            self.words += int(np.isnan(values).sum())
            return values
        if self.decimal != ".":
            text = pc.replace_substring(text, self.decimal, ".")
        try:
            plain = pc.if_else(pc.equal(text, ""), pa.scalar(None, text.type), text)
            values = plain.cast(pa.float64()).to_numpy(zero_copy_only=False)
            self.filled += len(plain) - plain.null_count
            return np.asarray(values, dtype=np.float64)
        except pa.ArrowInvalid:  # blanks, words, or a number only Python can read, such as "+1"
            text = pc.utf8_trim_whitespace(text)
        blank = pc.is_in(pc.utf8_lower(text), value_set=pa.array(BLANK, text.type))
        cells = pc.if_else(blank, pa.scalar(None, text.type), text).to_pylist()
        values = np.array([number(cell) for cell in cells], dtype=np.float64)
        wrong = [cell for cell, value in zip(cells, values, strict=True) if cell is not None and value != value]
        self.filled += sum(cell is not None for cell in cells)
        self.words += len(wrong)
        self.example = self.example or next(iter(wrong), "")
        return values


def number(cell: str | None) -> float:
    """A cell's number with a decimal point, NaN where it is none."""
    try:
        return float(cell) if cell is not None and "_" not in cell else np.nan
    except ValueError:
        return np.nan
