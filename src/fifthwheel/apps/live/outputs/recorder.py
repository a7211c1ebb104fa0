"""Writing files beside the node, and the record of a live run: pieces that are complete files, joined at the end.

The pieces are in the folder NAME.parts beside the file. Each appears complete or not at all, so a process that is
killed leaves the pieces; the next run with the same file adds to them.
"""

import queue
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fifthwheel.apps.live.status import NodeStatus
from fifthwheel.base.atomic import atomic_write
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.lazy import require

WAITING = 8
"""Jobs that may wait; more, and the disk does not keep up."""
PIECE = 1000
"""Rows of a piece: 10 s."""
RECORD, MESSAGES = ".parquet", ".mcap"
"""Endings of files: all numbers, and messages of ROS 2."""

Rows = Sequence[Mapping[str, float]]


class BackgroundWriter:
    """Runs jobs one after the other in a thread, so that a slow disk does not delay the node; an error is kept."""

    def __init__(self) -> None:
        self.errors: dict[str, str] = {}
        """Why the last job of a kind failed; empty while all is well."""
        self._jobs: queue.Queue[tuple[str, Callable[[], object]] | None] = queue.Queue(WAITING)
        self._thread = threading.Thread(target=self._run, name="fifthwheel writer", daemon=True)
        self._thread.start()

    def submit(self, kind: str, job: Callable[[], object], *, wait: bool = False) -> bool:
        """Run a job soon; False if too many are pending, unless it may `wait` for them."""
        try:
            self._jobs.put((kind, job), block=wait)
        except queue.Full:
            self.errors[kind] = "the disk does not keep up; use a faster one"
            return False
        return True

    def close(self) -> None:
        """Wait until all jobs are done."""
        self._jobs.put(None)
        self._thread.join()

    def _run(self) -> None:
        while (item := self._jobs.get()) is not None:
            kind, job = item
            try:
                job()
                self.errors.pop(kind, None)
            except Exception as error:  # whatever it is, the node must go on; the status says it
                self.errors[kind] = str(error)


class Recorder:
    """Writes rows of numbers to a file with one of these endings; another one is an error."""

    def __init__(self, path: Path, writer: BackgroundWriter, ending: str = RECORD) -> None:
        if path.suffix != ending:
            raise FifthwheelError(f"{path}: no format for {path.suffix!r}; end the name in {ending}")
        if ending == MESSAGES:
            require("mcap_ros2", "mcap")
        self.path = path
        self.parts = path.with_name(f"{path.name}.parts")
        self._write, self._join = _FORMATS[ending]
        self._writer = writer
        self.parts.mkdir(parents=True, exist_ok=True)
        self._count = 1 + max((int(part.stem) for part in self._pieces()), default=0)
        self._rows: list[Mapping[str, float]] = []
        self._lost, self._reason = 0, ""  # rows that could not be written, and why

    def add(self, row: Mapping[str, float]) -> None:
        """Add a row; every `PIECE` rows are written. Rows that cannot be written are lost, and the writer says so."""
        self._rows.append(row)
        if len(self._rows) >= PIECE:
            self.flush()

    def flush(self) -> None:
        """Write the rows that are not yet written."""
        if self._rows:
            rows, self._rows = self._rows, []
            part = self.parts / f"{self._count:06d}{self.path.suffix}"
            self._count += self._writer.submit(self.path.suffix, partial(self._write_piece, part, rows))

    def close(self) -> None:
        """Write the rest and join the pieces; without space for the whole file the pieces stay."""
        self.flush()
        self._writer.submit(self.path.suffix, self._finish, wait=True)

    def _pieces(self) -> list[Path]:
        return sorted(part for part in self.parts.glob(f"*{self.path.suffix}") if part.stem.isdigit())

    def _write_piece(self, part: Path, rows: Rows) -> None:
        try:
            with atomic_write(part) as temporary:
                self._write(rows, temporary)
        except Exception as error:
            self._lost, self._reason = self._lost + len(rows), str(error)
            raise

    def _finish(self) -> None:
        pieces = self._pieces()
        if pieces:
            with atomic_write(self.path) as temporary:
                self._join(pieces, temporary)
        for piece in pieces:
            piece.unlink()
        with suppress(OSError):  # other files of the user
            self.parts.rmdir()
        if self._lost:
            raise FifthwheelError(f"{self.path}: number of rows that are not recorded: {self._lost} ({self._reason})")


def _write_parquet(rows: Rows, path: Path) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    names = list(dict.fromkeys(name for row in rows for name in row))
    columns = [np.array([row.get(name, np.nan) for row in rows]) for name in names]
    arrays = [pa.Array.from_buffers(pa.float64(), len(rows), [None, pa.py_buffer(column)]) for column in columns]
    parquet.write_table(pa.table(arrays, names=names), path)


def _join_parquet(pieces: Iterable[Path], path: Path) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    schema = pa.unify_schemas([parquet.read_schema(piece) for piece in pieces])
    with parquet.ParquetWriter(path, schema) as writer:
        for piece in pieces:
            writer.write_table(parquet.read_table(piece, schema=schema))  # columns that it does not have are empty


def _write_messages(rows: Rows, path: Path) -> None:
    from fifthwheel.results.export.ros2 import USABLE, write_samples

    usable = (*USABLE, NodeStatus.DEGRADED)
    write_samples(((row["bus_time"], row) for row in rows if row["status"] in usable), path)


def _join_mcap(pieces: Iterable[Path], path: Path) -> None:
    from mcap.reader import make_reader
    from mcap.writer import Writer

    with path.open("wb") as file:
        writer: Any = Writer(file)
        channels: dict[str, int] = {}
        for k, piece in enumerate(pieces):
            with piece.open("rb") as source:
                reader: Any = make_reader(source)
                if k == 0:
                    writer.start(profile=reader.get_header().profile, library="fifthwheel")
                for schema, channel, message in reader.iter_messages():
                    if (topic := channel.topic) not in channels:
                        number = writer.register_schema(schema.name, schema.encoding, schema.data)
                        channels[topic] = writer.register_channel(topic, channel.message_encoding, number)
                    writer.add_message(channels[topic], message.log_time, message.data, message.publish_time)
        writer.finish()


_FORMATS: Mapping[str, tuple[Callable[[Rows, Path], None], Callable[[Iterable[Path], Path], None]]] = {
    RECORD: (_write_parquet, _join_parquet),
    MESSAGES: (_write_messages, _join_mcap),
}
