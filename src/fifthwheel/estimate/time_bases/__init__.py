"""Time offsets between channels, rates of clocks and exchanged gyros, by the model of a truck."""

from fifthwheel.estimate.time_bases.findings import check_signals as check_signals
