"""Parameters and states of articulated heavy vehicles, from the sensors they have.

Everything that a notebook needs is here; each name is imported when it is first used:

>>> import fifthwheel as fw
>>> truck = fw.vehicle("cheng_cebon_2011")
>>> record = fw.simulate(truck, count=1)
>>> record.signals["yaw_rate.tractor"].shape
(567,)
"""

import time
from typing import TYPE_CHECKING

from fifthwheel.base.lazy import lazy_names

if TYPE_CHECKING:
    from fifthwheel.estimate.identify.identify import identify as identify
    from fifthwheel.model.simulate import simulate as simulate
    from fifthwheel.results.assess.assessment import assess as assess
    from fifthwheel.results.evaluate.evaluate import evaluate as evaluate
    from fifthwheel.truck.catalogue import get

    vehicle = get

    from fifthwheel.apps import fleet as fleet
    from fifthwheel.apps.cheng_cebon_2011 import TwoStage as TwoStage
    from fifthwheel.apps.cheng_cebon_2011 import article as article
    from fifthwheel.apps.studies import Estimates as Estimates
    from fifthwheel.apps.studies import Estimator as Estimator
    from fifthwheel.apps.studies import SimulatedRun as SimulatedRun
    from fifthwheel.apps.studies import StateEstimator as StateEstimator
    from fifthwheel.apps.studies import StatesOf as StatesOf
    from fifthwheel.apps.studies import exact_guess as exact_guess
    from fifthwheel.apps.studies import study as study
    from fifthwheel.base.errors import FifthwheelError as FifthwheelError
    from fifthwheel.base.errors import SignalError as SignalError
    from fifthwheel.base.errors import VehicleError as VehicleError
    from fifthwheel.base.pages.terminal import progress_bar as progress_bar
    from fifthwheel.base.plots import Plot as Plot
    from fifthwheel.data.logs import LiveMap as LiveMap
    from fifthwheel.data.logs import SignalMap as SignalMap
    from fifthwheel.data.logs import read_log as read_log
    from fifthwheel.data.logs import write_record as write_record
    from fifthwheel.data.record import Record as Record
    from fifthwheel.data.record import SensorPrior as SensorPrior
    from fifthwheel.estimate.design import design_experiment as design_experiment
    from fifthwheel.estimate.design import predict_sigmas as predict_sigmas
    from fifthwheel.estimate.identify import Identification as Identification
    from fifthwheel.estimate.identify import LogPosterior as LogPosterior
    from fifthwheel.estimate.identify import OneStage as OneStage
    from fifthwheel.estimate.identify import Posterior as Posterior
    from fifthwheel.estimate.identify import Profile as Profile
    from fifthwheel.estimate.identify import Verdict as Verdict
    from fifthwheel.estimate.identify import log_posterior as log_posterior
    from fifthwheel.estimate.identify.knowledge.information import Occasion as Occasion
    from fifthwheel.estimate.identify.knowledge.knowledge import Knowledge as Knowledge
    from fifthwheel.estimate.identify.knowledge.load import with_payload as with_payload
    from fifthwheel.estimate.identify.mass import GrossMass as GrossMass
    from fifthwheel.estimate.identify.mass import gross_mass as gross_mass
    from fifthwheel.estimate.observe import Observer as Observer
    from fifthwheel.estimate.observe import ObserverSettings as ObserverSettings
    from fifthwheel.estimate.observe import States as States
    from fifthwheel.estimate.observe import Status as Status
    from fifthwheel.estimate.observe import Uncertainty as Uncertainty
    from fifthwheel.estimate.observe import time_to_lift as time_to_lift
    from fifthwheel.estimate.online import Learner as Learner
    from fifthwheel.estimate.online import LearnerSettings as LearnerSettings
    from fifthwheel.estimate.time_bases import check_signals as check_signals
    from fifthwheel.model.dynamics import LinearSystem as LinearSystem
    from fifthwheel.model.dynamics import linear_system as linear_system
    from fifthwheel.model.dynamics.summary import summarize as summarize
    from fifthwheel.results import plot as plot
    from fifthwheel.results.assess import Assessment as Assessment
    from fifthwheel.results.assess import Body as Body
    from fifthwheel.results.diagnose.comparison import compare as compare
    from fifthwheel.results.evaluate import Evaluation as Evaluation
    from fifthwheel.results.evaluate import Validation as Validation
    from fifthwheel.results.evaluate import validate as validate
    from fifthwheel.results.export import export_c as export_c
    from fifthwheel.results.export import export_fmu as export_fmu
    from fifthwheel.results.report import write_report as write_report
    from fifthwheel.truck import Vehicle as Vehicle
else:
    __getattr__, __dir__, __all__ = lazy_names(__name__, vehicle=("fifthwheel.truck.catalogue", "get"))
    __all__ += ["__version__"]

__version__ = "0.3.0"
imported_at = time.time()
"""Time at which the first module of the package was imported."""
