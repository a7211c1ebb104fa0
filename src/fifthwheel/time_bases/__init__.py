"""Time offsets between channels, rates of clocks and exchanged gyros, by the model of a truck."""

from fifthwheel.time_bases.findings import check_signals
from fifthwheel.time_bases.offsets import TimeOffset, measure_time_offsets

__all__ = ["TimeOffset", "check_signals", "measure_time_offsets"]
