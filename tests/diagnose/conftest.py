"""The identification of the report's tests."""

from tests.report.conftest import result

__all__ = ["result"]
