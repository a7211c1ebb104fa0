"""Identification of parameters from records, with sigma and verdict.

`map` estimates all unknowns in one stage, `dual` in the two stages of the article, `online` sample by sample; `design`
predicts what an identification can achieve.
"""

from fifthwheel._callable import make_callable
from fifthwheel.identify.history import ParameterHistory
from fifthwheel.identify.identify import identify
from fifthwheel.identify.result import Estimate, Fit, Identification, LogSummary, SensorError
from fifthwheel.identify.settings import CommonSettings, OneStage, TwoStage, article
from fifthwheel.identify.verdict import Verdict

__all__ = [
    "CommonSettings",
    "Estimate",
    "Fit",
    "Identification",
    "LogSummary",
    "OneStage",
    "ParameterHistory",
    "SensorError",
    "TwoStage",
    "Verdict",
    "article",
    "identify",
]

make_callable(__name__, identify)
