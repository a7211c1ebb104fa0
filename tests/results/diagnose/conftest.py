"""The identification of the report's tests."""

from tests.results.report.conftest import result

__all__ = ["result"]
