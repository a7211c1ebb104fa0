"""The links between the blocks of an MDF 4 file, followed with care: never out of the file, never in a circle."""

import html
import re
import struct
from collections.abc import Iterator

from fifthwheel.logs.readers.mdf_data import BrokenError, File

_LONGEST_TEXT = 1 << 16
_LONGEST_BODY = 1 << 24
_TEXT = re.compile(r"<TX[^>]*>(.*?)</TX>", re.DOTALL)


class Links:
    """Blocks by the byte where they begin; BrokenError is raised for what is none."""

    def __init__(self, file: File, notes: list[str]) -> None:
        self._file = file
        self._notes = notes
        self._texts: dict[int, str] = {}

    def text(self, at: int) -> str:
        """Text of a TX block, or the plain one within an MD block; "" where there is none that can be read."""
        if not at:
            return ""
        if at not in self._texts:
            try:
                kind, length, count = self.head(at)
                size = length - 24 - 8 * count if kind in ("TX", "MD") else 0
                body = self._file.take_some(at + 24 + 8 * count, min(size, _LONGEST_TEXT))
                text = body.split(b"\0")[0].decode("utf-8", "replace")
                if kind == "MD":
                    plain = _TEXT.search(text)
                    text = html.unescape(plain[1]) if plain else ""
            except BrokenError:
                text = ""
            self._texts[at] = text.strip()
        return self._texts[at]

    def chain(self, at: int, kind: str, what: str) -> Iterator[tuple[int, tuple[list[int], bytes]]]:
        """Blocks of a list, each with the place of the next as its first link; a note where it breaks."""
        seen: set[int] = set()
        while at:
            if at in seen:
                self._notes.append(f"{what} is broken behind {len(seen)}: it comes back to byte {at}")
                return
            try:
                block = self.block(at, kind)
            except BrokenError as error:
                self._notes.append(f"{what} is broken behind {len(seen)}: {error}")
                return
            seen.add(at)
            yield at, block
            at = block[0][0]

    def kind(self, at: int) -> str:
        try:
            return self.head(at)[0]
        except BrokenError:
            return ""

    def head(self, at: int) -> tuple[str, int, int]:
        """Kind, length and number of links of the block at this byte."""
        mark, kind, length, count = struct.unpack("<2s2s4xQQ", self._file.take(at, 24))
        if mark != b"##":
            raise BrokenError(f"no block at byte {at}")
        if count * 8 > max(length - 24, 0) or count > 1 << 24:
            raise BrokenError(f"block at byte {at} announces {count} links in {length} bytes")
        return kind.decode("latin-1"), length, count

    def block(self, at: int, kind: str) -> tuple[list[int], bytes]:
        """Links and body of a block of this kind, with at least the links and bytes that it always has."""
        found, length, count = self.head(at)
        if found != kind:
            raise BrokenError(f"##{found!r} at byte {at} where ##{kind} is expected")
        links = list(struct.unpack(f"<{count}Q", self._file.take(at + 24, 8 * count))) if count else []
        body = self._file.take(at + 24 + 8 * count, min(length - 24 - 8 * count, _LONGEST_BODY))
        least_links, least_body = _LEAST[kind]
        if len(links) < least_links or len(body) < least_body:
            raise BrokenError(f"##{kind} at byte {at} is too short")
        return links, body


_LEAST: dict[str, tuple[int, int]] = {
    "HD": (1, 0),
    "DG": (4, 1),
    "CG": (6, 32),
    "CN": (8, 24),
    "CC": (4, 24),
    "SI": (3, 0),
    "HL": (1, 0),
    "DL": (1, 0),
    "LD": (1, 8),
}
