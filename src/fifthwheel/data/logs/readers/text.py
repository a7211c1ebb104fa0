"""Text tables: CSV as loggers and spreadsheets write it, of any size, separator, decimal mark and encoding."""

import codecs
import csv
import math
import re
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from itertools import takewhile
from pathlib import Path
from typing import BinaryIO

import pyarrow as pa
import pyarrow.csv as pacsv

from fifthwheel.base.errors import SignalError
from fifthwheel.base.units import is_unit
from fifthwheel.data.channels import split_header
from fifthwheel.data.logs.readers.cells import BLANK, DATE_STYLES, Cells, DateStyle, date_style, number
from fifthwheel.data.logs.source import (
    PARTS,
    Chunk,
    Column,
    LogSource,
    ReadProgress,
    no_progress,
    part_size,
)

SEPARATORS = (";", "\t", ",", "|", " ")
"""In the order in which they are tried; " " stands for runs of blanks."""
_LINES = 200
"""Lines of the head that are examined."""
_DECIMAL_COMMA = re.compile(r"\D{0,3}\d*,\d+([eEdD][+-]?\d+)?")
_DECIMAL_POINT = re.compile(r"\D{0,3}\d*\.\d+([eEdD][+-]?\d+)?")
"""With any sign before it."""
_CONTROL = re.compile(rb"[\x00-\x08\x0e-\x1f\x7f]")
_HEAD = 1 << 19
_LONGEST_HEADER = 1 << 17
"""Characters of a line of the head, which must hold the header and some rows."""
_BLOCK = 1 << 20
_LONGEST_LINE = 1 << 22
_MOST_CONTROL = 0.01
"""Fraction of control characters above which a file is no text; fewer are damage."""
_NO_UNIT = ("", "-", "--", "n/a", "none")
_VBOX_UNITS = {"kmh": "km/h", "km/h": "km/h", "mph": "mph", "knots": "kn", "m/s": "m/s", "heading": "deg"}
"""By the last word of a long name."""
_MISSING = [*BLANK, *map(str.upper, BLANK), "NaN"]
"""Cells that pyarrow takes as missing numbers."""


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
    if (sections := _vbox_sections(lines)) is not None:
        return _vbox_layout(lines, sections)
    table = [k for k, line in enumerate(lines) if line.strip() and not line.lstrip().startswith("#")][:_LINES]
    if not table:
        raise SignalError(f"{source}: empty, not a single line of a table")
    separator, width, first = _separator(lines, table, source)
    cells = [_cells(lines[k], separator) for k in table]
    rows = [row for k, row in zip(table, cells, strict=True) if k >= first and len(row) == width]
    above = [k for k in table if k < first]
    names, units, used = _header(cells[: len(above)], width, ends_empty=not any(row[-1] for row in rows))
    if not names:  # as numpy.savetxt writes it: the header is the last comment
        comments = [line.strip().lstrip("# ") for line in lines[:first] if line.lstrip().startswith("#")]
        names = _cells(comments[-1], separator) if comments else []
        if len(names) != width:
            raise SignalError(f"{source}: {_header_fault(cells[: len(above)], width)}")
    split = [split_header(name) for name in names]
    numbers = [cell for row in rows for cell in row]
    has_commas = any(map(_DECIMAL_COMMA.fullmatch, numbers))
    rest = len(above) - used
    return TextLayout(
        names=_distinct([name or f"column {k}" for k, (name, _) in enumerate(split, 1)]),
        units=tuple(unit or below for (_, unit), below in zip(split, units, strict=True)),
        separator=separator,
        decimal="," if has_commas and not any(map(_DECIMAL_POINT.fullmatch, numbers)) else ".",
        dates=tuple(date_style([row[k] for row in rows]) for k in range(width)),
        start=sum(len(line.encode()) + 1 for line in lines[:first]),
        quoted='"' in head,
        notes=(f"{rest} comment line{'s' * (rest > 1)} above the header",) if rest else (),
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


def _header_fault(above: Sequence[list[str]], width: int) -> str:
    """What is wrong with the lines above rows of some width, and the cure."""
    names = [row for row in above if len(row) > 1 and not any(map(_is_sample, row))]
    if not names:
        return "begins with numbers; put a first line with the names of the columns above them"
    return (
        f"the header has {len(names[-1])} names, the rows have {width} cells; give each column one name, without the "
        "separator in it"
    )


def _vbox_sections(lines: Sequence[str]) -> dict[str, int] | None:
    """The line of each section of a file of Racelogic VBOX; None for other files."""
    sections = {line.strip().lower(): k for k, line in enumerate(lines) if re.fullmatch(r"\s*\[[\w ]+\]\s*", line)}
    return sections if {"[column names]", "[data]"} <= sections.keys() else None


def _vbox_layout(lines: Sequence[str], sections: Mapping[str, int]) -> TextLayout:
    """The table of a file of Racelogic VBOX. Its units follow the long names in its header ("velocity kmh"), and are
    listed for its last columns."""

    def listed(section: str) -> list[str]:
        below = lines[sections[section] + 1 :] if section in sections else []
        return [line.strip() for line in takewhile(lambda line: not line.startswith("["), below) if line.strip()]

    names = " ".join(listed("[column names]")[:1]).split()
    units = [_VBOX_UNITS.get(name.split()[-1].lower()) for name in listed("[header]")][: len(names)]
    own = listed("[channel units]")[-len(names) :]
    units += [None] * (len(names) - len(units))
    if own:
        units[-len(own) :] = own
    start = sections["[data]"] + 1
    return TextLayout(
        names=_distinct(names),
        units=tuple(unit if unit and is_unit(unit) else None for unit in units),
        separator=" ",
        decimal=".",
        dates=(None,) * len(names),
        start=sum(len(line.encode()) + 1 for line in lines[:start]),
        quoted=False,
        notes=(),
    )


def _header(above: Sequence[list[str]], width: int, *, ends_empty: bool) -> tuple[list[str], list[str | None], int]:
    """Names and units in the lines above the first row that are as wide as it, and the number of lines they take.

    A separator too many may end them, or all rows, whose last cell is then empty.
    """
    block: list[list[str]] = []
    for row in reversed(above):
        cells = row[:-1] if len(row) == width + 1 and not row[-1] else row
        cells = [*cells, ""] if ends_empty and len(cells) == width - 1 else cells
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
    return not math.isnan(number(cell.replace(",", "."))) or any(style.matches(cell) for style in DATE_STYLES)


def _is_units(row: Sequence[str]) -> bool:
    filled = [cell.strip("[]() ") for cell in row if cell.strip("[]() -")]
    return bool(filled) and 2 * sum(map(is_unit, filled)) >= len(filled)


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


def open_log(path: Path, databases: Sequence[str | Path] = (), progress: ReadProgress = no_progress) -> LogSource:
    """A text table. Only its head is read now."""
    with path.open("rb") as file:
        wide = file.read(2) in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
    return TextLog(path, read_layout(path), 0 if wide else path.stat().st_size)  # UTF-16 is read as a whole


def read_layout(path: Path) -> TextLayout:
    """The layout of a text table from its head; a SignalError if it is none."""
    with closing(_Lines(path)) as lines:
        head = (next(iter(lines), b"") or lines.unfinished)[:_HEAD]
    if len(_CONTROL.findall(head)) > _MOST_CONTROL * len(head):
        raise SignalError(f"{path.name}: not a table, it holds binary data; expected CSV or another known format")
    longest = max(map(len, head.split(b"\n")))
    if longest > _LONGEST_HEADER:
        most = f"at most {_LONGEST_HEADER / 1e3:.0f} kB expected in the header and the first rows"
        raise SignalError(f"{path.name}: a line of {longest / 1e3:.0f} kB or more, {most}; export fewer columns")
    if len(head) == _HEAD:
        head = head[: head.rindex(b"\n") + 1]
    return find_layout(head.decode("utf-8", "replace"), path.name)


class TextLog(LogSource):
    """A CSV file; a last line without line end is left out."""

    def __init__(self, path: Path, layout: TextLayout, size: int) -> None:
        columns = {}
        for name, unit, date in zip(map(_utf8, layout.names), layout.units, layout.dates, strict=True):
            named = None if unit is None or unit.strip() in _NO_UNIT else _utf8(unit)
            columns[name] = Column(name=name, unit="s" if date else named)
        super().__init__(path.name, columns)
        self._path, self._layout = path, layout
        self.size = size
        self.opening_notes += layout.notes
        self.notes += layout.notes

    def chunks(self, columns: Collection[str]) -> Iterator[Chunk]:
        """Rows of some columns; dates and times of day in s.

        Lines with another number of cells are left out and counted; where they are the most, that is a SignalError
        at the end of the file.
        """
        layout, names = self._layout, list(self.columns)
        self.notes = [*self.opening_notes]
        wanted = [k for k, name in enumerate(names) if name in columns]
        if not wanted:
            return
        cells = [Cells(source=self.name, name=names[k], decimal=layout.decimal, dates=layout.dates[k]) for k in wanted]
        kinds = {str(k): pa.string() if layout.dates[k] else pa.float64() for k in wanted}
        rows = uneven = 0
        with closing(_Lines(self._path, start=layout.start, sampled=self.sampled)) as lines:
            try:
                for block in lines:
                    try:
                        table, invalid = self._table(block, kinds)
                    except pa.ArrowInvalid:  # words, or a number that only Python reads: from here on all as text
                        kinds = dict.fromkeys(kinds, pa.string())
                        table, invalid = self._table(block, kinds)
                    rows, uneven = rows + table.num_rows, uneven + invalid
                    for batch in table.to_batches():
                        converted = zip(cells, batch.columns, strict=True)
                        yield Chunk(values={c.name: c.numbers(column) for c, column in converted}, done=lines.done)
            except pa.ArrowException as error:
                if not rows:
                    raise SignalError(f"{self.name}: not a table that can be read ({error})") from error
                self.notes.append(f"broken after {rows} rows ({error}); the rows before are used")
            if last := lines.unfinished.decode("utf-8", "replace")[-20:]:
                self.notes.append(f"last line left out: no line end after {last!r}, it may be cut short")
        if uneven > rows:
            raise SignalError(
                f"{self.name}: not a table, {uneven} lines have not the {len(names)} cells of the first; expected CSV"
            )
        self.notes += [f"{uneven} lines left out: not {len(names)} cells as in the header"] * bool(uneven)
        self.notes += [note for c in cells if (note := c.finish()) is not None]
        self.unusable |= {c.name: c.fault for c in cells if c.fault is not None}

    def _table(self, block: bytes, kinds: Mapping[str, pa.DataType]) -> tuple[pa.Table, int]:
        """Columns of these types in some lines, and the number of other lines that are no comments."""
        layout, uneven = self._layout, 0

        def skip(row: pacsv.InvalidRow) -> str:
            nonlocal uneven
            uneven += not (row.text or "").lstrip().startswith("#")
            return "skip"

        blanks = layout.separator == " "
        table = pacsv.read_csv(
            pa.BufferReader(_tabbed(block) if blanks else block),
            read_options=pacsv.ReadOptions(
                column_names=[str(k) for k in range(len(self.columns))], use_threads=False, block_size=len(block)
            ),
            parse_options=pacsv.ParseOptions(
                delimiter="\t" if blanks else layout.separator,
                invalid_row_handler=skip,
                quote_char='"' if layout.quoted else False,
            ),
            convert_options=pacsv.ConvertOptions(
                column_types=kinds, include_columns=[*kinds], null_values=_MISSING, decimal_point=layout.decimal
            ),
        )
        return table, uneven


def _utf8(text: str) -> str:
    """Text that is UTF-8 but was decoded as Latin-1."""
    try:
        return text.encode("latin-1").decode("utf-8")
    except UnicodeError:
        return text


def _parts(file: BinaryIO, size: int) -> Iterator[bytes]:
    """Whole lines from the place of a file and from evenly spread places behind it, the last lines included."""

    def next_line(place: int) -> int:
        file.seek(place)
        file.readline(_LONGEST_LINE)
        return file.tell()

    start, part = file.tell(), part_size(size)
    places = [start + k * (size - part - start) // (PARTS - 1) for k in range(PARTS)]
    starts = [start] + [next_line(place) for place in places[1:]]
    ends = [next_line(place + part) for place in places[:-1]] + [size]
    for first, end in zip(starts, ends, strict=True):
        file.seek(first)
        while block := file.read(min(_BLOCK, max(end - file.tell(), 0))):
            yield block


def _tabbed(lines: bytes) -> bytes:
    """Lines in which each run of blanks is one tab, and none begins or ends a line."""
    return re.sub(rb"[ \t]+", b"\t", re.sub(rb"^[ \t]+|[ \t]+$", b"", lines, flags=re.MULTILINE))


class _Lines:
    r"""The finished lines of a text file in blocks of bytes: UTF-8, "\n" as line ends, no byte order mark."""

    def __init__(self, path: Path, *, start: int = 0, sampled: bool = False) -> None:
        self._size, self._start, self._sampled = max(path.stat().st_size, 1), start, sampled
        self._file = path.open("rb")
        self._mark = self._file.read(len(codecs.BOM_UTF8))
        self._is_wide = self._mark.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
        self.unfinished = b""
        """What is after the last line end read so far."""

    @property
    def done(self) -> float:
        """Fraction of the file that has been read."""
        return min(1.0, self._file.tell() / self._size)

    def __iter__(self) -> Iterator[bytes]:
        """All lines but the first `start` bytes."""
        before = self._start
        for block in self._blocks():
            lines, end, self.unfinished = (self.unfinished + block).rpartition(b"\n")
            if len(self.unfinished) > _LONGEST_LINE:
                lines, self.unfinished = lines + end + self.unfinished, b""
            lines += end
            if len(lines) > before:
                yield lines[before:]
            before = max(before - len(lines), 0)

    def _blocks(self) -> Iterator[bytes]:
        self._file.seek(len(self._mark) if self._mark == codecs.BOM_UTF8 else 0)
        blocks = _parts(self._file, self._size) if self._sampled else iter(partial(self._file.read, _BLOCK), b"")
        decoder = codecs.getincrementaldecoder("utf-16")("replace")
        held = b""
        for block in blocks:
            if self._is_wide:
                block = decoder.decode(block).encode()
            elif not block.isascii():  # UTF-8 too is read byte by byte, which cannot fail, and put right by _utf8
                block = block.decode("latin-1").encode()
            if held or b"\r" in block:
                block = held + block
                held = block[-1:] if block.endswith(b"\r") else b""  # a line feed may follow
                block = block.removesuffix(held).replace(b"\r\n", b"\n").replace(b"\r", b"\n")
            yield block
        yield b"\n" if held else b""

    def close(self) -> None:
        self._file.close()
