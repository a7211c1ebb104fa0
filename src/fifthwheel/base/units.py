"""Units as engineers write them: one parser for logs, signal maps, vehicle files and options.

A unit is a product of symbols with small integer powers: "km/h", "m/s^2", "kN m/rad", "t*m**2", "kN*m/(rad/s)", "°/s".
A factor after "/" divides; the others multiply, from left to right. The grammar is closed: no expression is evaluated.
"""

import math
import re
from functools import lru_cache

from fifthwheel.base.errors import UnitError

STANDARD_GRAVITY = 9.80665
"""m/s^2, exact by definition."""

MAX_LENGTH = 40
"""Characters of a unit; a longer text is refused."""
MAX_POWER = 6
"""Magnitude of an exponent; a larger one is refused."""

Dimension = tuple[tuple[str, int], ...]
"""Base dimensions with their powers, sorted by name; the angle counts as one."""

_BASE: dict[str, tuple[float, dict[str, int]]] = {
    "1": (1.0, {}),
    "%": (1e-2, {}),
    "s": (1.0, {"time": 1}),
    "min": (60.0, {"time": 1}),
    "h": (3600.0, {"time": 1}),
    "m": (1.0, {"length": 1}),
    "ft": (0.3048, {"length": 1}),
    "in": (0.0254, {"length": 1}),
    "mi": (1609.344, {"length": 1}),
    "kg": (1.0, {"mass": 1}),
    "t": (1e3, {"mass": 1}),
    "lb": (0.45359237, {"mass": 1}),
    "rad": (1.0, {"angle": 1}),
    "deg": (math.pi / 180, {"angle": 1}),
    "gon": (math.pi / 200, {"angle": 1}),
    "rev": (2 * math.pi, {"angle": 1}),
    "rpm": (2 * math.pi / 60, {"angle": 1, "time": -1}),
    "Hz": (1.0, {"cycle": 1, "time": -1}),
    "mph": (0.44704, {"length": 1, "time": -1}),
    "kn": (1852 / 3600, {"length": 1, "time": -1}),
    "g": (STANDARD_GRAVITY, {"length": 1, "time": -2}),
    "N": (1.0, {"mass": 1, "length": 1, "time": -2}),
    "lbf": (4.4482216152605, {"mass": 1, "length": 1, "time": -2}),
    "Pa": (1.0, {"mass": 1, "length": -1, "time": -2}),
    "bar": (1e5, {"mass": 1, "length": -1, "time": -2}),
    "psi": (6894.757293168361, {"mass": 1, "length": -1, "time": -2}),
    "W": (1.0, {"mass": 1, "length": 2, "time": -3}),
    "J": (1.0, {"mass": 1, "length": 2, "time": -2}),
    "V": (1.0, {"voltage": 1}),
    "A": (1.0, {"current": 1}),
    "K": (1.0, {"temperature": 1}),
    "degC": (1.0, {"temperature": 1}),
    "C": (1.0, {"temperature": 1}),
    "l": (1e-3, {"length": 3}),
    "bit": (1.0, {"bit": 1}),
    "-": (1.0, {}),
}
_SI_BASE = {"mass": "kg", "length": "m", "time": "s", "current": "A", "temperature": "K", "angle": "rad"}
_PREFIXES = {"M": 1e6, "k": 1e3, "da": 10.0, "c": 1e-2, "m": 1e-3, "u": 1e-6, "µ": 1e-6, "μ": 1e-6, "n": 1e-9}
_PREFIXED = ("s", "m", "rad", "Hz", "g", "N", "Pa", "bar", "W", "J", "V", "A")
_SYMBOLS = {
    **{
        prefix + name: (factor * _BASE[name][0], _BASE[name][1])
        for name in _PREFIXED
        for prefix, factor in _PREFIXES.items()
    },
    **_BASE,
}
_ALIASES = {
    **dict.fromkeys(("°", "degree", "degrees", "Grad"), "deg"),
    **dict.fromkeys(("sec", "second", "seconds"), "s"),
    **dict.fromkeys(("kmh", "kph", "kmph"), "km/h"),
    **dict.fromkeys(("hr", "hour"), "h"),
    **dict.fromkeys(("knot", "knots", "kts"), "kn"),
    **dict.fromkeys(("grad", "gradian"), "gon"),
    **dict.fromkeys(("radian", "radians"), "rad"),
    "Nm": "N m",
    "kNm": "kN m",
    "mps": "m/s",
    "Km": "km",
    "Mph": "mph",
    "G": "g",
    "°C": "degC",
}
_SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁻", "0123456-")
_TOKEN = re.compile(
    r"\s*(?:(?P<symbol>1(?![0-9])|%|-|°C|°|[A-Za-zµμ]+)(?:\s*(?:\^|\*\*)?\s*(?P<power>[-+]?\d{1,2}))?|(?P<mark>[*·./()]))\s*"
)
_QUANTITY = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*", re.DOTALL)
_STATEMENT = re.compile(r"\s*(\+/?-|±|\bexact\b)\s*")


def factor(unit: str, si: str, *, strict: bool = False) -> float:
    """The number of SI units `si` in one `unit`.

    Args:
        unit: as written.
        si: the SI unit that is expected.
        strict: count the angle as a dimension, so that N is not N/rad. Otherwise "1/s" is accepted for rad/s. A mass is
            accepted for a force and means its weight, as on-board scales show axle loads in kg.

    Raises:
        UnitError: the text is not a unit, or its dimension is another one.

    >>> round(factor("deg/s", "rad/s"), 6)
    0.017453
    >>> factor("km/h", "m/s") == 1 / 3.6
    True
    """
    (size, dimension), (expected_size, expected) = _parsed(unit), _parsed(si)
    if expected == _parsed("N")[1] and dimension == (("mass", 1),):
        return size * STANDARD_GRAVITY / expected_size
    if dimension != expected and (strict or _without_angle(dimension) != _without_angle(expected)):
        raise UnitError(f"expected {si} or a unit that converts to it, got {_shown(unit)}")
    return size / expected_size


def quantity(value: float | str, si: str, *, strict: bool = False) -> float:
    """A value in the SI unit `si`: a number is in it already, a text may carry another unit.

    Raises:
        UnitError: the text is not a number with a unit, or the unit does not fit; arguments as in `factor`.

    >>> quantity("200 ms", "s")
    0.2
    """
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return float(value)
    number, unit = _number_and_unit(value, si)
    return number * (factor(unit, si, strict=strict) if unit else 1.0)


def uncertain_quantity(
    value: float | str, si: str, *, strict: bool = False, unit_needed: bool = False
) -> tuple[float, float | None]:
    """A value in the SI unit `si` and its standard deviation: 0 if it is exact, None if the text does not state it.

    The standard deviation follows "+-", "+/-" or "±", with a unit or in percent of the value; one behind both is `si`.
    With `unit_needed`, a text has a unit, unless its number is 0.

    Raises:
        UnitError: the value or its standard deviation is not valid; arguments as in `factor`.

    >>> [uncertain_quantity(text, "kg") for text in ("8 t +- 200 kg", "8 t +- 2 %", "8 t exact", "8 t")]
    [(8000.0, 200.0), (8000.0, 160.0), (8000.0, 0.0), (8000.0, None)]
    """
    if not isinstance(value, str) or len(value) > 5 * MAX_LENGTH:
        return quantity(value, si, strict=strict), None
    text, *statement = split_statement(value)
    size = quantity(text, si, strict=strict)
    number, behind = _number_and_unit(statement[1], si, "after '+-': ") if statement[0] == "+-" else (0.0, "")
    own = _number_and_unit(text, si)[1]
    bare = bool(size) and not own
    if bare and behind not in ("", "%", si) and si != "1":
        raise UnitError(
            f"expected a unit of the value too, got {_shown(value)}; write '{text} {behind} +- {statement[1]}'"
        )
    if bare and unit_needed and behind != si:
        raise UnitError(f"expected a number with a unit such as '1 {si}', got {_shown(value)}; add its unit")
    if not statement[0]:
        return size, None
    if statement[0] == "exact":
        return size, 0.0
    if behind == "%":
        if size == 0:
            raise UnitError(
                f"after '+-': expected {si}, because percent of 0 is 0, got {_shown(value)}; write '+- 0.1 {si}'"
            )
        sigma = abs(size) * number / 100
    elif own and not behind:
        raise UnitError(f"after '+-': expected a unit, got {_shown(value)}; write '+- {number:g} {own}'")
    else:
        try:
            sigma = quantity(statement[1], si, strict=strict)
        except UnitError as error:
            raise UnitError(f"after '+-': {error}; give one standard deviation in {si} or in percent") from None
    if not 0 <= sigma < math.inf:
        raise UnitError(
            f"after '+-': expected a finite standard deviation, 0 or more, got {_shown(value)}; give its magnitude"
        )
    return size, sigma


def split_statement(text: str) -> tuple[str, str, str]:
    """The parts of a text such as "8 t +- 2 %": the value, "+-" or "exact", and the standard deviation; each may be
    empty.

    Raises:
        UnitError: the text has several '+-' or 'exact', or something behind 'exact'.

    >>> split_statement("8 t +- 2 %"), split_statement("exact")
    (('8 t', '+-', '2 %'), ('', 'exact', ''))
    """
    value, *statement = _STATEMENT.split(text)
    if len(statement) > 2 or (statement[:1] == ["exact"] and statement[1]):
        raise UnitError(f"expected one '+- ...' or 'exact' at the end, got {_shown(text)}; keep only one")
    mark, sigma = statement or ("", "")
    return value, mark if mark in ("", "exact") else "+-", sigma


def base_units(unit: str) -> dict[str, int]:
    """Powers of the SI base units and of rad in a unit of size 1.

    Raises:
        UnitError: the text is not a unit, or not the product of such powers.

    >>> base_units("N m/rad")
    {'kg': 1, 'm': 2, 'rad': -1, 's': -2}
    """
    size, dimension = _parsed(unit)
    if size != 1 or any(name not in _SI_BASE for name, _ in dimension):
        raise UnitError(f"expected a coherent unit in kg, m, s, A, K and rad, got {_shown(unit)}")
    return dict(sorted((_SI_BASE[name], power) for name, power in dimension))


def own_quantity(text: object) -> tuple[str, float, float | None]:
    """SI unit, value and standard deviation, see `uncertain_quantity`, of a quantity that may have any unit.

    Raises:
        UnitError: the text is not a number, a space and a unit.

    >>> own_quantity("150 ms +- 20 %")
    ('s', 0.15, 0.03)
    """
    if not isinstance(text, str):
        raise UnitError(f"expected a text such as '0.15 s +- 20 %', got {_shown(text)}")
    _, unit = _number_and_unit(split_statement(text)[0], "rad")
    _, dimension = _parsed(unit or "1")
    if any(name not in _SI_BASE for name, _ in dimension):
        raise UnitError(f"expected a unit of kg, m, s, A, K and rad, got {_shown(unit)}")
    powers = sorted((_SI_BASE[name], power) for name, power in dimension)
    factors = [(name if abs(power) == 1 else f"{name}^{abs(power)}", power > 0) for name, power in powers]
    si = " ".join(text for text, multiplies in factors if multiplies) or "1"
    si += "".join(f"/{text}" for text, multiplies in factors if not multiplies)
    return si, *uncertain_quantity(text, si, strict=True)


def is_unit(text: str) -> bool:
    """Whether a text is a unit that the parser knows.

    >>> is_unit("km/h"), is_unit("raw")
    (True, False)
    """
    try:
        _parsed(text)
    except UnitError:
        return False
    return True


def _number_and_unit(value: object, si: str, place: str = "") -> tuple[float, str]:
    """The parts of a quantity as written; the unit is empty if there is none. `place` begins the message."""
    match = _QUANTITY.fullmatch(value) if isinstance(value, str) and len(value) <= 2 * MAX_LENGTH else None
    if match is None:
        raise UnitError(f"{place}expected a number with a unit such as '1 {si}', got {_shown(value)}; correct it")
    if re.match(r",\d", match[2]):
        raise UnitError(
            f"{place}expected a decimal point, and no separator of thousands, got {_shown(value)}; correct it"
        )
    return float(match[1]), match[2]


def _shown(value: object) -> str:
    text = repr(value)
    return text if len(text) <= MAX_LENGTH else f"{text[:MAX_LENGTH]}..."


def _without_angle(dimension: Dimension) -> Dimension:
    return tuple(item for item in dimension if item[0] != "angle")


@lru_cache(maxsize=1024)
def _parsed(unit: str) -> tuple[float, Dimension]:
    """Size in SI units and dimension of a unit."""
    text = unit.strip().translate(_SUPERSCRIPTS)
    if not 0 < len(text) <= MAX_LENGTH:
        raise _unknown(unit)
    tokens, at = [], 0
    while at < len(text):
        match = _TOKEN.match(text, at)
        if match is None:
            raise _unknown(unit)
        tokens.append(match)
        at = match.end()
    size, powers, end = _product(tokens, 0, unit)
    if end < len(tokens):
        raise _unknown(unit)
    return size, tuple(sorted((name, power) for name, power in powers.items() if power))


def _product(tokens: list[re.Match[str]], at: int, unit: str) -> tuple[float, dict[str, int], int]:
    """Product of the factors from token `at` to the closing bracket or the end: size, powers, and the next token."""
    size, powers, sign, wants_factor = 1.0, dict[str, int](), 1, True
    while at < len(tokens):
        mark = tokens[at]["mark"]
        if mark == ")":
            break
        if mark in ("*", "·", ".", "/"):
            if wants_factor:
                raise _unknown(unit)
            sign, wants_factor = (-1 if mark == "/" else 1), True
            at += 1
            continue
        if mark == "(":
            inner_size, inner, at = _product(tokens, at + 1, unit)
            if at >= len(tokens):
                raise _unknown(unit)
        else:
            inner_size, inner = _power(tokens[at], unit)
        at += 1
        size = size * inner_size if sign > 0 else size / inner_size
        for name, power in inner.items():
            powers[name] = powers.get(name, 0) + sign * power
        sign, wants_factor = 1, False
    if wants_factor or not 0 < size < math.inf:
        raise _unknown(unit)
    return size, powers, at


def _power(token: re.Match[str], unit: str) -> tuple[float, dict[str, int]]:
    """One symbol with its power."""
    name, power = token["symbol"], int(token["power"] or 1)
    if abs(power) > MAX_POWER:
        raise _unknown(unit)
    if name in _SYMBOLS:
        size, powers = _SYMBOLS[name]
    elif name in _ALIASES:
        size, dimension = _parsed(_ALIASES[name])
        powers = dict(dimension)
    else:
        raise _unknown(unit)
    return size**power, {dimension: power * own for dimension, own in powers.items()}


def _unknown(unit: str) -> UnitError:
    return UnitError(f"expected a unit such as 'km/h', 'deg/s' or 'kN m/rad', got {_shown(unit)}")
