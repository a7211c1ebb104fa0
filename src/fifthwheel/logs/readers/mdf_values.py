"""Records of an MDF file to time and physical values."""

import numpy as np

from fifthwheel.logs.readers.mdf_data import BrokenError
from fifthwheel.logs.readers.mdf_model import Array, Channel, Rows


def times(rows: Rows) -> Array:
    """Stamps (n,) of the records, s; fewer where the group that has them ends before."""
    group = rows.group
    if group.time is not None:
        return values(group.time, rows)
    master = group.master
    if master is None or master.time is None:
        raise BrokenError("it has no time")
    data = master.data.read(rows.first * master.width, (rows.first + len(rows.records)) * master.width)
    count = len(data) // master.width if master.width else len(rows.records)
    matrix = np.frombuffer(data, dtype=np.uint8, count=count * master.width).reshape(count, master.width)
    return values(master.time, Rows(group=master, first=rows.first, records=matrix))


def values(channel: Channel, rows: Rows) -> Array:
    """Physical values (n,), NaN where they are marked as not valid."""
    with np.errstate(all="ignore"):
        if channel.virtual:
            raw = np.arange(rows.first, rows.first + len(rows.records), dtype=np.float64)
        else:
            raw = channel.raw(rows.records[:, : rows.group.size]).astype(np.float64)
        result = raw if channel.convert is None else np.asarray(channel.convert(raw), dtype=np.float64)
    if channel.invalid == -2:
        return np.full(len(rows.records), np.nan)
    if channel.invalid is not None and rows.invalid is not None:
        byte, bit = divmod(channel.invalid, 8)
        if byte < rows.invalid.shape[1]:
            return np.where(rows.invalid[:, byte] >> bit & 1, np.nan, result)
    return result
