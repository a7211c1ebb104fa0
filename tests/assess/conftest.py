"""Fixtures of the tests of assessments."""

from tests.report.conftest import result

__all__ = ["result"]
