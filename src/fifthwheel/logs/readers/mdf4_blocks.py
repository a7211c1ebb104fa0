"""The blocks of an MDF 4 file: which groups of channels it has and where their samples lie.

Everything is checked against the size of the file and no chain of blocks is followed in a circle, so a damaged file
costs no more than a sound one; what is reached before the damage is given.
"""

import re
import struct
from collections.abc import Iterator

from fifthwheel.logs.readers.mdf4_convert import conversion
from fifthwheel.logs.readers.mdf4_links import Links
from fifthwheel.logs.readers.mdf_data import Block, BrokenError, Data, File
from fifthwheel.logs.readers.mdf_model import Channel, Conversion, Group, Mix

_KINDS = {0: ("u", False), 1: ("u", True), 2: ("i", False), 3: ("i", True), 4: ("f", False), 5: ("f", True)}
_UNFILLED_COUNTS, _UNFILLED_LENGTH = 1, 4
_FIXED, _VLSD, _MASTER, _VIRTUAL_MASTER, _SYNC, _MLSD, _VIRTUAL = range(7)
_REMOTE_MASTER, _BUS_EVENT, _VLSD_GROUP = 8, 2, 1
_FRAME = "CAN_DataFrame"
_BUS_PART = re.compile(r"(CAN|LIN|FLX|MOST|ETH|KLINE)_[A-Z]\w*(\.|$)")


def read_groups(file: File, notes: list[str]) -> list[Group]:
    """The groups of a file in their order; what is broken is left out with a note."""
    return _Blocks(file, notes).groups()


class _Blocks:
    def __init__(self, file: File, notes: list[str]) -> None:
        self._file = file
        self._notes = notes
        self._links = Links(file, notes)
        self._unfinalized = file.take(0, 8) == b"UnFinMF "
        self._flags = struct.unpack("<H", file.take(60, 2))[0] if self._unfinalized else 0
        self._conversions: dict[int, Conversion | None] = {}

    def groups(self) -> list[Group]:
        groups: list[Group] = []
        places: dict[int, Group] = {}
        masters: list[tuple[Group, int]] = []
        links, _ = self._links.block(64, "HD")
        for at, dg in self._links.chain(links[0], "DG", "list of groups"):
            try:
                self._data_group(dg, groups, places, masters)
            except BrokenError as error:
                self._notes.append(f"group behind {len(groups)} others left out: {error} (block at byte {at})")
        for group, at in masters:
            group.master = places.get(at)
        return groups

    def _data_group(
        self,
        dg: tuple[list[int], bytes],
        groups: list[Group],
        places: dict[int, Group],
        masters: list[tuple[Group, int]],
    ) -> None:
        links, body = dg
        blocks, marks, broken = self._data_blocks(links[2])
        data = Data(self._file, blocks, broken)
        identifier_size = body[0]
        mix = Mix(identifier_size=identifier_size, sizes={}) if identifier_size in (1, 2, 4, 8) else None
        records: dict[int, int] = {}
        here: list[Group] = []
        for at, (cg, fields) in self._links.chain(links[1], "CG", "list of groups"):
            identifier, count, flags, _, size, invalid = struct.unpack("<QQHH4xII", fields[:32])
            if mix is not None:
                mix.sizes[identifier] = -1 if flags & _VLSD_GROUP else size + invalid
                records[at] = identifier
            if flags & _VLSD_GROUP:
                continue
            number = len(groups)
            group = Group(
                number=number,
                label=self._links.text(cg[2]) or self._source(cg[3]) or str(number),
                channels=[],
                time=None,
                data=data,
                size=size,
                invalid=invalid,
                count=None if self._flags & _UNFILLED_COUNTS or (self._unfinalized and not count) else count,
                identifier=identifier if mix is not None else None,
                mix=mix,
                invalid_data=self._marks(blocks, marks, size, invalid),
            )
            self._channels(cg[1], group, bus=bool(flags & _BUS_EVENT))
            groups.append(group)
            here.append(group)
            places[at] = group
            if flags & _REMOTE_MASTER and len(cg) > 6:
                masters.append((group, cg[6]))
        for group in here:
            for channel in [*group.channels, *group.frames.values()]:
                if isinstance(channel.lengths, int):
                    channel.lengths = records.get(channel.lengths, -1)

    def _channels(self, at: int, group: Group, bus: bool, parent: str = "", depth: int = 0) -> None:
        for _, (links, body) in self._links.chain(at, "CN", f"list of channels of group {group.label!r}"):
            if len(links) < 8 or len(body) < 24:
                self._notes.append(f"list of channels of group {group.label!r} is broken at a short block")
                return
            sort, sync, kind, shift, first, bits, flags, mark = struct.unpack("<BBBBIIII", body[:20])
            name = self._links.text(links[2])
            if parent and not name.startswith(f"{parent}."):
                name = f"{parent}.{name}"
            channel = Channel(name=name, unit=self._links.text(links[6]) or None, about=self._links.text(links[7]))
            channel.kind, channel.big = _KINDS.get(kind, ("", False))
            channel.bit, channel.bits = first * 8 + shift, bits
            channel.invalid = -2 if flags & 1 else mark if flags & 2 else None
            channel.virtual = sort in (_VIRTUAL_MASTER, _VIRTUAL)
            if channel.kind == "f" and bits not in (16, 32, 64):
                channel.kind = ""
            if sort == _VLSD:
                self._vlsd(channel, links[5])
            try:
                channel.convert = self._conversion(links[4], channel)
            except (BrokenError, struct.error) as error:
                channel.trouble = f"its conversion: {error}"
            composed = self._links.kind(links[1]) if links[1] else ""
            if composed == "CN" and depth < 8:
                self._channels(links[1], group, bus, name, depth + 1)
            elif sort in (_MASTER, _VIRTUAL_MASTER):
                if sync == 1 and channel.numeric:
                    group.time = channel
            elif composed == "CA":
                channel.trouble = "an array"
                group.channels.append(channel)
            elif name.rpartition(".")[0].endswith(_FRAME):
                group.frames[name.rpartition(".")[2]] = channel
            elif not (bus and _BUS_PART.match(name)):
                group.channels.append(channel)

    def _vlsd(self, channel: Channel, at: int) -> None:
        if self._links.kind(at) == "CG":
            channel.lengths = at  # replaced by its identifier when all are known
        else:
            blocks, _, broken = self._data_blocks(at)
            channel.lengths = Data(self._file, blocks, broken)

    def _conversion(self, at: int, channel: Channel) -> Conversion | None:
        if not at:
            return None
        if at not in self._conversions:
            self._conversions[at] = conversion(self._links, at)
        links, _ = self._links.block(at, "CC")
        channel.unit = channel.unit or self._links.text(links[1]) or None
        return self._conversions[at]

    def _source(self, at: int) -> str:
        if not at:
            return ""
        try:
            links, _ = self._links.block(at, "SI")
            return self._links.text(links[0]) or self._links.text(links[1])
        except BrokenError:
            return ""

    def _marks(self, blocks: list[Block], marks: list[Block | None], size: int, invalid: int) -> Data | None:
        """Invalidation bytes that lie apart; where there are none all samples of the block are valid."""
        if not marks or not size:
            return None
        pairs = zip(blocks, marks, strict=False)
        return Data(self._file, [mark or Block(at=-1, stored=0, size=b.size // size * invalid) for b, mark in pairs])

    def _data_blocks(self, at: int) -> tuple[list[Block], list[Block | None], str]:
        """Blocks of samples, those of their invalidation bytes if apart, and what is wrong behind the last of them."""
        found: list[Block] = []
        marks: list[Block | None] = []
        try:
            for link, mark in self._data_links(at):
                found.append(self._data_block(link))
                if mark is not None:
                    marks.append(self._data_block(mark) if mark else None)
        except (BrokenError, struct.error) as error:
            return found, marks, str(error)
        return found, marks, ""

    def _data_links(self, at: int) -> Iterator[tuple[int, int | None]]:
        """Places of the data blocks, each with that of its invalidation bytes: 0 for all valid, None if not apart."""
        if not at:
            return
        kind = self._links.kind(at)
        if kind == "HL":
            links, _ = self._links.block(at, "HL")
            yield from self._data_links(links[0]) if links[0] and self._links.kind(links[0]) != "HL" else ()
        elif kind in ("DL", "LD"):
            seen: set[int] = set()
            while at and at not in seen:
                seen.add(at)
                links, body = self._links.block(at, kind)
                marked = 0
                if kind == "LD":
                    flags, count = struct.unpack("<II", body[:8])
                    marked = count if flags & 1 << 31 else 0
                end = len(links) - marked
                for k in range(1, end):
                    if not links[k]:
                        break
                    yield links[k], links[end + k - 1] if marked and end + k - 1 < len(links) else None
                at = links[0]
        else:
            yield at, None

    def _data_block(self, at: int) -> Block:
        kind, length, _ = self._links.head(at)
        if kind == "DZ":
            zip_type, parameter, size, stored = struct.unpack("<2xBxIQQ", self._file.take(at + 24, 24))
            if zip_type not in (0, 1) or (zip_type and not parameter):
                raise BrokenError(f"block at byte {at} is zipped in the unknown way {zip_type}")
            return Block(at=at + 48, stored=stored, size=size, zipped=True, turned=parameter if zip_type else 0)
        if kind not in ("DT", "DV", "SD", "RD", "DI"):
            raise BrokenError(f"##{kind} in the place of data at byte {at}")
        size = length - 24
        to_end = self._file.size - at - 24
        if self._flags & _UNFILLED_LENGTH and (size <= 0 or size > to_end):
            size = to_end
        return Block(at=at + 24, stored=max(size, 0), size=max(size, 0))
