"""Diagnosis of identifications and states: findings as data, with a message each, usable without a report."""

from fifthwheel.diagnose.advice import Advice, next_steps
from fifthwheel.diagnose.caution import Caution, CautionKind, ranked
from fifthwheel.diagnose.cautions import identification_cautions, state_cautions
from fifthwheel.diagnose.comparison import Comparison, compare
from fifthwheel.diagnose.information_summary import information_summary
from fifthwheel.diagnose.log_prediction import LogPrediction
from fifthwheel.diagnose.summaries import summarise_runs, summarise_states
from fifthwheel.spoken_names import spoken

__all__ = [
    "Advice",
    "Caution",
    "CautionKind",
    "Comparison",
    "LogPrediction",
    "compare",
    "identification_cautions",
    "information_summary",
    "next_steps",
    "ranked",
    "spoken",
    "state_cautions",
    "summarise_runs",
    "summarise_states",
]
