"""Identification of parameters from records, with sigma and verdict.

`one_stage` estimates all unknowns together, `online` sample by sample; `design` predicts what an identification can
achieve. The two stages of the article are in `fifthwheel.apps.cheng_cebon_2011`.
"""

from typing import TYPE_CHECKING

from fifthwheel.base.lazy import lazy_names
from fifthwheel.estimate.identify.identify import identify as identify

if TYPE_CHECKING:
    from fifthwheel.estimate.identify.one_stage.log_posterior import LogPosterior as LogPosterior
    from fifthwheel.estimate.identify.one_stage.log_posterior import Profile as Profile
    from fifthwheel.estimate.identify.one_stage.log_posterior import log_posterior as log_posterior
    from fifthwheel.estimate.identify.result.identification import Identification as Identification
    from fifthwheel.estimate.identify.result.parts import Estimate as Estimate
    from fifthwheel.estimate.identify.result.parts import Fit as Fit
    from fifthwheel.estimate.identify.result.parts import LogSummary as LogSummary
    from fifthwheel.estimate.identify.result.parts import ParameterHistory as ParameterHistory
    from fifthwheel.estimate.identify.result.parts import SensorError as SensorError
    from fifthwheel.estimate.identify.result.posterior import Posterior as Posterior
    from fifthwheel.estimate.identify.settings import CommonSettings as CommonSettings
    from fifthwheel.estimate.identify.settings import OneStage as OneStage
    from fifthwheel.estimate.identify.verdict import Verdict as Verdict
else:
    __getattr__, __dir__, __all__ = lazy_names(__name__)
