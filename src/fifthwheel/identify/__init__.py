"""From logs to parameters: in one stage or the article's two, with sigma and verdict."""

from fifthwheel.identify.information import Verdict
from fifthwheel.identify.methods import identify
from fifthwheel.identify.result import Estimate, Fit, Identification, LogSummary, SensorError
from fifthwheel.identify.settings import Common, OneStage, TwoStage, article
from fifthwheel.identify.stage import Trace

__all__ = [
    "Common",
    "Estimate",
    "Fit",
    "Identification",
    "LogSummary",
    "OneStage",
    "SensorError",
    "Trace",
    "TwoStage",
    "Verdict",
    "article",
    "identify",
]
