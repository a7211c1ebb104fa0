"""The result of an identification, with its display and its files."""

from fifthwheel.identify.result.identification import Identification
from fifthwheel.identify.result.parts import Estimate, Fit, LogSummary, SensorError
from fifthwheel.identify.result.posterior import Posterior

__all__ = ["Estimate", "Fit", "Identification", "LogSummary", "Posterior", "SensorError"]
