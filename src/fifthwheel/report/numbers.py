"""Numbers as people read them: rounded to what is known of them, in the units of the workshop."""

import math
from collections.abc import Sequence
from typing import NamedTuple


class Unit(NamedTuple):
    """How an SI unit is shown."""

    name: str
    factor: float
    """Shown value = SI value times this."""


SHOWN = {
    "N/rad": Unit("kN/rad", 1e-3),
    "N m/rad": Unit("kN m/rad", 1e-3),
    "N m s/rad": Unit("kN m s/rad", 1e-3),
    "N": Unit("kN", 1e-3),
    "kg m^2": Unit("kg m²", 1.0),
    "rad": Unit("deg", 180 / math.pi),
    "rad/s": Unit("deg/s", 180 / math.pi),
    "rad/s^2": Unit("deg/s²", 180 / math.pi),
    "m/s^2": Unit("m/s²", 1.0),
    "s": Unit("ms", 1e3),
    "1": Unit("", 1.0),
}
"""SI unit -> unit in a report; what is not here is shown in SI."""

TYPOGRAPHY = str.maketrans(
    {"±": "+-", "²": "^2", "≥": ">=", "×": "x", "–": "-", "−": "-", "\u202f": "", "\u00a0": " ", "…": "..."}
)


SIGNS = str.maketrans({",": "\u202f", "-": "−"})
"""What Python prints -> what a reader expects: a thin space between thousands, a minus that is as wide as a plus."""


def shown(si_unit: str) -> Unit:
    """Unit in which a quantity of this SI unit is shown."""
    return SHOWN.get(si_unit, Unit(si_unit, 1.0))


def plain_ascii(text: str) -> str:
    """A text of this room for a terminal that may know ASCII only."""
    return text.translate(TYPOGRAPHY)


def fixed(value: float, decimals: int) -> str:
    """A value with so many decimals; a negative number rounds to tens, hundreds, and thousands are set apart."""
    if not math.isfinite(value):
        return "–"
    rounded = round(value, decimals) + 0.0  # no "-0"
    return f"{rounded:,.{max(decimals, 0)}f}".translate(SIGNS)


def digits(value: float, count: int = 4, *, exact: bool = False) -> str:
    """A value with `count` significant digits, without an exponent between 1e-6 and 1e9; `exact` drops final zeros."""
    if not math.isfinite(value):
        return "–"
    if value != 0 and not 1e-6 <= abs(value) < 1e9:
        return f"{value:.{count - 1}e}"
    text = fixed(value, _decimals(value, count))
    return text.rstrip("0").rstrip(".") if exact and "." in text else text


def pair(value: float, sigma: float | None) -> tuple[str, str | None]:
    """Value and sigma, both rounded to the sigma's two significant digits: 475.31, 4.34 -> "475.3", "4.3"."""
    if sigma is None or not math.isfinite(sigma) or sigma <= 0 or not 1e-6 <= max(abs(value), sigma) < 1e9:
        return digits(value, exact=True), None
    decimals = _decimals(sigma, 2)
    return fixed(value, decimals), fixed(sigma, decimals)


def with_sigma(value: float, sigma: float | None, si_unit: str) -> str:
    """Value, sigma and unit in one text: "475.3 ± 4.3 kN/rad"."""
    unit = shown(si_unit)
    number, spread = pair(value * unit.factor, None if sigma is None else sigma * unit.factor)
    text = number if spread is None else f"{number} ± {spread}"
    return f"{text} {unit.name}".rstrip()


def about(value: float, si_unit: str) -> str:
    """A size with its unit, two significant digits: a noise, a residual."""
    unit = shown(si_unit)
    return f"{digits(value * unit.factor, 2)} {unit.name}".rstrip()


def relative(value: float, sigma: float | None) -> str:
    """Sigma as a percentage of the value; of more than 100 % only that."""
    if sigma is None or not value or not math.isfinite(sigma):
        return "–"
    part = sigma / abs(value)
    return percent(part) if part <= 1 else "> 100 %"


def percent(part: float, *, of_whole: bool = False) -> str:
    """A part as a percentage: 0.0043 -> "0.43 %"; `of_whole` keeps 99.97 % from becoming 100 %."""
    if not math.isfinite(part):
        return "–"
    value = 100 * part
    if of_whole:
        return f"{math.floor(10 * value + 1e-9) / 10:.1f} %"
    if abs(value) >= 9.95 or value == 0:
        return f"{fixed(value, 0)} %"
    return f"{digits(value, 2, exact=True)} %"


def seconds(value: float | None) -> str:
    """A time, for a table."""
    if value is None:
        return "–"
    return f"{fixed(value, 1 if abs(value) < 100 else 0)} s"


def kmh(speed: tuple[float, float]) -> str:
    """A range of speeds, m/s, as "40 to 46 km/h"."""
    if not math.isfinite(speed[0]):
        return "–"
    low, high = (f"{3.6 * value:.0f}" for value in speed)
    return f"{low} km/h" if low == high else f"{low} to {high} km/h"


def listed(names: Sequence[str]) -> str:
    """ "a, b and c", each once."""
    names = list(dict.fromkeys(names))
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def _decimals(value: float, count: int) -> int:
    if value == 0:
        return 1
    exponent = int(f"{abs(value):.{count - 1}e}".partition("e")[2])
    return count - 1 - exponent
