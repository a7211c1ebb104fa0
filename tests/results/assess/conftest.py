"""Fixtures of the tests of assessments."""

from tests.results.report.conftest import result

__all__ = ["result"]
