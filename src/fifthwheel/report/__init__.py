"""Results for people: a page that opens without a network, and tables on a terminal."""

from fifthwheel.report.html.comparison import write_comparison_page
from fifthwheel.report.html.performance import write_assessment_report
from fifthwheel.report.html.report import write_report, write_states_report
from fifthwheel.report.html.sections import StateConditions
from fifthwheel.report.provenance import Provenance, gather_provenance, provenance_of_run
from fifthwheel.report.terminal.comparison import show_comparison
from fifthwheel.report.terminal.performance import show_assessment
from fifthwheel.report.terminal.results import show_identification, show_states
from fifthwheel.report.text.conclusion import Conclusion, conclude_identification, conclude_states

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
