"""Information before the fit: what logs contain, and the run that reaches target accuracies."""

from fifthwheel.identify.design.assess import (
    AssessmentSettings,
    InformationAssessment,
    ParameterAssessment,
    predict_sigmas,
)
from fifthwheel.identify.design.experiment import ExperimentDesign, UnmetTarget, design_experiment
from fifthwheel.identify.design.remedies import Remedy
from fifthwheel.identify.design.search import DesignSettings, ProposedRun

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
