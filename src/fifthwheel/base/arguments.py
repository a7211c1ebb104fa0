"""Arguments of public functions: what is not of the expected type or range is refused, with the cure."""

import math
from collections.abc import Iterable, Mapping
from numbers import Integral, Real
from typing import Any

from fifthwheel.base.errors import FifthwheelError, SignalError, VehicleError, suggestion

CURES = {
    "Vehicle": "use fw.Vehicle.load(path), fw.vehicle(name) or result.vehicle",
    "Record": "use fw.read_log(path) for a file, fw.Record.from_table or fw.Record.from_arrays for data in memory",
    "Identification": "use the result of fw.identify, or fw.Identification.load(folder)",
    "Knowledge": "use result.knowledge, or fw.Knowledge.load(path)",
    "Occasion": "write fw.Occasion(trailer=...)",
    "LinearSystem": "use fw.linear_system(vehicle, speed)",
    "Real": "give a number",
    "Mapping": "write {name: value}",
    "SignalMap": "use fw.SignalMap.load(path)",
}
"""How to get an object of a class, by its name."""
ROAD_SPEEDS = 5.0, 40.0
"""Lowest and highest speed, m/s, at which a truck is simulated or assessed."""


def expect(name: str, value: object, *kinds: type) -> None:
    """Raise a FifthwheelError if an argument is not of one of these classes.

    >>> expect("name", 3, str)
    Traceback (most recent call last):
    fifthwheel.base.errors.SignalError: name: expected a str, got int; correct it
    """
    if isinstance(value, kinds):
        return
    got, expected = type(value).__name__, " or ".join(kind.__name__ for kind in kinds)
    article = "an" if expected[0] in "AEIOU" and not expected.startswith("One") else "a"
    cure = CURES.get(kinds[0].__name__, "correct it")
    if isinstance(value, type) and issubclass(value, kinds):
        got, cure = f"the class {value.__name__}", f"write {value.__name__}()"
    raise _error(kinds[0])(f"{name}: expected {article} {expected}, got {got}; {cure}")


def expect_optional(name: str, value: object, *kinds: type) -> None:
    """The same for an argument that may be None."""
    if value is not None:
        expect(name, value, *kinds)


def expect_each(name: str, values: Any, kind: type) -> None:
    """The same for every item of a list or tuple."""
    if not isinstance(values, list | tuple):
        alone = isinstance(values, kind)
        cure = f"write [{kind.__name__.lower()}]" if alone else CURES.get(kind.__name__, "give a list")
        got = f"{values.name if hasattr(values, 'name') else 'one'} alone" if alone else type(values).__name__
        raise _error(kind)(f"{name}: expected a list of {kind.__name__.lower()}s, got {got}; {cure}")
    for i, value in enumerate(values):
        expect(f"{name}[{i}]", value, kind)


def expect_names(name: str, values: Any) -> None:
    """The same for an iterable of texts, such as the names of signals; a text alone is not one."""
    if isinstance(values, str) or not isinstance(values, Iterable):
        cure = f"write [{values!r}]" if isinstance(values, str) else f"give the names, such as record.{name}"
        raise SignalError(f"{name}: expected a list of names, got {type(values).__name__}; {cure}")


def expect_known(name: str, given: Iterable[str], known: Iterable[str]) -> None:
    """Raise a SignalError for the first given name that is not known."""
    known = tuple(known)
    for key in given:
        if key not in known:
            raise SignalError(f"{name}, {key}: no such name; {suggestion(str(key), known)}")


def expect_sample(sample: Any) -> None:
    """Raise a SignalError if a live sample is not a mapping of names to numbers or None."""
    expect("sample", sample, Mapping)
    for name, value in sample.items():
        if not isinstance(value, Real | None):
            raise SignalError(f"sample, {name}: expected a number or None, got {value!r}; convert it")


def expect_number(
    name: str, value: object, *, ge: float = -math.inf, le: float = math.inf, unit: str = "", whole: bool = False
) -> None:
    """Raise a SignalError if an argument is not a finite number from `ge` to `le`."""
    kind, word = (Integral, "a whole number") if whole else (Real, "a number")
    if isinstance(value, kind) and not isinstance(value, bool) and math.isfinite(value) and ge <= float(value) <= le:
        return
    limits = "" if ge == -math.inf else f" from {ge:g} on" if le == math.inf else f" from {ge:g} to {le:g}"
    raise SignalError(f"{name}: expected {word}{unit and ' of '}{unit}{limits}, got {value!r}; correct it")


def expect_road_speed(speed: float) -> None:
    """Raise a SignalError if a speed, m/s, is not one of `ROAD_SPEEDS`."""
    expect("speed", speed, Real)
    low, high = ROAD_SPEEDS
    if not low <= speed <= high:
        raise SignalError(
            f"speed: expected {low:g} to {high:g} m/s ({3.6 * low:g} to {3.6 * high:g} km/h), got {speed:.4g} m/s"
            f" ({3.6 * speed:.4g} km/h); give a road speed"
        )


def _error(kind: type) -> type[FifthwheelError]:
    return VehicleError if kind.__name__ == "Vehicle" else SignalError
