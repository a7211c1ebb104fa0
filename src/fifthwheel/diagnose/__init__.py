"""Diagnosis of identifications and states: findings as data, with a message each, usable without a report."""

from fifthwheel.diagnose.advice import Advice, next_steps
from fifthwheel.diagnose.cautions import Caution, CautionKind, identification_cautions, state_cautions
from fifthwheel.diagnose.comparison import ComparedParameter, Comparison, Difference, compare
from fifthwheel.diagnose.fit_quality import FitQuality, PredictedLog, fit_quality, predicted_logs
from fifthwheel.diagnose.information_summary import ParameterInformation, information_summary
from fifthwheel.diagnose.log_prediction import LogPrediction
from fifthwheel.diagnose.run_summary import RunSummary, summarise_records, summarise_runs
from fifthwheel.diagnose.state_summary import StateSummary, summarise_states
from fifthwheel.diagnose.variance_budget import VarianceTerm, variance_budget

__all__ = [
    "Advice",
    "Caution",
    "CautionKind",
    "ComparedParameter",
    "Comparison",
    "Difference",
    "FitQuality",
    "LogPrediction",
    "ParameterInformation",
    "PredictedLog",
    "RunSummary",
    "StateSummary",
    "VarianceTerm",
    "compare",
    "fit_quality",
    "identification_cautions",
    "information_summary",
    "next_steps",
    "predicted_logs",
    "state_cautions",
    "summarise_records",
    "summarise_runs",
    "summarise_states",
    "variance_budget",
]
