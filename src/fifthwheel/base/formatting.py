"""Numbers as text: rounded to their uncertainty, in the units that engineers use."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from fifthwheel.base.units import STANDARD_GRAVITY


class DisplayUnit(NamedTuple):
    """The unit in which an SI quantity is shown."""

    name: str
    factor: float  # shown value = SI value times this


DISPLAY_UNITS = {
    "N/rad": DisplayUnit("kN/rad", 1e-3),
    "N m/rad": DisplayUnit("kN m/rad", 1e-3),
    "N m s/rad": DisplayUnit("kN m s/rad", 1e-3),
    "N": DisplayUnit("kN", 1e-3),
    "kg m^2": DisplayUnit("kg m²", 1.0),
    "m^2": DisplayUnit("m²", 1.0),
    "rad": DisplayUnit("deg", 180 / math.pi),
    "rad/s": DisplayUnit("deg/s", 180 / math.pi),
    "rad/s^2": DisplayUnit("deg/s²", 180 / math.pi),
    "m/s^2": DisplayUnit("m/s²", 1.0),
    "rad s^2/m": DisplayUnit("deg/g", 180 / math.pi * STANDARD_GRAVITY),
    "s": DisplayUnit("ms", 1e3),
    "1": DisplayUnit("", 1.0),
}
"""SI unit -> display unit; any other unit is shown as it is."""

_ASCII = str.maketrans(
    {"±": "+-", "²": "^2", "≥": ">=", "≤": "<=", "×": "x", "–": "-", "−": "-", "\u202f": "", "\u00a0": " ", "…": "..."}
    | {"α": "a"}
)
_TYPOGRAPHY = str.maketrans({",": "\u202f", "-": "−"})
"""Python's number format -> typography: a thin space between thousands, a minus sign as wide as the plus sign."""


def shown(si_unit: str | None) -> DisplayUnit:
    """Display unit of a quantity in this SI unit; None for a quantity without a unit."""
    return DISPLAY_UNITS.get(si_unit or "", DisplayUnit(si_unit or "", 1.0))


def plain_ascii(text: str) -> str:
    """A text of this module in ASCII, for terminals without Unicode."""
    return text.translate(_ASCII)


def fixed(value: float, decimals: int) -> str:
    """A value with a fixed number of decimals; a negative number of decimals rounds to tens, hundreds, ..."""
    if not math.isfinite(value):
        return "–"
    rounded = round(value, decimals) + 0.0  # no "-0"
    return f"{rounded:,.{max(decimals, 0)}f}".translate(_TYPOGRAPHY)


def digits(value: float, count: int = 4, *, exact: bool = False) -> str:
    """A value with `count` significant digits, without an exponent from 1e-6 to 1e9; `exact` drops trailing zeros."""
    if not math.isfinite(value):
        return "–"
    if value != 0 and not 1e-6 <= abs(value) < 1e9:
        return f"{value:.{count - 1}e}"
    text = fixed(value, _decimals(value, count))
    return text.rstrip("0").rstrip(".") if exact and "." in text else text


def value_and_sigma(value: float, sigma: float | None) -> tuple[str, str | None]:
    """Value and sigma, both rounded to two significant digits of sigma: 475.31, 4.34 -> "475.3", "4.3"."""
    if sigma is None or not math.isfinite(sigma) or sigma <= 0 or not 1e-6 <= max(abs(value), sigma) < 1e9:
        return digits(value, exact=True), None
    decimals = _decimals(sigma, 2)
    return fixed(value, decimals), fixed(sigma, decimals)


def shown_parts(value: float, sigma: float | None, si_unit: str | None) -> tuple[str, str | None, str]:
    """Value, sigma and the name of the display unit of an SI quantity, rounded as by `value_and_sigma`."""
    unit = shown(si_unit)
    return *value_and_sigma(value * unit.factor, None if sigma is None else sigma * unit.factor), unit.name


def with_sigma(value: float, sigma: float | None, si_unit: str) -> str:
    """Value, sigma and display unit in one text: "475.3 ± 4.3 kN/rad"."""
    number, spread, unit = shown_parts(value, sigma, si_unit)
    text = number if spread is None else f"{number} ± {spread}"
    return f"{text} {unit}".rstrip()


def approximate(value: float, si_unit: str | None) -> str:
    """A magnitude such as a noise or a residual, with two significant digits and its display unit."""
    unit = shown(si_unit)
    return f"{digits(value * unit.factor, 2)} {unit.name}".rstrip()


def relative(value: float, sigma: float | None) -> str:
    """Sigma in per cent of the value; above 100 % only "> 100 %"."""
    if sigma is None or not value or not math.isfinite(sigma):
        return "–"
    fraction = sigma / abs(value)
    return percent(fraction) if fraction <= 1 else "> 100 %"


def percent(fraction: float, *, round_down: bool = False) -> str:
    """A fraction in per cent: 0.0043 -> "0.43 %"; `round_down` never shows 99.97 % as 100 %."""
    if not math.isfinite(fraction):
        return "–"
    value = 100 * fraction
    if round_down:
        return f"{math.floor(10 * value + 1e-9) / 10:.1f} %"
    if abs(value) >= 9.95 or value == 0:
        return f"{fixed(value, 0)} %"
    return f"{digits(value, 2, exact=True)} %"


def seconds(value: float | None) -> str:
    """A duration in s, for a table."""
    if value is None:
        return "–"
    return f"{fixed(value, 1 if abs(value) < 100 else 0)} s"


def kmh(speed: tuple[float, float]) -> str:
    """A range of speeds in m/s as "40 to 46 km/h"."""
    if not math.isfinite(speed[0]):
        return "–"
    low, high = (f"{3.6 * value:.0f}" for value in speed)
    return f"{low} km/h" if low == high else f"{low} to {high} km/h"


def enumerated(names: Sequence[str]) -> str:
    """Names as "a, b and c", without duplicates."""
    names = list(dict.fromkeys(names))
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def _decimals(value: float, count: int) -> int:
    """Decimals that show `count` significant digits."""
    if value == 0:
        return 1
    exponent = int(f"{abs(value):.{count - 1}e}".partition("e")[2])
    return count - 1 - exponent
