"""Identification of parameters from records, with sigma and verdict.

`one_stage` estimates all unknowns together, `online` sample by sample; `design` predicts what an identification can
achieve. The two stages of the article are in `fifthwheel.cheng_cebon_2011`.
"""

from fifthwheel._callable import make_callable
from fifthwheel.identify.history import ParameterHistory
from fifthwheel.identify.identify import identify
from fifthwheel.identify.one_stage.log_posterior import LogPosterior, log_posterior
from fifthwheel.identify.one_stage.profile import Profile
from fifthwheel.identify.result import Estimate, Fit, Identification, LogSummary, Posterior, SensorError
from fifthwheel.identify.settings import CommonSettings, OneStage
from fifthwheel.identify.verdict import Verdict

__all__ = [
    "CommonSettings",
    "Estimate",
    "Fit",
    "Identification",
    "LogPosterior",
    "LogSummary",
    "OneStage",
    "ParameterHistory",
    "Posterior",
    "Profile",
    "SensorError",
    "Verdict",
    "identify",
    "log_posterior",
]

make_callable(__name__, identify)
