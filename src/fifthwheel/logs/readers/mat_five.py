"""MATLAB's version 5 to 7, a variable after the other, so that damage spares those before it.

Read here and not by scipy, which crashes on damaged files.
"""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np

from fifthwheel.logs.readers.mat_tree import DEEPEST, MOST_ITEMS, Node, Opaque, numbers

_COMPRESSED, _MATRIX = 15, 14
_NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_TEXTS = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32"}
_CELL, _STRUCT, _OBJECT, _CHAR, _FIRST_NUMBER, _LAST_NUMBER, _OPAQUE = 1, 2, 3, 4, 6, 15, 17
_COMPLEX = 8
_BIGGEST_RATIO = 1100  # deflate cannot do better


class DamagedError(ValueError):
    """A variable is not as it should be; the text says how. Never leaves this module."""


def load_five(file: BinaryIO, size: int, notes: list[str]) -> dict[str, Node]:
    """Variables by name. Those from the first damaged one on are left out with a note."""
    head = file.read(128)
    order = ">" if head[126:128] == b"MI" else "<"
    found: dict[str, Node] = {}
    at = 128
    while at < size:
        try:
            element = _Element.of_file(file, size - at, order)
            name, node = _variable(element)
        except (DamagedError, zlib.error, struct.error) as error:
            notes.append(f"broken after {len(found)} variables, at byte {at}: {error}")
            break
        at = file.tell()
        if name:
            found[name] = node
    return found


@dataclass(frozen=True, kw_only=True)
class _Element:
    """A piece of data and what it is."""

    kind: int
    data: memoryview
    order: str
    """"<" or ">"."""

    @classmethod
    def of_file(cls, file: BinaryIO, left: int, order: str) -> "_Element":
        tag = file.read(8)
        kind, length = struct.unpack(f"{order}II", tag) if len(tag) == 8 else (0, 0)
        if kind not in (_MATRIX, _COMPRESSED):
            raise DamagedError("no variable begins there")
        if length > left - 8:
            raise DamagedError(f"a variable of {length} bytes, {left - 8} are left")
        data = file.read(length)
        if kind == _COMPRESSED:
            return cls._unzipped(data, order)
        return cls(kind=kind, data=memoryview(data), order=order)

    @classmethod
    def _unzipped(cls, data: bytes, order: str) -> "_Element":
        unzip = zlib.decompressobj()
        tag = unzip.decompress(data, 8)
        kind, length = struct.unpack(f"{order}II", tag) if len(tag) == 8 else (0, 0)
        if length > len(data) * _BIGGEST_RATIO:
            raise DamagedError(f"{len(data)} bytes that would unzip to {length}")
        whole = unzip.decompress(unzip.unconsumed_tail, length) if length else b""
        if len(whole) < length:
            raise DamagedError(f"unzips to {len(whole)} bytes where {length} are announced")
        unzip.decompress(unzip.unconsumed_tail, 64)  # the checksum
        return cls(kind=kind, data=memoryview(whole), order=order)

    def parts(self) -> Iterator["_Element"]:
        """The elements within."""
        at, end = 0, len(self.data)
        while at + 8 <= end:
            kind, length = struct.unpack_from(f"{self.order}II", self.data, at)
            begin = at + 8
            if kind >> 16:  # up to four bytes stand in the place of the length
                kind, length, begin = kind & 0xFFFF, kind >> 16, at + 4
            if begin + length > end or (begin == at + 4 and length > 4):
                raise DamagedError(f"{length} bytes within {end - begin}")
            yield _Element(kind=kind, data=self.data[begin : begin + length], order=self.order)
            at = at + 8 if begin == at + 4 else begin + length + -length % 8

    def array(self) -> np.ndarray[tuple[int], Any]:
        if self.kind not in _NUMBERS:
            raise DamagedError(f"data of the unknown kind {self.kind}")
        dtype = np.dtype(f"{self.order}{_NUMBERS[self.kind]}")
        return np.frombuffer(self.data, dtype=dtype, count=len(self.data) // dtype.itemsize)

    def text(self) -> str:
        code = _TEXTS.get(self.kind, "latin-1")
        wide = ("-be" if self.order == ">" else "-le") if code[4:] in ("16", "32") else ""
        return bytes(self.data).decode(code + wide, "replace").rstrip("\0")


def _variable(element: _Element, depth: int = 0) -> tuple[str, Node]:
    """Name and content of a matrix, as everything in such a file is called."""
    if element.kind != _MATRIX:
        raise DamagedError(f"data of kind {element.kind} in the place of a variable")
    parts = element.parts()
    flags = _next(parts, element).array() if len(element.data) else np.zeros(0, np.uint32)
    if not flags.size or depth > DEEPEST:
        return "", None
    kind, is_complex = int(flags[0]) & 0xFF, bool(int(flags[0]) >> 8 & _COMPLEX)
    if kind == _OPAQUE:
        name, _, title = (_next(parts, element).text() for _ in range(3))
        return name, Opaque(title)
    shape = tuple(_next(parts, element).array().tolist())
    name = _next(parts, element).text()
    count = 1
    for side in shape:
        count *= side
    if count < 0 or any(side < 0 for side in shape):
        raise DamagedError(f"an array of {shape}")
    if kind == _OBJECT:
        _next(parts, element)
    if kind in (_STRUCT, _OBJECT):
        return name, _struct(parts, element, count, depth)
    if kind == _CELL:
        return name, [_variable(_next(parts, element), depth + 1)[1] for _ in range(min(count, MOST_ITEMS))]
    if kind == _CHAR:
        return name, _next(parts, element).text() if count and shape[0] == 1 else None
    if not _FIRST_NUMBER <= kind <= _LAST_NUMBER or is_complex or not count:
        return name, None
    array = _next(parts, element).array()
    if array.size < count:
        raise DamagedError(f"{array.size} numbers for an array of {shape}")
    whole = array[:count].reshape(shape, order="F")
    return name, numbers(shape, whole.dtype, lambda place: whole[place])


def _struct(parts: Iterator[_Element], element: _Element, count: int, depth: int) -> Node:
    width = _next(parts, element).array()
    names = bytes(_next(parts, element).data)
    if not width.size or width[0] <= 0:
        raise DamagedError("a struct without names of its fields")
    size = int(width[0])
    fields = [names[k : k + size].split(b"\0")[0].decode("utf-8", "replace") for k in range(0, len(names), size)]
    if not fields:
        return None
    items = [
        {field: _variable(_next(parts, element), depth + 1)[1] for field in fields}
        for _ in range(min(count, MOST_ITEMS))
    ]
    return items[0] if len(items) == 1 else items


def _next(parts: Iterator[_Element], element: _Element) -> _Element:
    part = next(parts, None)
    if part is None:
        raise DamagedError(f"ends after {len(element.data)} bytes")
    return part
