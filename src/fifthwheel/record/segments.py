"""The segments of a record that an estimator can use."""

import numpy as np

from fifthwheel.errors import SignalError
from fifthwheel.record.record import Record


def segments_above(record: Record, min_speed: float) -> list[Record]:
    """The segments of a record without time gaps in which the speed stays at `min_speed` (m/s) or above.

    Raises:
        SignalError: there is no such segment.
    """
    speed = record.input("speed")
    fast = speed >= min_speed
    if not fast.any():
        raise SignalError(
            f"speed: at most {speed.max():.1f} m/s in {record.name}, {min_speed:g} m/s needed for rolling tyres; "
            "check the column and unit of speed in signals.toml, or log a faster run"
        )
    edges = np.flatnonzero(np.diff(fast.astype(int))) + 1
    runs = [
        record.cut(record.time[rows[0]], record.time[rows[-1]])
        for rows in np.split(np.arange(len(fast)), edges)
        if fast[rows[0]] and len(rows) > 1
    ]
    if not runs:
        raise SignalError(
            f"speed: never at {min_speed:g} m/s or above for two samples in succession in {record.name}; "
            "map a smoother speed, or log a faster run"
        )
    return [segment for run in runs for segment in run.segments()]
