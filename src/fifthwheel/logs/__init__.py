"""Logs: from a file to a Record of named signals in SI, and whether they can be what they are said to be."""

from fifthwheel.logs.faults import Fault, Finding, raise_errors
from fifthwheel.logs.files import read, write
from fifthwheel.logs.plausibility import check
from fifthwheel.logs.record import Record
from fifthwheel.logs.signals import SignalMap

__all__ = ["Fault", "Finding", "Record", "SignalMap", "check", "raise_errors", "read", "write"]
