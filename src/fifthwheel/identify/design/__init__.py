"""Information before the fit: what logs contain, and the run that reaches target accuracies.

assess             information in logs: predicted sigma, verdict and remedies of every parameter
experiment         the shortest run that reaches target accuracies
next_manoeuvre     what to drive next while a learner learns
search             the candidate runs of that design
predict            Fisher information of runs, and the posterior that a fit would give
remedies           changes that would reduce a sigma
impulse_response   information of any steer angle at one speed, by convolution
"""

from fifthwheel.identify.design.assess import (
    AssessmentSettings,
    InformationAssessment,
    ParameterAssessment,
    predict_sigmas,
)
from fifthwheel.identify.design.experiment import ExperimentDesign, ProposedRun, UnmetTarget, design_experiment
from fifthwheel.identify.design.remedies import Remedy
from fifthwheel.identify.design.search import DesignSettings

__all__ = [
    "AssessmentSettings",
    "DesignSettings",
    "ExperimentDesign",
    "InformationAssessment",
    "ParameterAssessment",
    "ProposedRun",
    "Remedy",
    "UnmetTarget",
    "design_experiment",
    "predict_sigmas",
]
