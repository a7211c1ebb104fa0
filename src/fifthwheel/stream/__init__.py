"""Samples for a filter, one by one or of a record: plausible and held inputs, gaps, starts, long steps and statuses."""

from fifthwheel.stream.segments import StreamSegment, measurements, stream_segments, without_measurement
from fifthwheel.stream.settings import VALID, InputRule, Status, StreamSettings, magnitude
from fifthwheel.stream.stream import Stream

__all__ = [
    "VALID",
    "InputRule",
    "Status",
    "Stream",
    "StreamSegment",
    "StreamSettings",
    "magnitude",
    "measurements",
    "stream_segments",
    "without_measurement",
]
