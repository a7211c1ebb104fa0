"""Text tables: CSV as loggers and spreadsheets write it, of any size, separator, decimal mark and encoding."""

import codecs
import csv
import io
import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import BinaryIO

import pyarrow as pa
import pyarrow.csv as pacsv

from fifthwheel.base.errors import SignalError
from fifthwheel.base.units import is_unit
from fifthwheel.data.channels import split_header
from fifthwheel.data.logs.readers.cells import BLANK, DATE_STYLES, Cells, DateStyle, date_style
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
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")
_DECIMAL_POINT = re.compile(r"[+-]?\d*\.\d+([eE][+-]?\d+)?")
_CONTROL = re.compile(rb"[\x00-\x08\x0e-\x1f\x7f]")
_HEAD = 1 << 19
_LONGEST_HEADER = 1 << 17
"""Characters of a line of the head, which must hold the header and some rows."""
_BLOCK = 1 << 20
_LONGEST_LINE = 1 << 22
_MOST_CONTROL = 0.01
"""Fraction of control characters above which a file is no text; fewer are damage."""
_NO_UNIT = ("", "-", "--", "n/a", "none")


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
    with _Lines(path) as lines:
        head = lines.read(_HEAD) or lines.unfinished.encode()
        size = 0 if lines.wide else path.stat().st_size  # UTF-16 is read as a whole
    if len(_CONTROL.findall(head)) > _MOST_CONTROL * len(head):
        raise SignalError(f"{path.name}: not a table, it holds binary data; expected CSV or another known format")
    longest = max(map(len, head.split(b"\n")))
    if longest > _LONGEST_HEADER:
        most = f"at most {_LONGEST_HEADER / 1e3:.0f} kB expected in the header and the first rows"
        raise SignalError(f"{path.name}: a line of {longest / 1e3:.0f} kB or more, {most}; export fewer columns")
    if len(head) == _HEAD:
        head = head[: head.rindex(b"\n") + 1]
    return TextLog(path, find_layout(head.decode("utf-8", "replace"), path.name), size)


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
        rows = uneven = 0

        def skip(row: pacsv.InvalidRow) -> str:
            nonlocal uneven
            uneven += not (row.text or "").lstrip().startswith("#")
            return "skip"

        with _Lines(self._path, sampled=self.sampled) as lines:
            try:
                lines.skip(layout.start)
                if layout.separator == " ":
                    lines.collapse()
                for batch in self._batches(lines, wanted, skip):
                    converted = zip(cells, batch.columns, strict=True)
                    rows += batch.num_rows
                    yield Chunk(values={c.name: c.numbers(column) for c, column in converted}, done=lines.done)
            except pa.ArrowException as error:
                if not rows:
                    raise SignalError(f"{self.name}: not a table that can be read ({error})") from error
                self.notes.append(f"broken after {rows} rows ({error}); the rows before are used")
            if last := lines.unfinished[-20:]:
                self.notes.append(f"last line left out: no line end after {last!r}, it may be cut short")
        if uneven > rows:
            raise SignalError(
                f"{self.name}: not a table, {uneven} lines have not the {len(names)} cells of the first; expected CSV"
            )
        self.notes += [f"{uneven} lines left out: not {len(names)} cells as in the header"] * bool(uneven)
        self.notes += [note for c in cells if (note := c.finish()) is not None]
        self.unusable |= {c.name: c.fault for c in cells if c.fault is not None}

    def _batches(self, lines: "_Lines", wanted: Sequence[int], skip: object) -> Iterator[pa.RecordBatch]:
        names = [str(k) for k in range(len(self.columns))]
        mark = "\t" if self._layout.separator == " " else self._layout.separator
        yield from pacsv.open_csv(
            pa.PythonFile(lines, mode="r"),
            read_options=pacsv.ReadOptions(column_names=names, use_threads=False, block_size=_BLOCK),
            parse_options=pacsv.ParseOptions(
                delimiter=mark, invalid_row_handler=skip, quote_char='"' if self._layout.quoted else False
            ),
            convert_options=pacsv.ConvertOptions(
                column_types=dict.fromkeys(names, pa.string()), include_columns=[str(k) for k in wanted]
            ),
        )


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


def _texts(blocks: Iterable[bytes], encoding: str) -> Iterator[str]:
    r"""Blocks of bytes as text with "\n" as line ends."""
    decoder = io.IncrementalNewlineDecoder(codecs.getincrementaldecoder(encoding)("replace"), translate=True)
    for block in blocks:
        yield decoder.decode(block)
    yield decoder.decode(b"", final=True)


class _Lines(io.RawIOBase):
    r"""The finished lines of a text file as bytes that pyarrow reads: UTF-8, "\n" as line ends, no byte order mark."""

    def __init__(self, path: Path, *, sampled: bool = False) -> None:
        super().__init__()
        self._size = max(path.stat().st_size, 1)
        self._file = path.open("rb")
        mark = self._file.read(len(codecs.BOM_UTF8))
        self.wide = mark.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
        """Whether it is in UTF-16."""
        self._file.seek(len(mark) if mark == codecs.BOM_UTF8 else 0)
        blocks = _parts(self._file, self._size) if sampled else iter(partial(self._file.read, _BLOCK), b"")
        # UTF-8 too is read byte by byte, which cannot fail, and put right by _utf8 where it matters
        self._texts = _texts(blocks, "utf-16" if self.wide else "latin-1")
        self._ready = b""
        self._collapsing = False
        self.unfinished = ""
        """What is after the last line end read so far."""

    @property
    def done(self) -> float:
        """Fraction of the file that has been read."""
        return 1.0 if self.closed else min(1.0, self._file.tell() / self._size)

    def readable(self) -> bool:
        return True

    def read(self, size: int = -1) -> bytes:
        """About `size` bytes, at least one; b"" at the end."""
        while len(self._ready) < max(size, 1) or size < 0:
            chunk = next(self._texts, None)
            if chunk is None:
                break
            lines, end, self.unfinished = (self.unfinished + chunk).rpartition("\n")
            if len(self.unfinished) > _LONGEST_LINE:
                lines, self.unfinished = lines + end + self.unfinished, ""
            self._ready += self._plain((lines + end).encode())
        size = len(self._ready) if size < 0 else size
        given, self._ready = self._ready[:size], self._ready[size:]
        return given

    def skip(self, size: int) -> None:
        """Leave out the first bytes."""
        while size > 0 and (given := self.read(min(size, _BLOCK))):
            size -= len(given)

    def collapse(self) -> None:
        """From here on a run of blanks is one tab, and none begins or ends a line."""
        self._collapsing = True
        self._ready = self._plain(self._ready)

    def close(self) -> None:
        self._file.close()
        super().close()

    def _plain(self, lines: bytes) -> bytes:
        if not self._collapsing:
            return lines
        return re.sub(rb"[ \t]+", b"\t", re.sub(rb"^[ \t]+|[ \t]+$", b"", lines, flags=re.MULTILINE))
