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

from fifthwheel._lazy import lazy_names

if TYPE_CHECKING:
    from fifthwheel.assess.assess import assess as assess  # first, or mypy takes the name for the package
    from fifthwheel.evaluate.evaluate import evaluate as evaluate  # first, or mypy takes the name for the package
    from fifthwheel.identify.identify import identify as identify  # first, or mypy takes the name for the package
    from fifthwheel.simulate import simulate as simulate
    from fifthwheel.vehicle.catalogue import get

    vehicle = get

    from fifthwheel import fleet as fleet
    from fifthwheel import plot as plot
    from fifthwheel.assess import Assessment as Assessment
    from fifthwheel.assess import Body as Body
    from fifthwheel.cheng_cebon_2011 import TwoStage as TwoStage
    from fifthwheel.cheng_cebon_2011 import article as article
    from fifthwheel.diagnose.comparison import compare as compare
    from fifthwheel.dynamics import LinearSystem as LinearSystem
    from fifthwheel.dynamics import linear_system as linear_system
    from fifthwheel.dynamics.summary import summarize as summarize
    from fifthwheel.errors import FifthwheelError as FifthwheelError
    from fifthwheel.errors import SignalError as SignalError
    from fifthwheel.errors import VehicleError as VehicleError
    from fifthwheel.evaluate import Evaluation as Evaluation
    from fifthwheel.evaluate import Validation as Validation
    from fifthwheel.evaluate import validate as validate
    from fifthwheel.export import export_c as export_c
    from fifthwheel.export import export_fmu as export_fmu
    from fifthwheel.identify import Identification as Identification
    from fifthwheel.identify import LogPosterior as LogPosterior
    from fifthwheel.identify import OneStage as OneStage
    from fifthwheel.identify import Posterior as Posterior
    from fifthwheel.identify import Profile as Profile
    from fifthwheel.identify import Verdict as Verdict
    from fifthwheel.identify import log_posterior as log_posterior
    from fifthwheel.identify.design import design_experiment as design_experiment
    from fifthwheel.identify.design import predict_sigmas as predict_sigmas
    from fifthwheel.identify.knowledge.information import Occasion as Occasion
    from fifthwheel.identify.knowledge.knowledge import Knowledge as Knowledge
    from fifthwheel.identify.knowledge.load import with_payload as with_payload
    from fifthwheel.identify.mass import GrossMass as GrossMass
    from fifthwheel.identify.mass import gross_mass as gross_mass
    from fifthwheel.identify.online import Learner as Learner
    from fifthwheel.identify.online import LearnerSettings as LearnerSettings
    from fifthwheel.logs import LiveMap as LiveMap
    from fifthwheel.logs import SignalMap as SignalMap
    from fifthwheel.logs import read_log as read_log
    from fifthwheel.logs import write_record as write_record
    from fifthwheel.observe import Observer as Observer
    from fifthwheel.observe import ObserverSettings as ObserverSettings
    from fifthwheel.observe import States as States
    from fifthwheel.observe import Status as Status
    from fifthwheel.observe import Uncertainty as Uncertainty
    from fifthwheel.observe import time_to_lift as time_to_lift
    from fifthwheel.pages.terminal import progress_bar as progress_bar
    from fifthwheel.plots import Plot as Plot
    from fifthwheel.record import Record as Record
    from fifthwheel.record import SensorPrior as SensorPrior
    from fifthwheel.report import write_report as write_report
    from fifthwheel.studies import Estimates as Estimates
    from fifthwheel.studies import Estimator as Estimator
    from fifthwheel.studies import SimulatedRun as SimulatedRun
    from fifthwheel.studies import StateEstimator as StateEstimator
    from fifthwheel.studies import StatesOf as StatesOf
    from fifthwheel.studies import exact_guess as exact_guess
    from fifthwheel.studies import study as study
    from fifthwheel.time_bases import check_signals as check_signals
    from fifthwheel.vehicle import Vehicle as Vehicle
else:
    __getattr__, __dir__, __all__ = lazy_names(
        __name__, "assess", "evaluate", "fleet", "identify", "plot", "simulate", "vehicle"
    )
    __all__ += ["__version__"]

__version__ = "0.2.0"
imported_at = time.time()
"""Time at which the first module of the package was imported."""
