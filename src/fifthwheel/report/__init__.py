"""What people see: a page that opens anywhere, and tables on a terminal."""

from fifthwheel.report.html import write_report
from fifthwheel.report.observed import Given
from fifthwheel.report.provenance import Provenance, gather, of_run
from fifthwheel.report.terminal import show_identification, show_states

__all__ = ["Given", "Provenance", "gather", "of_run", "show_identification", "show_states", "write_report"]
