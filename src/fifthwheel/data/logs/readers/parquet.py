"""Parquet, with units in the names of the columns or in the metadata of its fields."""

from collections.abc import Collection, Iterator, Sequence
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from fifthwheel.base.errors import SignalError
from fifthwheel.data.channels import split_header
from fifthwheel.data.logs.readers.cells import Cells
from fifthwheel.data.logs.source import (
    Chunk,
    Column,
    LogSource,
    ReadProgress,
    no_progress,
    parts_of,
)

_ROWS = 1 << 17
_DAMAGE = (pa.ArrowException, OSError, UnicodeDecodeError)


def open_log(path: Path, databases: Sequence[str | Path] = (), progress: ReadProgress = no_progress) -> LogSource:
    """A Parquet file. Only its footer is read now."""
    return ParquetLog(path)


class ParquetLog(LogSource):
    """A Parquet file, read by batches of rows."""

    def __init__(self, path: Path) -> None:
        try:
            self._file = pq.ParquetFile(path, page_checksum_verification=True)
            fields = [(*split_header(field.name), field) for field in self._file.schema_arrow]
            units = [unit or _metadata(field, "unit") or None for _, unit, field in fields]
        except MemoryError:  # a kind of ArrowException too
            raise
        except _DAMAGE as error:
            raise SignalError(
                f"{path.name}: a Parquet file that is cut short or damaged; copy it again, or export it as CSV"
            ) from error
        if not self._file.metadata.num_rows:
            raise SignalError(f"{path.name}: columns but no rows; the log is empty")
        self._headers = {name: field.name for name, _, field in fields}
        if len(self._headers) < len(fields):
            raise SignalError(f"{path.name}: columns with the same name; rename all but one")
        columns = {
            name: Column(name=name, unit=u, time_base=_metadata(f, "time_base"), sensor=_metadata(f, "sensor"))
            for (name, _, f), u in zip(fields, units, strict=True)
        }
        super().__init__(path.name, columns)
        self.size = path.stat().st_size

    def chunks(self, columns: Collection[str]) -> Iterator[Chunk]:
        self.notes = [*self.opening_notes]
        cells = {name: Cells(source=self.name, name=name) for name in self.columns if name in columns}
        rows, total = 0, self._file.metadata.num_rows
        try:
            for end, batch in self._batches([self._headers[name] for name in cells]):
                batch.validate(full=True)
                values = {name: cells[name].numbers(batch.column(self._headers[name])) for name in cells}
                rows = end
                yield Chunk(values=values, done=rows / total)
        except MemoryError:  # a kind of ArrowException too
            raise
        except _DAMAGE as error:
            if not rows:
                raise SignalError(
                    f"{self.name}: a Parquet file that is damaged in its first rows; copy it again"
                ) from error
            self.notes.append(f"broken after {rows} of {total} rows; the rows before are used")
        self.notes += [note for c in cells.values() if (note := c.finish()) is not None]
        self.unusable |= {c.name: c.fault for c in cells.values() if c.fault is not None}

    def _batches(self, headers: Sequence[str]) -> Iterator[tuple[int, pa.RecordBatch]]:
        """Number of the row after the batch, and the batch; of a sampled file those in its parts.

        A row group is decoded up to its last part, or not at all.
        """
        metadata = self._file.metadata
        parts = parts_of(metadata.num_rows, self.size) if self.sampled else [(0, metadata.num_rows)]
        stop = 0
        for group in range(metadata.num_row_groups):
            row, stop = stop, stop + metadata.row_group(group).num_rows
            inside = [(max(a, row), min(b, stop)) for a, b in parts if a < stop and b > row]
            for batch in self._file.iter_batches(_ROWS, row_groups=[group], columns=headers) if inside else ():
                end = row + batch.num_rows
                for a, b in ((max(a, row), min(b, end)) for a, b in inside):
                    if a < b:
                        yield b, batch.slice(a - row, b - a)
                row = end
                if row >= inside[-1][1]:
                    break

    def close(self) -> None:
        self._file.close()


def _metadata(field: pa.Field, key: str) -> str:
    return str((field.metadata or {}).get(key.encode(), b"").decode(errors="replace"))
