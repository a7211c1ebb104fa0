"""Logs: from a file to a Record of named signals in SI, and whether they can be what they are said to be."""

from .faults import Fault, Finding, raise_errors
from .files import read, write
from .plausibility import check
from .record import Record
from .signals import SignalMap

__all__ = ["Fault", "Finding", "Record", "SignalMap", "check", "raise_errors", "read", "write"]
