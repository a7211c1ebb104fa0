"""Information before the fit: what logs contain, and the run that reaches target accuracies."""

from fifthwheel.estimate.design.assess import (
    AssessmentSettings,
    InformationAssessment,
    ParameterAssessment,
    predict_sigmas,
)
from fifthwheel.estimate.design.experiment import ExperimentDesign, UnmetTarget, design_experiment
from fifthwheel.estimate.design.remedies import Remedy
from fifthwheel.estimate.design.search import DesignSettings, ProposedRun

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
