"""Exceptions, and the suggestion that ends a message about an unknown name."""

import pytest

from fifthwheel.errors import FifthwheelError, SignalError, UnitError, VehicleError, suggestion


@pytest.mark.parametrize(
    ("name", "known", "text"),
    [
        ("masss", ["mass", "cog"], "did you mean 'mass'?"),
        ("fornt", ["front", "frond", "drive"], "did you mean 'front' or 'frond'?"),
        ("x", ["mass", "cog"], "available: mass, cog"),
        ("x", [], "available: none"),
    ],
)
def test_similar_names_are_suggested_and_otherwise_all_are_listed(name: str, known: list[str], text: str) -> None:
    assert suggestion(name, known) == text


def test_all_exceptions_are_value_errors_of_one_family() -> None:
    for kind in (VehicleError, SignalError, UnitError):
        assert issubclass(kind, FifthwheelError)
    assert issubclass(FifthwheelError, ValueError)
