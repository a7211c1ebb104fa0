"""Text tables: CSV as loggers and spreadsheets write it, of any size, separator, decimal mark and encoding."""

import codecs
import io
import re
from collections.abc import Collection, Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import BinaryIO

import pyarrow as pa
import pyarrow.csv as pacsv

from fifthwheel.base.errors import SignalError
from fifthwheel.data.logs.readers.cells import Cells
from fifthwheel.data.logs.readers.layout import TextLayout, find_layout
from fifthwheel.data.logs.readers.sample import PARTS, is_large, part_size, sample_note
from fifthwheel.data.logs.source import Chunk, Column, LogSource, ReadProgress, no_progress

_CONTROL = re.compile(rb"[\x00-\x08\x0e-\x1f\x7f]")
_HEAD = 1 << 19
_LONGEST_HEADER = 1 << 17
"""Characters of a line of the head, which must hold the header and some rows."""
_BLOCK = 1 << 20
_LONGEST_LINE = 1 << 22
_MOST_CONTROL = 0.01
"""Fraction of control characters above which a file is no text; fewer are damage."""
_NO_UNIT = ("", "-", "--", "n/a", "none")


def open_log(path: Path, databases: Sequence[str | Path] = (), progress: ReadProgress = no_progress) -> LogSource:
    """A text table. Only its head is read now."""
    with _Lines(path) as lines:
        head = lines.read(_HEAD) or lines.unfinished.encode()
    if len(_CONTROL.findall(head)) > _MOST_CONTROL * len(head):
        raise SignalError(f"{path.name}: not a table, it holds binary data; expected CSV or another known format")
    longest = max(map(len, head.split(b"\n")))
    if longest > _LONGEST_HEADER:
        most = f"at most {_LONGEST_HEADER / 1e3:.0f} kB expected in the header and the first rows"
        raise SignalError(f"{path.name}: a line of {longest / 1e3:.0f} kB or more, {most}; export fewer columns")
    if len(head) == _HEAD:
        head = head[: head.rindex(b"\n") + 1]
    return TextLog(path, find_layout(head.decode("utf-8", "replace"), path.name))


class TextLog(LogSource):
    """A CSV file; a last line without line end is left out."""

    def __init__(self, path: Path, layout: TextLayout) -> None:
        columns = {}
        for name, unit, date in zip(map(_utf8, layout.names), layout.units, layout.dates, strict=True):
            named = None if unit is None or unit.strip() in _NO_UNIT else _utf8(unit)
            columns[name] = Column(name=name, unit="s" if date else named)
        super().__init__(path.name, columns)
        self._path, self._layout = path, layout
        self._notes = [*layout.notes]
        self.notes += self._notes

    def sample(self) -> None:
        """Read parts of a large file that are spread evenly over it; UTF-16 is read as a whole."""
        size = self._path.stat().st_size
        with _Lines(self._path) as lines:
            self.sampled = is_large(size) and not lines.wide
        if self.sampled:
            self._notes.append(sample_note(size))
            self.notes[:] = self._notes

    def chunks(self, columns: Collection[str]) -> Iterator[Chunk]:
        """Rows of some columns; dates and times of day in s.

        Lines with another number of cells are left out and counted; where they are the most, that is a SignalError
        at the end of the file.
        """
        layout, names = self._layout, list(self.columns)
        self.notes = [*self._notes]
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
