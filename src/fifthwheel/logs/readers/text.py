"""Text tables: CSV as loggers and spreadsheets write it, whatever its size, separator, decimal mark and encoding."""

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path

import pyarrow as pa
import pyarrow.csv as pacsv

from fifthwheel.errors import SignalError
from fifthwheel.logs.log import Column, Log, Piece, Progress, quiet
from fifthwheel.logs.readers import dates
from fifthwheel.logs.readers.cells import Cells
from fifthwheel.logs.readers.layout import find_layout
from fifthwheel.logs.readers.lines import Lines

_CONTROL = re.compile(rb"[\x00-\x08\x0e-\x1f\x7f]")
_HEAD = 1 << 18
_BLOCK = 1 << 20
_RUBBISH = 0.01
"""Share of control characters above which a file is no text; fewer are damage."""
_NO_UNIT = ("", "-", "--", "n/a", "none")
_LOOKED_AT = 200
"""Lines of the head from which the layout is told."""


def open_log(path: Path, databases: Sequence[str | Path] = (), progress: Progress = quiet) -> Log:
    """A text table, of which only the head is read now."""
    return TextLog(path)


class TextLog(Log):
    """A CSV file; whole lines only, so one cut short in its last line loses that line."""

    def __init__(self, path: Path) -> None:
        super().__init__(path.name)
        self._path = path
        with Lines(path) as lines:
            head = lines.read(_HEAD)
            self._left_over = lines.left_over
        if len(_CONTROL.findall(head)) > _RUBBISH * len(head):
            raise SignalError(f"{self.name}: not a table, it holds binary data; expected CSV or another known format")
        whole = head if len(head) < _HEAD else head[: head.rindex(b"\n") + 1] if b"\n" in head else head
        self._layout = find_layout(whole.decode("utf-8", "replace"), _LOOKED_AT, self.name)
        self._first_notes = [*self._layout.notes]
        if self._left_over:
            self._first_notes.append(f"last line left out: no line end after {self._left_over!r}, it may be cut short")
        self.notes = [*self._first_notes]
        names = [_proper(name) for name in self._layout.names]
        units = [None if unit is None or unit.strip() in _NO_UNIT else _proper(unit) for unit in self._layout.units]
        units = ["s" if date else unit for date, unit in zip(self._layout.dates, units, strict=True)]
        self._columns = {name: Column(name=name, unit=unit) for name, unit in zip(names, units, strict=True)}

    @property
    def columns(self) -> Mapping[str, Column]:
        return self._columns

    def pieces(self, columns: Collection[str]) -> Iterator[Piece]:
        """Rows of some columns; dates and times of day in s.

        Lines with another number of cells are left out and counted; where they are the most, that is a SignalError
        once all is read.
        """
        layout = self._layout
        self.notes = [*self._first_notes]
        wanted = [k for k, name in enumerate(self._columns) if name in columns]
        if not wanted:
            return
        names = list(self._columns)
        cells = {
            k: Cells(source=self.name, name=names[k], decimal=layout.decimal, dates=layout.dates[k]) for k in wanted
        }
        last = dict.fromkeys(wanted, float("nan"))
        rows = crooked = 0

        def skip(row: pacsv.InvalidRow) -> str:
            nonlocal crooked
            crooked += not (row.text or "").lstrip().startswith("#")
            return "skip"

        with Lines(self._path) as lines:
            try:
                lines.skip(layout.start)
                if layout.separator == " ":
                    lines.collapse()
                for batch in self._batches(lines, wanted, skip):
                    values = {}
                    for k, column in zip(wanted, batch.columns, strict=True):
                        values[names[k]] = cells[k].numbers(column)
                        style = layout.dates[k]
                        if style is not None and not style.dated:
                            values[names[k]] = dates.unwrapped(values[names[k]], last[k])
                            last[k] = float(values[names[k]][-1]) if batch.num_rows else last[k]
                    rows += batch.num_rows
                    yield Piece(values=values, done=lines.done)
            except pa.ArrowException as error:
                if not rows:
                    raise SignalError(f"{self.name}: not a table that can be read ({error})") from error
                self.notes.append(f"broken after {rows} rows ({error}); what is before them is used")
        if crooked > rows:
            raise SignalError(
                f"{self.name}: not a table, {crooked} lines have not the {len(names)} cells of the first; expected CSV"
            )
        self.notes += [f"{crooked} lines left out: not {len(names)} cells as in the header"] * bool(crooked)
        self.notes += [note for one in cells.values() if (note := one.finish()) is not None]
        self.unusable |= {one.name: one.fault for one in cells.values() if one.fault is not None}

    def _batches(self, lines: "Lines", wanted: Sequence[int], skip: object) -> Iterator[pa.RecordBatch]:
        names = [str(k) for k in range(len(self._columns))]
        mark = "\t" if self._layout.separator == " " else self._layout.separator
        reader = pacsv.open_csv(
            pa.PythonFile(lines, mode="r"),
            read_options=pacsv.ReadOptions(column_names=names, use_threads=False, block_size=_BLOCK),
            parse_options=pacsv.ParseOptions(
                delimiter=mark, invalid_row_handler=skip, quote_char='"' if self._layout.quoted else False
            ),
            convert_options=pacsv.ConvertOptions(
                column_types=dict.fromkeys(names, pa.string()), include_columns=[str(k) for k in wanted]
            ),
        )
        yield from reader


def _proper(text: str) -> str:
    """What was UTF-8 and was taken for Latin-1."""
    try:
        return text.encode("latin-1").decode("utf-8")
    except UnicodeError:
        return text
