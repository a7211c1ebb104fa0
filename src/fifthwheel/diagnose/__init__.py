"""Diagnosis of identifications and states: findings as data, with a message each, usable without a report."""

from fifthwheel.diagnose.advice import Advice, next_steps
from fifthwheel.diagnose.caution import Caution, CautionKind, ranked
from fifthwheel.diagnose.cautions import identification_cautions, state_cautions
from fifthwheel.diagnose.comparison import ComparedParameter, Comparison, Difference, compare
from fifthwheel.diagnose.fit_quality import FitQuality, PredictedLog, fit_quality, predicted_logs
from fifthwheel.diagnose.information_summary import (
    ParameterInformation,
    VarianceTerm,
    information_summary,
    variance_budget,
)
from fifthwheel.diagnose.log_prediction import LogPrediction
from fifthwheel.diagnose.summaries import RunSummary, StateSummary, summarise_records, summarise_runs, summarise_states
from fifthwheel.spoken_names import named, spoken

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
    "named",
    "next_steps",
    "predicted_logs",
    "ranked",
    "spoken",
    "state_cautions",
    "summarise_records",
    "summarise_runs",
    "summarise_states",
    "variance_budget",
]
