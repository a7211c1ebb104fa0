"""Results for people: the documents of results, with their words, as pages and on a terminal."""

from fifthwheel.results.report.assessment import assessment_document, write_assessment_report
from fifthwheel.results.report.comparison import comparison_document, comparison_page
from fifthwheel.results.report.conclusion import Conclusion, conclude_identification, conclude_states
from fifthwheel.results.report.identification import identification_document, write_report
from fifthwheel.results.report.provenance import Provenance, gather_provenance, provenance_of_run
from fifthwheel.results.report.states import StateConditions, states_document, write_states_report

__all__ = [
    "Conclusion",
    "Provenance",
    "StateConditions",
    "assessment_document",
    "comparison_document",
    "comparison_page",
    "conclude_identification",
    "conclude_states",
    "gather_provenance",
    "identification_document",
    "provenance_of_run",
    "states_document",
    "write_assessment_report",
    "write_report",
    "write_states_report",
]
