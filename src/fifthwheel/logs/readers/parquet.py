"""Parquet, with units in the names of the columns or in the metadata of its fields."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from fifthwheel.errors import SignalError
from fifthwheel.logs.log import Column, Log, Piece, Progress, quiet
from fifthwheel.logs.names import split_header
from fifthwheel.logs.readers.cells import Cells

_ROWS = 1 << 17
_DAMAGE = (pa.ArrowException, OSError, UnicodeDecodeError)


def open_log(path: Path, databases: Sequence[str | Path] = (), progress: Progress = quiet) -> Log:
    """A Parquet file, of which only the footer is read now."""
    return ParquetLog(path)


class ParquetLog(Log):
    """A Parquet file, read by batches of rows."""

    def __init__(self, path: Path) -> None:
        super().__init__(path.name)
        try:
            self._file = pq.ParquetFile(path, page_checksum_verification=True)
            fields = [(field.name, _unit(field)) for field in self._file.schema_arrow]
        except _DAMAGE as error:
            raise SignalError(
                f"{self.name}: a Parquet file cut short or damaged; copy it again, or export it as CSV"
            ) from error
        if not self._file.metadata.num_rows:
            raise SignalError(f"{self.name}: columns but no rows; the log is empty")
        self._places = {split_header(name)[0]: name for name, _ in fields}
        if len(self._places) < len(fields):
            raise SignalError(f"{self.name}: columns with the same name; rename all but one")
        self._columns = {
            name: Column(name=name, unit=unit) for name, (_, unit) in zip(self._places, fields, strict=True)
        }

    @property
    def columns(self) -> Mapping[str, Column]:
        return self._columns

    def pieces(self, columns: Collection[str]) -> Iterator[Piece]:
        self.notes = []
        wanted = [name for name in self._columns if name in columns]
        cells = {name: Cells(source=self.name, name=name) for name in wanted}
        rows, total = 0, self._file.metadata.num_rows
        try:
            for batch in self._file.iter_batches(_ROWS, columns=[self._places[name] for name in wanted]):
                batch.validate(full=True)
                values = {name: cells[name].numbers(batch.column(self._places[name])) for name in wanted}
                rows += batch.num_rows
                yield Piece(values=values, done=rows / total)
        except _DAMAGE as error:
            if not rows:
                raise SignalError(
                    f"{self.name}: a Parquet file that is damaged in its first rows; copy it again"
                ) from error
            self.notes.append(f"broken after {rows} of {total} rows; those before are used")
        self.notes += [note for one in cells.values() if (note := one.finish()) is not None]
        self.unusable |= {one.name: one.fault for one in cells.values() if one.fault is not None}

    def close(self) -> None:
        self._file.close()


def _unit(field: pa.Field) -> str | None:
    """Unit in the brackets of a name, else what other writers keep in the metadata."""
    return split_header(field.name)[1] or (field.metadata or {}).get(b"unit", b"").decode(errors="replace") or None
