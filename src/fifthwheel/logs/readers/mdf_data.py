"""The bytes of an MDF file: blocks of samples, zipped or not, as one run of bytes that ends where it breaks."""

import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

_BIGGEST_ZIP = 1 << 30
_BIGGEST_RATIO = 1100  # deflate cannot do better


class BrokenError(Exception):
    """The file is damaged at this place; the text says how. Never leaves the reader."""


class File:
    """A file of known size that refuses to be read outside of itself."""

    def __init__(self, path: Path) -> None:
        self._file: BinaryIO = path.open("rb")
        self.size = path.stat().st_size

    def take(self, at: int, count: int) -> bytes:
        """Just these bytes; BrokenError where the file does not have them."""
        data = self.take_some(at, count)
        if len(data) < count:
            raise BrokenError(f"{count} bytes expected at byte {at}, the file has {self.size}")
        return data

    def take_some(self, at: int, count: int) -> bytes:
        """These bytes or as many as there are."""
        if not 0 <= at < self.size or count <= 0:
            return b""
        try:
            self._file.seek(at)
            return self._file.read(min(count, self.size - at))
        except OSError as error:
            raise BrokenError(f"cannot be read at byte {at} ({error.strerror})") from error

    def close(self) -> None:
        self._file.close()


@dataclass(frozen=True, kw_only=True)
class Block:
    """A stretch of the samples."""

    at: int
    """Where it begins in the file; -1 for nothing but zeros."""
    stored: int
    """Bytes there."""
    size: int
    """Bytes of samples; fewer are stored when zipped."""
    zipped: bool = False
    turned: int = 0
    """Columns of the matrix that was transposed before zipping; 0 for none."""


class Data:
    """The blocks as one run of bytes."""

    def __init__(self, file: File, blocks: list[Block], broken: str = "") -> None:
        self.broken = broken
        """Why it ends where it ends; "" when nothing is amiss."""
        self._file = file
        self._blocks = blocks
        self._ends = np.cumsum([block.size for block in blocks], dtype=np.float64)  # sizes of a damaged file overflow
        self._open: tuple[int, bytes] = (-1, b"")
        self.size = int(self._ends[-1]) if blocks else 0

    def read(self, start: int, stop: int) -> bytes:
        """Bytes from start to stop, fewer where it ends or breaks before."""
        parts: list[bytes] = []
        index = int(np.searchsorted(self._ends, start, side="right"))
        while start < min(stop, self.size):
            block = self._blocks[index]
            begin = int(self._ends[index]) - block.size
            want = min(stop, begin + block.size) - start
            part = self._part(index, block, start - begin, want)
            parts.append(part)
            start += len(part)
            if len(part) < want:
                self.size = start
                break
            index += 1
        return b"".join(parts)

    def _part(self, index: int, block: Block, start: int, count: int) -> bytes:
        try:
            if block.at < 0:
                return bytes(count)
            if not block.zipped:
                part = self._file.take_some(block.at + start, count)
                if len(part) < count:
                    self.broken = f"the file ends within the block at byte {block.at}"
                return part
            if self._open[0] != index:
                self._open = (index, b"")
                self._open = (index, self._unzipped(block))
        except (BrokenError, zlib.error) as error:
            self.broken = f"block at byte {block.at}: {error}"
        return self._open[1][start : start + count]

    def _unzipped(self, block: Block) -> bytes:
        if block.stored > _BIGGEST_ZIP or block.size > block.stored * _BIGGEST_RATIO + _BIGGEST_RATIO:
            raise BrokenError(f"{block.stored} bytes that would unzip to {block.size}")
        zipped = self._file.take_some(block.at, block.stored)
        unzip = zlib.decompressobj()
        data = unzip.decompress(zipped, block.size)
        whole = len(data) == block.size
        if not whole:
            self.broken = f"block at byte {block.at}: unzips to {len(data)} bytes where {block.size} are announced"
        elif not unzip.eof:
            unzip.decompress(unzip.unconsumed_tail, 1)  # the checksum
        if not block.turned:
            return data
        if not whole:
            return b""
        lines = block.size // block.turned
        body = np.frombuffer(data, dtype=np.uint8, count=lines * block.turned)
        return body.reshape(block.turned, lines).T.tobytes() + data[lines * block.turned :]
