"""Units: a short table of what truck logs are written in; pint, slow to load, only for the rest."""

import math
import re
from functools import cache

from fifthwheel.errors import SignalError

_DEG = math.pi / 180
_G = 9.80665
_TABLE: dict[str, dict[str, float]] = {
    "s": {"s": 1, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9, "min": 60, "h": 3600},
    "m": {"m": 1, "mm": 1e-3, "cm": 1e-2, "km": 1e3, "ft": 0.3048, "in": 0.0254},
    "m/s": {"m/s": 1, "km/h": 1 / 3.6, "kph": 1 / 3.6, "mph": 0.44704, "mm/s": 1e-3, "ft/s": 0.3048},
    "m/s^2": {"m/s^2": 1, "g": _G, "mg": _G * 1e-3, "mm/s^2": 1e-3, "ft/s^2": 0.3048},
    "rad": {"rad": 1, "deg": _DEG, "mrad": 1e-3},
    "rad/s": {"rad/s": 1, "deg/s": _DEG, "mrad/s": 1e-3},
    "rad/s^2": {"rad/s^2": 1, "deg/s^2": _DEG},
    "N": {"N": 1, "kN": 1e3, "daN": 10, "kg": _G, "t": _G * 1e3, "lbf": 4.4482216152605},
    "Hz": {"Hz": 1, "kHz": 1e3},
    "1": {"1": 1, "%": 1e-2},
    "1/m": {"1/m": 1, "1/km": 1e-3},
}
_SPELLING = (("**", "^"), ("²", "^2"), ("s2", "s^2"), ("degrees", "deg"), ("°", "deg"), ("sec", "s"), ("kmh", "km/h"))
_OTHERS = {
    "-",
    "bar",
    "mbar",
    "Pa",
    "kPa",
    "MPa",
    "V",
    "mV",
    "A",
    "mA",
    "degC",
    "C",
    "K",
    "rpm",
    "1/min",
    "Nm",
    "W",
    "kW",
    "l",
    "bit",
}
"""Spellings of units that are known for such, though no signal is in them."""
_QUANTITY = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*")


@cache
def factor(unit: str, si: str) -> float:
    """What a value in `unit` is multiplied by to be in the SI unit `si`: factor("deg/s", "rad/s") = 0.01745..."""
    spelt = _spelt(unit)
    if spelt in _TABLE[si]:
        return float(_TABLE[si][spelt])
    if any(spelt in units for units in _TABLE.values()):
        raise SignalError(f"unit {unit!r} does not fit: expected one of {', '.join(_TABLE[si])}")
    return _by_pint(unit, si)


def is_unit(text: str) -> bool:
    """Whether a text is a unit as logs write them."""
    spelt = _spelt(text)
    return spelt in _OTHERS or any(spelt in units for units in _TABLE.values())


def _spelt(unit: str) -> str:
    spelt = unit.strip()
    for other, ours in _SPELLING:
        spelt = spelt.replace(other, ours)
    return spelt


def quantity(value: float | str, si: str) -> float:
    """A number already in the SI unit, or a text with its unit: quantity("200 ms", "s") = 0.2."""
    if not isinstance(value, str):
        return float(value)
    match = _QUANTITY.fullmatch(value)
    if match is None:
        raise SignalError(f"{value!r} is not a number with a unit; expected something like '0.2 {si}'")
    return float(match[1]) * (factor(match[2], si) if match[2] else 1.0)


def _by_pint(unit: str, si: str) -> float:
    """The same by pint, for units the table does not hold (0.2 s the first time)."""
    import pint

    try:
        registry = pint.application_registry
        return float(registry.Quantity(1.0, unit).to("" if si == "1" else si).magnitude)
    except Exception as error:  # pint raises its own, and those of its parser and of Python's tokenizer
        raise SignalError(f"unit {unit!r} is not known here; expected one of {', '.join(_TABLE[si])}") from error
