"""Samples for a filter, one by one or of a record: plausible and held inputs, gaps, starts, long steps and statuses."""

from fifthwheel.estimate.stream.segments import StreamSegment, measurements, stream_segments, without_measurement
from fifthwheel.estimate.stream.settings import VALID, InputRule, Status, StreamSettings, magnitude
from fifthwheel.estimate.stream.stream import Stream

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
