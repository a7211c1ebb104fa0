"""Diagnosis of identifications and states: findings as data, with a message each, usable without a report."""

from fifthwheel.results.diagnose.advice import Advice, next_steps
from fifthwheel.results.diagnose.cautions import identification_cautions, state_cautions
from fifthwheel.results.diagnose.comparison import Comparison, compare
from fifthwheel.results.diagnose.information_summary import information_summary
from fifthwheel.results.diagnose.messages import Caution, CautionKind, ranked
from fifthwheel.results.diagnose.predictions import LogPrediction
from fifthwheel.results.diagnose.summaries import summarise_runs, summarise_states
from fifthwheel.truck.spoken_names import spoken

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
