"""Layout of a text table: preamble, names, units, first row, separator and decimal mark."""

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from fifthwheel.base.errors import SignalError
from fifthwheel.base.units import is_unit
from fifthwheel.data.channels import split_header
from fifthwheel.data.logs.readers.cells import BLANK, DATE_STYLES, DateStyle, date_style

SEPARATORS = (";", "\t", ",", "|", " ")
"""In the order in which they are tried; " " stands for runs of blanks."""
_LINES = 200
"""Lines of the head that are examined."""
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")
_DECIMAL_POINT = re.compile(r"[+-]?\d*\.\d+([eE][+-]?\d+)?")


@dataclass(frozen=True, kw_only=True)
class TextLayout:
    """How to read the table in a text file."""

    names: tuple[str, ...]
    """Headers without their units."""
    units: tuple[str | None, ...]
    separator: str
    decimal: str
    dates: tuple[DateStyle | None, ...]
    """Notation of dates or times of day in each column; None where it has none."""
    start: int
    """Bytes before the first row."""
    quoted: bool
    notes: tuple[str, ...]


def find_layout(head: str, source: str) -> TextLayout:
    r"""The layout of a file that begins with `head`: whole lines that end in "\n", unless it is the whole file.

    A SignalError if it is no table, has no rows or no header.
    """
    lines = head.split("\n")
    table = [k for k, line in enumerate(lines) if line.strip() and not line.lstrip().startswith("#")][:_LINES]
    if not table:
        raise SignalError(f"{source}: empty, not a single line of a table")
    separator, width, first = _separator(lines, table, source)
    cells = [_cells(lines[k], separator) for k in table]
    rows = [row for k, row in zip(table, cells, strict=True) if k >= first and len(row) == width]
    above = [k for k in table if k < first]
    names, units, used = _header(cells[: len(above)], width)
    if not names:  # as numpy.savetxt writes it: the header is the last comment
        comments = [line.strip().lstrip("# ") for line in lines[:first] if line.lstrip().startswith("#")]
        names = _cells(comments[-1], separator) if comments else []
        if len(names) != width:
            raise SignalError(
                f"{source}: begins with numbers; put a first line with the names of the columns above them"
            )
    split = [split_header(name) for name in names]
    rest = len(above) - used
    return TextLayout(
        names=_distinct([name or f"column {k}" for k, (name, _) in enumerate(split, 1)]),
        units=tuple(unit or below for (_, unit), below in zip(split, units, strict=True)),
        separator=separator,
        decimal="," if _decimal_commas(rows) else ".",
        dates=tuple(date_style([row[k] for row in rows]) for k in range(width)),
        start=sum(len(line.encode()) + 1 for line in lines[:first]),
        quoted='"' in head,
        notes=(f"{rest} line{'s' * (rest > 1)} above the table left out",) if rest else (),
    )


def _separator(lines: Sequence[str], table: Sequence[int], source: str) -> tuple[str, int, int]:
    """Separator, cells in a row and first row, such that the most lines are rows of numbers."""
    most, best = 0, None
    for separator in SEPARATORS:
        cells = {k: _cells(lines[k], separator) for k in table}
        widths = Counter(len(row) for row in cells.values() if len(row) > 1 and _is_row(row))
        if not widths:
            continue
        width = max(widths, key=widths.__getitem__)
        if widths[width] > most:
            first = next(k for k in table if len(cells[k]) == width and _is_row(cells[k]))
            most, best = widths[width], (separator, width, first)
    if best is None:
        first_line = lines[table[0]].strip()
        if any(mark in first_line for mark in ";\t,"):
            raise SignalError(f"{source}: a header but no rows; the log is empty or was cut short")
        raise SignalError(f"{source}: not a table, its first line {first_line[:40]!r} has one column; expected CSV")
    return best


def _header(above: Sequence[list[str]], width: int) -> tuple[list[str], list[str | None], int]:
    """Names and units in the lines above the first row that are as wide as it, and the number of lines they take."""
    block: list[list[str]] = []
    for row in reversed(above):
        cells = row[:-1] if len(row) == width + 1 and not row[-1] else row  # one separator too many
        if len(cells) != width or not any(cells):
            break
        block.insert(0, cells)
    if not block:
        return [], [None] * width, 0
    names = max(block, key=lambda row: len({cell for cell in row if cell}))  # the most distinct cells, the first such
    units = next((row for row in block[block.index(names) + 1 :] if _is_units(row)), None)
    if units is None:
        return names, [None] * width, 1
    return names, [cell.strip("[]() ") or None for cell in units], 2


def _is_row(row: Sequence[str]) -> bool:
    """Whether cells are samples: half of those that are not empty are numbers or instants."""
    filled = [cell for cell in row if cell.lower() not in BLANK]
    return bool(filled) and 2 * sum(map(_is_sample, filled)) >= len(filled)


def _is_sample(cell: str) -> bool:
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return any(style.matches(cell) for style in DATE_STYLES)
    return "_" not in cell


def _is_units(row: Sequence[str]) -> bool:
    filled = [cell.strip("[]() ") for cell in row if cell.strip("[]() -")]
    return bool(filled) and 2 * sum(map(is_unit, filled)) >= len(filled)


def _decimal_commas(rows: Sequence[Sequence[str]]) -> bool:
    cells = [cell for row in rows for cell in row]
    return any(map(_DECIMAL_COMMA.fullmatch, cells)) and not any(map(_DECIMAL_POINT.fullmatch, cells))


def _cells(line: str, separator: str) -> list[str]:
    if separator == " ":
        return line.split()
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=separator), [])]
    except csv.Error:
        return [line]


def _distinct(names: Sequence[str]) -> tuple[str, ...]:
    """Unique names: those that occur several times get "@1", "@2"."""
    total, count = Counter(names), Counter[str]()
    unique = []
    for name in names:
        count[name] += 1
        unique.append(name if total[name] == 1 else f"{name}@{count[name]}")
    return tuple(unique)
