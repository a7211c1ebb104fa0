"""Fixtures of the tests of the report and of the observer."""

from tests.observe.conftest import truck
from tests.report.conftest import result

__all__ = ["result", "truck"]
