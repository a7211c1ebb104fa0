"""Messages between a program and the child process that reads a log: a JSON head and an Arrow IPC stream each."""

import json
import os
import struct
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import pyarrow as pa

from fifthwheel._types import Array

_HEAD = struct.Struct("<IQ")


def send(pipe: int, head: Mapping[str, Any], batch: pa.RecordBatch | None = None) -> None:
    """Write a message to a pipe."""
    text, sink = json.dumps(head).encode(), pa.BufferOutputStream()
    if batch is not None:
        with pa.ipc.new_stream(sink, batch.schema) as writer:
            writer.write_batch(batch)
    body = sink.getvalue()
    for part in (_HEAD.pack(len(text), body.size) + text, body):
        rest = memoryview(part)
        while rest:
            rest = rest[os.write(pipe, rest) :]


class TooMuchError(Exception):
    """More samples than permitted."""


def receive(pipe: int, most: float = 0.0) -> tuple[dict[str, Any], pa.RecordBatch | None, int]:
    """The next message, with at most this many bytes of samples; EOFError where the other process has ended."""
    text, body = _HEAD.unpack(_read(pipe, _HEAD.size))
    head = json.loads(_read(pipe, text))
    if body > most:
        raise TooMuchError
    return head, pa.ipc.open_stream(_read(pipe, body)).read_next_batch() if body else None, body


def as_batch(arrays: Iterable[Array]) -> pa.RecordBatch:
    """A batch of columns (n,). `pyarrow.array` would import pandas."""
    buffers = [pa.py_buffer(np.ascontiguousarray(array, np.float64)) for array in arrays]
    columns = [pa.Array.from_buffers(pa.float64(), buffer.size // 8, [None, buffer]) for buffer in buffers]
    return pa.RecordBatch.from_arrays(columns, list(map(str, range(len(columns)))))


def as_arrays(batch: pa.RecordBatch) -> list[Array]:
    """The columns of a batch as arrays (n,) that can be written to."""
    return [np.array(np.ndarray(len(column), np.float64, column.buffers()[1] or b"")) for column in batch.columns]


def _read(pipe: int, size: int) -> bytearray:
    data = bytearray()
    while len(data) < size:
        part = os.read(pipe, min(size - len(data), 1 << 20))
        if not part:
            raise EOFError
        data += part
    return data
