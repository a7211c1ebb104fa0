"""Results for people: the documents of results, with their words, as pages and on a terminal."""

from fifthwheel.report.assessment import show_assessment, write_assessment_report
from fifthwheel.report.comparison import show_comparison, write_comparison_page
from fifthwheel.report.conclusion import Conclusion, conclude_identification, conclude_states
from fifthwheel.report.identification import show_identification, write_report
from fifthwheel.report.provenance import Provenance, gather_provenance, provenance_of_run
from fifthwheel.report.states import StateConditions, show_states, write_states_report

__all__ = [
    "Conclusion",
    "Provenance",
    "StateConditions",
    "conclude_identification",
    "conclude_states",
    "gather_provenance",
    "provenance_of_run",
    "show_assessment",
    "show_comparison",
    "show_identification",
    "show_states",
    "write_assessment_report",
    "write_comparison_page",
    "write_report",
    "write_states_report",
]
