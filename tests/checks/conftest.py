"""Fixtures shared with the tests of logs."""

from tests.logs.conftest import data, weaving

__all__ = ["data", "weaving"]
