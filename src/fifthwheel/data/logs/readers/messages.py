"""Messages between a program and the child process that reads a log: a JSON head and columns of float64 each."""

import json
import os
import struct
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from fifthwheel.base.types import Array

_HEAD = struct.Struct("<IQ")


class TooMuchError(Exception):
    """More samples than permitted."""


def send(pipe: int, head: Mapping[str, Any], columns: Iterable[Array] = ()) -> None:
    """Write a message to a pipe; the columns (n,) have the same length."""
    text = json.dumps(head).encode()
    samples = [np.ascontiguousarray(column, np.float64).view(np.uint8).data for column in columns]
    start = memoryview(_HEAD.pack(len(text), sum(map(len, samples))) + text)
    for rest in (start, *samples):
        while rest:
            rest = rest[os.write(pipe, rest) :]


def receive(pipe: int, most: float = 0.0) -> tuple[dict[str, Any], Array]:
    """The next message, its columns one after the other, at most this many bytes of them.

    EOFError where the other process has ended.
    """
    text, body = _HEAD.unpack(_read(pipe, _HEAD.size))
    head = json.loads(_read(pipe, text))
    if body > most:
        raise TooMuchError
    return head, np.frombuffer(_read(pipe, body), np.float64)


def _read(pipe: int, size: int) -> bytearray:
    data = bytearray()
    while len(data) < size:
        part = os.read(pipe, min(size - len(data), 1 << 20))
        if not part:
            raise EOFError
        data += part
    return data
