"""Conversions of an MDF 4 file, by the blocks that describe them."""

import struct

from fifthwheel.logs.readers import mdf_convert as convert
from fifthwheel.logs.readers.mdf4_links import Links
from fifthwheel.logs.readers.mdf_data import BrokenError
from fifthwheel.logs.readers.mdf_model import Conversion

_DEEPEST = 8


def conversion(links: Links, at: int, depth: int = 0) -> Conversion | None:
    """That of a CC block, None for one that changes nothing; BrokenError for one that gives no numbers."""
    own, body = links.block(at, "CC")
    kind, _, _, _, count = struct.unpack("<BBHHH", body[:8])
    values = struct.unpack(f"<{count}d", body[24 : 24 + 8 * count])
    refs = own[4:]
    if kind in (0, 11):
        return None
    needs = {1: 2, 2: 6, 4: 2, 5: 2, 6: 3}
    if count < needs.get(kind, 0):
        raise BrokenError(f"{count} parameters of {needs[kind]}")
    if kind == 1:
        return convert.linear(values[0], values[1])
    if kind == 2:
        return convert.rational(values)
    if kind == 3:
        return convert.formula(links.text(refs[0] if refs else 0))
    if kind in (4, 5):
        return convert.table(values, interpolated=kind == 4)
    if kind == 6:
        return convert.ranges(values)
    if kind in (7, 8):
        scales = [
            conversion(links, ref, depth + 1) if ref and links.kind(ref) == "CC" and depth < _DEEPEST else "text"
            for ref in refs
        ]
        if all(isinstance(scale, str) for scale in scales):
            return None
        lows = values[::2] if kind == 8 else values
        highs = values[1::2] if kind == 8 else values
        rows = list(zip(lows, highs, strict=False))[: len(scales)]
        default = scales[len(rows)] if len(scales) > len(rows) else "text"
        return convert.mixed(rows, scales[: len(rows)], default)
    raise BrokenError("it gives texts for texts" if kind in (9, 10) else f"of the unknown kind {kind}")
