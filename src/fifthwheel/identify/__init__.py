"""From logs to parameters: the article's two stages, with sigma and verdict."""

from fifthwheel.identify.information import Verdict
from fifthwheel.identify.result import Estimate, Fit, Identification, LogSummary, SensorError
from fifthwheel.identify.settings import Settings, article
from fifthwheel.identify.stage import Trace
from fifthwheel.identify.two_stage import identify

__all__ = [
    "Estimate",
    "Fit",
    "Identification",
    "LogSummary",
    "SensorError",
    "Settings",
    "Trace",
    "Verdict",
    "article",
    "identify",
]
