"""Fixtures shared with the tests of logs."""

from tests.data.logs.conftest import data, weaving

__all__ = ["data", "weaving"]
