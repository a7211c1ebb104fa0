"""Checks of a record before it is used: sensor faults, units, signs, and consistency with the kinematics of a truck."""

from fifthwheel.data.checks.findings import Fault, Finding, raise_errors
from fifthwheel.data.checks.plausibility import check

__all__ = ["Fault", "Finding", "check", "raise_errors"]
