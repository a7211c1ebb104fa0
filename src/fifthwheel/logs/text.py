"""Text tables: CSV as loggers and spreadsheets write it, in whatever separator, decimal mark and encoding."""

import codecs
import csv
import re

import pyarrow as pa
import pyarrow.csv as pacsv

from fifthwheel.errors import SignalError
from fifthwheel.logs.table import Table

_BOMS = ((codecs.BOM_UTF8, "utf-8"), (codecs.BOM_UTF16_LE, "utf-16-le"), (codecs.BOM_UTF16_BE, "utf-16-be"))
_CONTROL = re.compile(r"[\x00-\x08\x0e-\x1f\x7f\ufffd]")
_COMMENT = re.compile(r"^[ \t]*#.*\n?|^[ \t]*\n", re.MULTILINE)
_DECIMAL_COMMA = re.compile(r"\s*[+-]?\d*,\d+([eE][+-]?\d+)?\s*")


def read_text(data: bytes, source: str) -> Table:
    """The table in the bytes of a CSV file; whole lines only, so one cut short in its last line loses that line."""
    text = decode(data, source).replace("\r\n", "\n").replace("\r", "\n")
    notes: list[str] = []
    comments = re.match(r"(?:[ \t]*(?:#.*)?\n)*", text)
    last = [line for line in (comments[0] if comments else "").splitlines() if line.strip()]
    body = _COMMENT.sub("", text) if "#" in text or "\n\n" in text or text[:1].isspace() else text
    if not body.strip():
        raise SignalError(f"{source}: empty, not a single line of a table")
    first, separator = _sniff(body)
    if last and all(map(_numeric, first)):  # as numpy.savetxt writes it: the header is the last comment
        header = last[-1].strip().lstrip("# ")
        if len(_cells(header, separator)) == len(first):
            body = f"{header}\n{body}"
            first, separator = _sniff(body)
    if len(first) < 2:
        raise SignalError(
            f"{source}: not a table, its first line {' '.join(first)[:40]!r} has one column; expected CSV"
        )
    if all(map(_numeric, first)):
        raise SignalError(f"{source}: begins with numbers; put a first line with the names of the columns above them")
    if not body.endswith("\n"):
        body, _, rest = body.rpartition("\n")
        if body and rest:
            notes.append(f"last line left out: no line end after {rest[-20:]!r}, it may be cut short")
    _, _, rows = body.partition("\n")
    if not rows.strip():
        raise SignalError(f"{source}: a header but no rows; the log is empty or was cut short")
    columns, crooked = _columns(rows, len(first), separator, source)
    if crooked:
        notes.append(f"{crooked} lines left out: not {len(first)} cells as in the header")
    decimal = "," if separator != "," and _decimal_comma(rows, separator) else "."
    return Table(source=source, headers=first, columns=columns, decimal=decimal, notes=tuple(notes))


def decode(data: bytes, source: str) -> str:
    """Text of a file by its byte order mark, else as UTF-8, else as Latin-1; a SignalError for what is no text."""
    encodings = [encoding for bom, encoding in _BOMS if data.startswith(bom)] or ["utf-8", "latin-1"]
    for encoding in encodings:
        try:
            text = codecs.getincrementaldecoder(encoding)().decode(data, final=False)  # a last character may be cut
        except UnicodeDecodeError:
            continue
        text = text.removeprefix("\ufeff")
        if not _CONTROL.search(text[:100_000]):
            return text
        break
    raise SignalError(f"{source}: not a table, it holds binary data; expected CSV or Parquet")


def _sniff(body: str) -> tuple[list[str], str]:
    """Cells of the first line and the separator that cuts it and the lines below into the most cells."""
    lines = body.split("\n", 5)[:5]
    lines = lines[:-1] if len(lines) > 1 else lines  # the last may be cut short
    counts = {mark: [len(_cells(line, mark)) for line in lines] for mark in ";\t,"}
    even = [mark for mark, count in counts.items() if count[0] > 1 and len(set(count)) == 1]
    best = even[0] if even else max(counts, key=lambda mark: counts[mark][0])
    return _cells(lines[0], best), best


def _cells(line: str, separator: str) -> list[str]:
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=separator), [])]
    except csv.Error:
        return [line]


def _columns(rows: str, width: int, separator: str, source: str) -> tuple[list[pa.ChunkedArray], int]:
    """Columns of text, and the number of lines that have another number of cells."""
    crooked = 0

    def skip(_: object) -> str:
        nonlocal crooked
        crooked += 1
        return "skip"

    names = [str(k) for k in range(width)]
    try:
        table = pacsv.read_csv(
            pa.py_buffer(rows.encode()),
            read_options=pacsv.ReadOptions(column_names=names, use_threads=False, block_size=1 << 24),
            parse_options=pacsv.ParseOptions(delimiter=separator, invalid_row_handler=skip),
            convert_options=pacsv.ConvertOptions(column_types=dict.fromkeys(names, pa.string())),
        )
    except (pa.ArrowException, UnicodeEncodeError) as error:
        raise SignalError(f"{source}: not a table that can be read ({error})") from error
    if crooked > table.num_rows:
        raise SignalError(
            f"{source}: not a table, {crooked} lines have not the {width} cells of the first; expected CSV"
        )
    return table.columns, crooked


def _decimal_comma(rows: str, separator: str) -> bool:
    cells = [cell for line in rows.split("\n", 50)[:50] for cell in _cells(line, separator)]
    return any(_DECIMAL_COMMA.fullmatch(cell) for cell in cells) and not any(
        re.fullmatch(r"-?\d*\.\d+", c) for c in cells
    )


def _numeric(cell: str) -> bool:
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True
