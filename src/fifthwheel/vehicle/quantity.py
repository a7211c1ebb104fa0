"""A number with its unit, as engineers write it: '475 kN/rad' -> 475000.0."""

import re
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from fifthwheel.errors import VehicleError

if TYPE_CHECKING:
    import pint

FACTORS: dict[str, dict[str, float]] = {
    "kg": {"kg": 1.0, "t": 1e3},
    "m": {"m": 1.0},
    "kg m^2": {"kg m^2": 1.0},
    "N/rad": {"N/rad": 1.0, "kN/rad": 1e3},
    "N m/rad": {"N m/rad": 1.0, "kN m/rad": 1e3},
    "N m s/rad": {"N m s/rad": 1.0, "kN m s/rad": 1e3},
}
"""Usual spellings of each SI unit and what they are worth; pint, slow to start, reads all others."""

_WRITTEN = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*")


def quantity(value: Any, *, unit: str, path: str) -> float:
    """A value in the given SI unit; a bare number is taken to be in it already.

    Angles count: a stiffness in N is refused where N/rad is meant, kN/deg is converted, and N/rad is never N m/rad.
    """
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return float(value)
    match = _WRITTEN.fullmatch(value) if isinstance(value, str) else None
    if match is None:
        raise VehicleError(f"{path}: expected a number and a unit such as '1 {unit}', got {value!r}; write it so")
    number, written = float(match[1]), match[2]
    if written in FACTORS[unit]:
        return number * FACTORS[unit][written]
    return number * _factor(written, unit, path) if written else number


def _factor(written: str, unit: str, path: str) -> float:
    """How many of the SI unit there are in the written one, by pint; radians are kept in the comparison."""
    try:
        got, wanted = (_registry().Quantity(1.0, text.replace("·", "*")).to_root_units() for text in (written, unit))
    except Exception as error:  # pint, the tokenizer and Python's parser each have their own
        raise VehicleError(
            f"{path}: expected {unit}, got '{written}', which is not a unit ({error}); write it like '{unit}'"
        ) from None
    if got.units != wanted.units:
        raise VehicleError(f"{path}: expected {unit}, got '{written}'; {_cure(unit)}")
    return float(got.magnitude / wanted.magnitude)


def _cure(unit: str) -> str:
    if unit == "N/rad":
        return "a cornering stiffness is a side force per angle, the total of the group's axles"
    if unit == "N m/rad":
        return (
            "a roll stiffness is a moment per angle; a spring of k N/m at y m from the middle on either side is 2 k y^2"
        )
    return f"give it in {unit} or in what can be converted to it"


@lru_cache(maxsize=1)
def _registry() -> "pint.UnitRegistry[Any]":
    import pint

    return pint.UnitRegistry()
