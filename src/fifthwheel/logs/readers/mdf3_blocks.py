"""The blocks of an MDF 2 or 3 file: which groups of channels it has and where their samples lie."""

import struct
from collections.abc import Iterator

from fifthwheel.logs.readers import mdf_convert as convert
from fifthwheel.logs.readers.mdf_data import Block, BrokenError, Data, File
from fifthwheel.logs.readers.mdf_model import Channel, Conversion, Group, Mix

_KINDS: dict[int, tuple[str, bool | None]] = {
    0: ("u", None),
    1: ("i", None),
    2: ("f", None),
    3: ("f", None),
    9: ("u", True),
    10: ("i", True),
    11: ("f", True),
    12: ("f", True),
    13: ("u", False),
    14: ("i", False),
    15: ("f", False),
    16: ("f", False),
}
"""Kind of number, and whether it is big endian; None where that is as in the whole file."""
_MASTER = 1
_LONGEST_LABEL = 60


def read_groups(file: File, notes: list[str]) -> list[Group]:
    """The groups of a file in their order; what is broken is left out with a note."""
    return _Blocks(file, notes).groups()


class _Blocks:
    def __init__(self, file: File, notes: list[str]) -> None:
        self._file = file
        self._notes = notes
        self._big = struct.unpack("<H", file.take(24, 2))[0] != 0
        self._order = ">" if self._big else "<"

    def groups(self) -> list[Group]:
        groups: list[Group] = []
        (first,) = self._unpack("I", self._block(64, b"HD", 8), 4)
        for at, body in self._chain(first, b"DG", 24, "list of groups"):
            try:
                self._data_group(body, groups)
            except BrokenError as error:
                self._notes.append(f"group behind {len(groups)} others left out: {error} (block at byte {at})")
        return groups

    def _data_group(self, body: bytes, groups: list[Group]) -> None:
        _, first, _, place, _, marks = self._unpack("4I2H", body, 4)
        mix = Mix(identifier_size=1, sizes={}, after=marks == 2) if marks else None
        here: list[Group] = []
        for _, cg in self._chain(first, b"CG", 26, "list of groups"):
            _, channels, comment, identifier, _, size, count = self._unpack("3I3HI", cg, 4)
            if mix is not None:
                mix.sizes[identifier & 0xFF] = size
            number = len(groups) + len(here)
            label = self._text(comment)
            group = Group(
                number=number,
                label=label if label and len(label) <= _LONGEST_LABEL and "\n" not in label else str(number),
                channels=[],
                time=None,
                data=Data(self._file, []),
                size=size,
                count=count,
                identifier=identifier & 0xFF if mix is not None else None,
                mix=mix,
            )
            self._channels(channels, group)
            here.append(group)
        total = sum((group.size + (marks if mix else 0)) * (group.count or 0) for group in here)
        data = Data(self._file, [Block(at=place, stored=total, size=total)] if place and total else [])
        for group in here:
            group.data = data
        groups.extend(here)

    def _channels(self, at: int, group: Group) -> None:
        for _, cn in self._chain(at, b"CN", 218, f"list of channels of group {group.label!r}"):
            _, rule, _, array, comment, sort = self._unpack("5IH", cn, 4)
            start, bits, kind = self._unpack("3H", cn, 186)
            name = self._text(self._unpack("I", cn, 218)[0]) if len(cn) >= 222 else ""
            beyond = self._unpack("H", cn, 226)[0] if len(cn) >= 228 else 0
            channel = Channel(
                name=name or _latin(cn[26:58]),
                about=_latin(cn[58:186]) or self._text(comment),
                bit=start + 8 * beyond,
                bits=bits,
                trouble="an array" if array else "",
            )
            number, big = _KINDS.get(kind, ("", False))
            channel.kind = number if number != "f" or bits in (16, 32, 64) else ""
            channel.big = self._big if big is None else big
            try:
                channel.convert = self._conversion(rule, channel)
            except (BrokenError, struct.error) as error:
                channel.trouble = f"its conversion: {error}"
            if sort == _MASTER:
                group.time = channel if channel.numeric else None
            else:
                group.channels.append(channel)

    def _conversion(self, at: int, channel: Channel) -> Conversion | None:
        if not at:
            return None
        body = self._block(at, b"CC", 46)
        channel.unit = _latin(body[22:42]) or None
        kind, count = self._unpack("2H", body, 42)
        if kind in (11, 12, 65535):
            return None
        if kind == 10:
            return convert.formula(_latin(self._file.take_some(at + 46, 256)))
        needs = {0: 2, 1: 2 * count, 2: 2 * count, 9: 6}
        if kind not in needs:
            raise BrokenError(f"of the kind {kind}, which is not read here")
        p = struct.unpack(f"{self._order}{needs[kind]}d", self._file.take(at + 46, 8 * needs[kind]))
        if kind == 0:
            return convert.linear(p[0], p[1])
        if kind in (1, 2):
            return convert.table(p, interpolated=kind == 1)
        return convert.rational(p)

    def _text(self, at: int) -> str:
        try:
            return _latin(self._block(at, b"TX", 4)[4:]) if at else ""
        except BrokenError:
            return ""

    def _chain(self, at: int, kind: bytes, least: int, what: str) -> Iterator[tuple[int, bytes]]:
        """Blocks of a list, each with the place of the next behind its head; a note where it breaks."""
        seen: set[int] = set()
        while at:
            if at in seen:
                self._notes.append(f"{what} is broken behind {len(seen)}: it comes back to byte {at}")
                return
            try:
                block = self._block(at, kind, least)
            except BrokenError as error:
                self._notes.append(f"{what} is broken behind {len(seen)}: {error}")
                return
            seen.add(at)
            yield at, block
            (at,) = self._unpack("I", block, 4)

    def _block(self, at: int, kind: bytes, least: int) -> bytes:
        """A block of this kind, whole, with its head of four bytes."""
        found, length = struct.unpack(f"{self._order}2sH", self._file.take(at, 4))
        if found != kind or length < least:
            raise BrokenError(f"no block {kind.decode()} at byte {at}")
        return self._file.take(at, length)

    def _unpack(self, form: str, body: bytes, at: int) -> tuple[int, ...]:
        return struct.unpack_from(self._order + form, body, at)


def _latin(text: bytes) -> str:
    return text.split(b"\0")[0].decode("latin-1").strip()
