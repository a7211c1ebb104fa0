"""A table: the columns of a file as they stand in it, turned into numbers only when a signal asks for one."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from fifthwheel.errors import SignalError
from fifthwheel.logs.names import split_header, suggest
from fifthwheel.logs.record import Array

_BLANK = ("", "nan", "na", "n/a", "#n/a", "null", "none", "-", "?")


@dataclass(frozen=True, kw_only=True, eq=False)
class Table:
    """Columns of equal length with their headers, and what the reader had to leave out."""

    source: str
    """File name, for messages."""
    headers: Sequence[str]
    """As in the file: "speed [km/h]"."""
    columns: Sequence[pa.ChunkedArray]
    """One a header: numbers, or text still to be parsed."""
    decimal: str = "."
    """Decimal mark of the text columns."""
    notes: tuple[str, ...] = ()
    """What was left out, a sentence each."""

    def find(self, name: str) -> int:
        """Index of a column by its whole header, or by the header without the unit."""
        for names in (list(self.headers), [split_header(header)[0] for header in self.headers]):
            if names.count(name) > 1:
                raise SignalError(
                    f"{self.source}: column {name!r} is there {names.count(name)} times; rename all but one"
                )
            if name in names:
                return names.index(name)
        raise SignalError(
            f"{self.source}: no column {name!r}; {suggest(name, [split_header(h)[0] for h in self.headers])}"
        )

    def unit(self, name: str) -> str | None:
        """Unit in the header of a column, if it has one."""
        return split_header(self.headers[self.find(name)])[1]

    def numbers(self, name: str) -> tuple[Array, int]:
        """The values of a column, (N,) with NaN where empty, and how many cells were text; mostly text is an error."""
        column = self.columns[self.find(name)]
        if pa.types.is_dictionary(column.type):
            column = column.cast(column.type.value_type)
        if pa.types.is_string(column.type) or pa.types.is_large_string(column.type):
            return self._parsed(name, column)
        if pa.types.is_null(column.type):
            return np.full(len(column), np.nan), 0
        try:
            values = np.asarray(column.cast(pa.float64(), safe=False).to_numpy(), dtype=np.float64)
        except pa.ArrowException as error:
            raise SignalError(f"{self.source}: column {name!r} holds {column.type}, numbers expected") from error
        return values, 0

    def _parsed(self, name: str, text: pa.ChunkedArray) -> tuple[Array, int]:
        text = pc.utf8_trim_whitespace(text)
        if self.decimal != ".":
            text = pc.replace_substring(text, self.decimal, ".")
        blank = pc.is_in(pc.utf8_lower(text), value_set=pa.array(_BLANK, text.type))
        text = pc.if_else(blank, pa.scalar(None, text.type), text)
        filled = len(text) - text.null_count
        try:
            return np.array(text.cast(pa.float64()).to_numpy(), dtype=np.float64), 0
        except pa.ArrowInvalid:  # some cell is text, or a number only Python can read, such as "+1"
            values = np.array([_number(cell) for cell in text.to_pylist()])
        words = filled - int(np.count_nonzero(~np.isnan(values)))
        if words > filled / 2:
            example = next(cell for cell in text.to_pylist() if cell is not None and np.isnan(_number(cell)))
            raise SignalError(
                f"{self.source}: column {name!r} is mostly text ({words} of {filled} cells, such as {example[:30]!r}), "
                f"numbers expected; name another column, or export it as numbers"
            )
        return values, words


def _number(cell: str | None) -> float:
    try:
        return float(cell) if cell is not None and "_" not in cell else np.nan
    except ValueError:
        return np.nan
