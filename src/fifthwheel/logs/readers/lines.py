"""The lines of a text file of any size and encoding, as bytes for pyarrow."""

import codecs
import io
import re
from pathlib import Path

_BOMS = ((codecs.BOM_UTF8, "utf-8"), (codecs.BOM_UTF16_LE, "utf-16-le"), (codecs.BOM_UTF16_BE, "utf-16-be"))
_HEAD = 1 << 18
_BLOCK = 1 << 20


class Lines(io.RawIOBase):
    """The whole lines of a text file as bytes that pyarrow reads: one byte ASCII, "\\n" at their ends, no mark."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._file = path.open("rb")
        self._size = path.stat().st_size
        head = self._file.read(_HEAD)
        mark, self._encoding = next(((b, e) for b, e in _BOMS if head.startswith(b)), (b"", "utf-8"))
        self._wide = self._encoding != "utf-8"
        self._carriage = b"\n" not in head and b"\r" in head
        self._collapsing = False
        self._stop = self._last_line_end()
        self._file.seek(len(mark))
        self._decoder = codecs.getincrementaldecoder(self._encoding)("replace")
        self._rest = self._partial = b""

    @property
    def done(self) -> float:
        """Share of the file that has been read."""
        return min(1.0, self._file.tell() / max(self._size, 1)) if not self.closed else 1.0

    def readable(self) -> bool:
        return True

    def read(self, size: int = -1) -> bytes:
        """At least one byte and about `size` of them, b"" at the end."""
        while len(self._rest) < max(size, 1) or size < 0:
            piece = self._file.read(min(_BLOCK, self._stop - self._file.tell()))
            if not piece:
                break
            self._rest += self._plain(piece)
        size = len(self._rest) if size < 0 else size
        given, self._rest = self._rest[:size], self._rest[size:]
        return given

    def skip(self, size: int) -> None:
        """Leave out the first bytes."""
        while size > 0 and (given := self.read(min(size, _BLOCK))):
            size -= len(given)

    def collapse(self) -> None:
        """From here on runs of blanks are one tab each, and none begins or ends a line."""
        self._collapsing = True
        self._rest = self._collapsed(self._rest)

    def _collapsed(self, piece: bytes) -> bytes:
        piece = self._partial + piece
        at = piece.rfind(b"\n") + 1
        piece, self._partial = piece[:at], piece[at:]
        return re.sub(rb"[ \t]+", b"\t", re.sub(rb"^[ \t]+|[ \t\r]+$", b"", piece, flags=re.MULTILINE))

    def close(self) -> None:
        self._file.close()
        super().close()

    def _plain(self, piece: bytes) -> bytes:
        if self._wide:
            piece = self._decoder.decode(piece).encode("utf-8", "replace")
        elif not piece.isascii():
            piece = piece.decode("latin-1").encode()  # byte by byte: whatever they are, valid
        if self._carriage:
            piece = piece.replace(b"\r", b"\n")
        if self._collapsing:
            piece = self._collapsed(piece)
        return piece

    def _last_line_end(self) -> int:
        """Bytes up to the last line's end; the whole file where it has not one."""
        end = b"\r" if self._carriage else b"\n"
        end = end.decode().encode(self._encoding)
        start = max(0, self._size - _HEAD) // 2 * 2
        self._file.seek(start)
        tail = self._file.read()
        at = tail.rfind(end)
        while self._wide and at % 2 and at >= 0:
            at = tail.rfind(end, 0, at + 1)
        stop = self._size if at < 0 else start + at + len(end)
        rest = self._size - stop
        self.left_over = tail[-rest:][-20 * len(end) :].decode(self._encoding, "replace") if rest else ""
        return stop
