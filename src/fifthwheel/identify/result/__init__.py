"""The result of an identification, with its display and its files."""

from fifthwheel.identify.result.identification import Identification
from fifthwheel.identify.result.parts import Estimate, Fit, LogSummary, SensorError

__all__ = ["Estimate", "Fit", "Identification", "LogSummary", "SensorError"]
