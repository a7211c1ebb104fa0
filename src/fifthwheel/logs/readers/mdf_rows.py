"""Records of an MDF file in pieces, from groups that have their data for themselves and from mixed ones."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from fifthwheel.logs.readers.mdf_data import Data
from fifthwheel.logs.readers.mdf_model import Group, Mix, Rows

PIECE_ROWS = 100_000
PIECE_BYTES = 1 << 25
_MIXED_BYTES = 1 << 22


def read_rows(groups: Sequence[Group]) -> Iterator[Rows]:
    """The records of one group, or of several that have their data in common."""
    mix = groups[0].mix
    if mix is None:
        return sorted_rows(groups[0])
    return mixed_rows(groups[0].data, mix, {g.identifier: g for g in groups if g.identifier is not None})


def sorted_rows(group: Group) -> Iterator[Rows]:
    """The records of a group that has its data for itself."""
    step = max(1, min(PIECE_ROWS, PIECE_BYTES // max(group.width, 1)))
    first = 0
    while first < group.rows:
        count = min(step, group.rows - first)
        data = group.data.read(first * group.width, (first + count) * group.width)
        if group.width:
            count = len(data) // group.width
        if not count:
            return
        rows = np.frombuffer(data, dtype=np.uint8, count=count * group.width).reshape(count, group.width)
        invalid = rows[:, group.size :] if group.invalid and group.invalid_data is None else None
        if group.invalid_data is not None and group.invalid:
            marks = group.invalid_data.read(first * group.invalid, (first + count) * group.invalid)
            invalid = np.zeros((count, group.invalid), dtype=np.uint8)
            invalid.ravel()[: len(marks)] = np.frombuffer(marks, dtype=np.uint8)
        first += count
        yield Rows(group=group, first=first - count, records=rows, invalid=invalid, read=first * group.width)


def mixed_rows(data: Data, mix: Mix, groups: Mapping[int, Group]) -> Iterator[Rows]:
    """The records of those groups, by identifier, among the mixed ones; data.broken says what ended them early."""
    wanted = {c.lengths for group in groups.values() for c in group.frames.values() if isinstance(c.lengths, int)}
    pending: dict[int, list[bytes]] = {identifier: [] for identifier in wanted}
    held = {identifier: np.zeros((0, group.width), dtype=np.uint8) for identifier, group in groups.items()}
    firsts = dict.fromkeys(groups, 0)
    rest, at = b"", 0
    while at < data.size and not (data.broken and at >= data.size):
        fresh = data.read(at, at + _MIXED_BYTES)
        at += len(fresh)
        buffer = rest + fresh
        places, used, trouble = _places(buffer, mix)
        if used == 0 and len(buffer) > PIECE_BYTES:
            trouble = "a record longer than any"
        rest = buffer[used:]
        for identifier in wanted:
            pending[identifier] += [
                buffer[p + 4 : p + 4 + int.from_bytes(buffer[p : p + 4], "little")] for p in places.get(identifier, [])
            ]
        whole = np.frombuffer(buffer, dtype=np.uint8)
        for identifier, group in groups.items():
            starts = places.get(identifier, [])
            rows = held[identifier]
            if starts and group.width:
                fresh_rows = np.lib.stride_tricks.sliding_window_view(whole, group.width)[starts]
                rows = np.concatenate([rows, fresh_rows]) if rows.size else fresh_rows
            elif starts:
                rows = np.zeros((len(starts), 0), dtype=np.uint8)
            lengths = [c.lengths for c in group.frames.values() if isinstance(c.lengths, int)]
            count = min([len(rows), *(len(pending[k]) for k in lengths)])
            held[identifier] = rows[count:]
            if count:
                values = {k: pending[k][:count] for k in lengths}
                for k in lengths:
                    del pending[k][:count]
                yield Rows(
                    group=group,
                    first=firsts[identifier],
                    records=rows[:count],
                    invalid=rows[:count, group.size :] if group.invalid else None,
                    lengths=values,
                    read=at,
                )
                firsts[identifier] += count
        if trouble:
            data.broken = f"{trouble} at byte {at - len(rest)} of the records"
            return
        if not fresh:
            return


def _places(buffer: bytes, mix: Mix) -> tuple[dict[int, list[int]], int, str]:
    """Where the whole records of each identifier begin, behind it; how far they reach; and what is wrong there."""
    k, tail, sizes = mix.identifier_size, mix.identifier_size if mix.after else 0, mix.sizes
    places: dict[int, list[int]] = {identifier: [] for identifier in sizes}
    at, end = 0, len(buffer)
    while at + k <= end:
        identifier = buffer[at] if k == 1 else int.from_bytes(buffer[at : at + k], "little")
        size = sizes.get(identifier)
        if size is None:
            return places, at, f"a record of the unknown kind {identifier}"
        begin = at + k
        if size < 0:
            if begin + 4 > end:
                break
            size = 4 + int.from_bytes(buffer[begin : begin + 4], "little")
        if begin + size + tail > end:
            break
        places[identifier].append(begin)
        at = begin + size + tail
    return places, at, ""
