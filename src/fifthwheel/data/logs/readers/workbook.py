"""Excel workbooks and OpenDocument spreadsheets by python-calamine: the first sheet with a table.

The sheet is written as text beside, and read like any other text table, so header, units and dates have one meaning.
"""

from collections.abc import Sequence
from datetime import date, time, timedelta
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

from python_calamine import CalamineSheet, CalamineWorkbook, SheetTypeEnum

from fifthwheel.base.errors import SignalError
from fifthwheel.data.logs.readers.text import TextLog, read_layout
from fifthwheel.data.logs.source import LogSource, ReadProgress, no_progress

_BREAKS = str.maketrans('\t\r\n\v\f"', "     '")
"""What would end a cell or a line of the text, or begin a quotation."""


def open_log(path: Path, databases: Sequence[str | Path] = (), progress: ReadProgress = no_progress) -> LogSource:
    """The first sheet with a table; SignalError where no sheet has one."""
    return WorkbookLog(path, progress)


class WorkbookLog(TextLog):
    """A sheet of a workbook, as a text in a temporary folder."""

    def __init__(self, path: Path, progress: ReadProgress) -> None:
        text, refused = Path(mkdtemp()) / path.name, dict[str, str]()  # in the folder of the child, which is removed
        book = CalamineWorkbook.from_path(path)
        sheets = [sheet.name for sheet in book.sheets_metadata if sheet.typ == SheetTypeEnum.WorkSheet]
        for name in sheets:
            _write(book.get_sheet_by_name(name), text, progress)
            try:
                super().__init__(text, read_layout(text), 0)  # parts of a sheet cannot be read
            except SignalError as error:
                refused[name] = str(error).removeprefix(f"{path.name}: ")
                continue
            if others := ", ".join(repr(other) for other in sheets if other != name):
                self.opening_notes.append(f"sheet {name!r} is read, and not {others}")
                self.notes = [*self.opening_notes]
            return
        found = "; ".join(f"sheet {name!r}: {why}" for name, why in [*refused.items()][:5])
        raise SignalError(f"{path.name}: no sheet with a table; {found}")


def _write(sheet: CalamineSheet, path: Path, progress: ReadProgress) -> None:
    """Write the rows of a sheet as lines with tabs between the cells."""
    with path.open("w", encoding="utf-8", errors="replace") as file:
        for number, row in enumerate(sheet.iter_rows()):
            file.write("\t".join(map(_text, row)) + "\n")
            if number % 10_000 == 0:
                progress(0.9 * number / max(sheet.height, 1))


def _text(cell: Any) -> str:
    """A cell as the text reader understands it; durations in s."""
    if isinstance(cell, str):
        return cell.translate(_BREAKS)
    if isinstance(cell, date | time):
        return cell.isoformat() + "T00:00:00" * (type(cell) is date)
    return repr(cell.total_seconds() if isinstance(cell, timedelta) else float(cell))
