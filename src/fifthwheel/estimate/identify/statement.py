"""A statement on numbers, "33.4 t +- 0.5 %", "exact" or "free", by the pattern of their names; as texts and in SI."""

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from functools import lru_cache
from typing import Annotated, Literal

from pydantic import AfterValidator

from fifthwheel.base.errors import FifthwheelError, SignalError, VehicleError
from fifthwheel.base.names import ends_with
from fifthwheel.base.settings import Cure
from fifthwheel.base.units import split_statement, uncertain_quantity
from fifthwheel.data.channels import is_sensor_error
from fifthwheel.truck import toml_format
from fifthwheel.truck.quantities import BANK_VARIATION, FRICTION, ROAD_BANK, ROADS, TIME_BASE, quantity_of, unit_of

Kind = Literal["value", "sigma", "exact", "free"]

FORM = "'VALUE +- SIGMA', 'VALUE', '+- SIGMA', 'exact' or 'free', such as '33.4 t +- 0.5 %'"
_FREE = re.compile(r"(.*?)\s*\bfree\s*", re.DOTALL)

GROUPS: Mapping[str, str] = {
    "truck": "All numbers of the truck, its tyres and the model",
    "others": "All numbers of truck and road but the parameters of the result",
    "sensors": "All errors of the sensors and clocks",
}
"""Names of many numbers, which can only be exact, in words."""
OF_ROAD = (FRICTION, ROAD_BANK, BANK_VARIATION)


@dataclass(frozen=True, kw_only=True)
class Statement:
    """What a user states of the numbers that a pattern names. The texts have units."""

    name: str  # a path or its end, with * for any words; or one of `GROUPS`
    value: str | float = ""  # empty: that of the vehicle file, or the default. A number is in SI.
    sigma: str = ""  # of the kind "sigma": a standard deviation, with a unit or in per cent of the value
    kind: Kind = "value"
    """"value": the value alone, with the default uncertainty; "exact": sigma is 0; "free": a wide prior."""

    @property
    def text(self) -> str:
        """Without the name."""
        mark = {"value": "", "sigma": f"+- {self.sigma}"}.get(self.kind, self.kind)
        return f"{self.value} {mark}".strip()

    @property
    def given(self) -> str | float:
        """As a value of `Given`."""
        return self.value if isinstance(self.value, float) else self.text

    def __str__(self) -> str:
        """As in a command."""
        return f"{self.name}={self.text}"

    @property
    def rank(self) -> tuple[int, int]:
        """How specific it is: groups least, else by the letters of the pattern."""
        letters = len(self.name.replace("*", ""))
        return (1, 0) if self.name in GROUPS else (2 if letters else 0, letters)


@lru_cache(maxsize=4096)
def statement(name: str, text: str | float) -> Statement:
    """A statement from its text.

    Raises:
        FifthwheelError: the text has another form.

    >>> statement("semitrailer.mass", "31.2 t +- 0.5 %")
    Statement(name='semitrailer.mass', value='31.2 t', sigma='0.5 %', kind='sigma')
    >>> statement("tractor.cog", "free").kind
    'free'
    """
    if not isinstance(text, str):
        if not math.isfinite(text):
            raise SignalError(f"{name}: expected a finite number, got {text}; correct it")
        return Statement(name=name, value=float(text))
    if not name.strip() or not text.strip():
        raise SignalError(f"{name}={text}: expected a name and {FORM}; give both")
    if free := _FREE.fullmatch(text.strip()):
        found = Statement(name=name, value=free[1], kind="free")
    else:
        try:
            value, mark, sigma = split_statement(text.strip())
        except FifthwheelError as error:
            raise SignalError(f"{name}={text}: {error}") from None
        kind: Kind = "exact" if mark == "exact" else "sigma" if mark else "value"
        if kind == "sigma" and not sigma:
            raise SignalError(f"{name}={text}: expected a standard deviation behind '+-'; give it with a unit or in %")
        found = Statement(name=name, value=value, sigma=sigma, kind=kind)
    if found.rank < (2, 0) and (found.kind, found.value) != ("exact", ""):
        raise SignalError(f"{found}: expected 'exact' for so many numbers, got {found.text!r}; name fewer numbers")
    return found


def parse(text: str) -> Statement:
    """A statement from "NAME=STATEMENT"; a FifthwheelError if the text has another form."""
    name, _, stated = (part.strip() for part in text.partition("="))
    if not name or not stated:
        raise SignalError(f"{text}: expected NAME={FORM}")
    return statement(name, stated)


def _checked(given: Mapping[str, str | float]) -> Mapping[str, str | float]:
    for name, text in given.items():
        statement(name, text)
    return given


Given = Annotated[Mapping[str, str | float], Cure(f"give a number in SI, or a text: {FORM}"), AfterValidator(_checked)]
"""Statements by the pattern of the names."""


def combined(statements: Iterable[Statement]) -> dict[str, str | float]:
    """Statements as a mapping; a FifthwheelError where two on the same pattern disagree."""
    given: dict[str, str | float] = {}
    for each in statements:
        before = statement(each.name, given[each.name]) if each.name in given else each
        alone = {s.kind == "value" for s in (before, each)} == {True, False} and "" in (before.value, each.value)
        if alone:  # the value in one, sigma in the other
            value, spread = sorted((before, each), key=lambda s: s.kind != "value")
            each = replace(spread, value=value.value)
        elif before != each:
            raise disagreement(each.name, before, each)
        given[each.name] = each.given
    return given


def with_values(given: Mapping[str, str | float], values: Mapping[str, float]) -> dict[str, str | float]:
    """Statements with other values of some numbers, SI; what is stated of their uncertainty stays."""
    changed = dict(given)
    for name, value in values.items():
        spread = replace(statement(name, given[name]), value="").text if name in given else ""
        changed[name] = f"{toml_format.text(value, unit_of(name), None)} {spread}" if spread else value
    return changed


@dataclass(frozen=True, kw_only=True)
class Stated:
    """What is stated on one number, SI."""

    name: str
    value: float  # the default, if none is stated
    sigma: float | None = None  # None if it is not stated; 0 if the number is exact
    has_value: bool = False
    free: bool = False
    source: Statement | None = None

    @property
    def exact(self) -> bool:
        return self.sigma == 0

    def or_sigma(self, default: float) -> float:
        """sigma, or the default one."""
        return default if self.sigma is None else self.sigma


def stated(given: Mapping[str, str | float], name: str, si: str, value: float, *, reported: bool = False) -> Stated:
    """What is stated on a number: value and sigma each by the most specific statement that has one.

    `si` is its unit, `value` its default; `reported`: it is among the parameters of a result. A FifthwheelError: two
    statements that are equally specific disagree, or a unit does not fit.
    """
    if not given:
        return Stated(name=name, value=value)
    found = [s for s in (statement(*item) for item in given.items()) if applies(s, name, reported=reported)]
    if not value and si != "1" and not is_sensor_error(name):  # a fraction of 0 is 0
        found = [s for s in found if s.name == name or not s.sigma.endswith("%")]
    of_value = _most_specific(name, [s for s in found if s.value != ""], lambda s: _value(s, name, si))
    value = of_value[1] if of_value else value
    of_sigma = _most_specific(name, [s for s in found if s.kind != "value"], lambda s: _sigma(s, name, si, value))
    sigma = of_sigma[1] if of_sigma else None
    if of_value and sigma is None and _is_road(of_value[0]):
        sigma = ROADS[str(of_value[0].value)].sigma * value
    source = (of_sigma or of_value or (None,))[0]
    return Stated(
        name=name,
        value=value,
        sigma=None if sigma == _WIDE else sigma,
        has_value=of_value is not None,
        free=sigma == _WIDE,
        source=source,
    )


def states_sigma(given: Mapping[str, str | float], name: str) -> bool:
    """Whether it is stated how uncertain a number is, other than that it is exact."""
    found = (statement(*item) for item in given.items())
    return any(s.kind in ("sigma", "free") and applies(s, name) for s in found)


def applies(found: Statement, name: str, *, reported: bool = False) -> bool:
    """Whether a statement names a number."""
    of_sensor, of_road = is_sensor_error(name) or name.startswith(TIME_BASE), name in OF_ROAD
    if found.name == "sensors":
        return of_sensor
    if found.name in GROUPS:
        return not of_sensor and not (of_road if found.name == "truck" else reported)
    return _matches(name, found.name)


@lru_cache(maxsize=65536)
def _matches(name: str, pattern: str) -> bool:
    if "*" not in pattern:
        return ends_with(name, pattern)
    return fnmatchcase(name, pattern) or fnmatchcase(name, f"*.{pattern}")


def _most_specific(
    name: str, found: Sequence[Statement], number: Callable[[Statement], float]
) -> tuple[Statement, float] | None:
    """The most specific statement and its number; a VehicleError where equally specific ones disagree."""
    if not found:
        return None
    rank = max(s.rank for s in found)
    first, *others = [s for s in found if s.rank == rank]
    chosen = number(first)
    for other in others:
        if abs(number(other) - chosen) > 1e-9 * abs(chosen):
            raise disagreement(name, first, other)
    return first, chosen


def disagreement(name: str, first: Statement, other: Statement) -> VehicleError:
    return VehicleError(f"{name}: expected one statement, got '{first}' and '{other}'; remove one")


_WIDE = -1.0
"""Stands for the sigma of a number that is free."""


def _is_road(found: Statement) -> bool:
    """Whether the value is a kind of road."""
    return ends_with(FRICTION, found.name) and found.value in ROADS


def _value(found: Statement, name: str, si: str) -> float:
    """The stated value, SI."""
    if isinstance(found.value, float):
        return found.value
    if _is_road(found):
        return ROADS[found.value].value
    try:
        return uncertain_quantity(found.value, si, strict=True, unit_needed=si != "1")[0]
    except FifthwheelError as error:
        if name == FRICTION:
            expected = f"expected a number or one of {', '.join(ROADS)}, got {found.value!r}; give one of them"
            raise VehicleError(f"{found}: {expected}") from None
        cure = "" if ";" in str(error) else f"; give the value in {si}" if si != "1" else "; give a number"
        raise VehicleError(f"{found}: {error}{cure}") from None


def _sigma(found: Statement, name: str, si: str, value: float) -> float:
    """The stated standard deviation, SI."""
    if found.kind in ("exact", "free"):
        return 0.0 if found.kind == "exact" else _WIDE
    base = 1.0 if not value and si == "1" and found.sigma.endswith("%") and not is_sensor_error(name) else value
    try:
        text = f"{base!r} +- {found.sigma}" if si == "1" else f"{base!r} {si} +- {found.sigma}"
        return float(uncertain_quantity(text, si, strict=True)[1] or 0.0)
    except FifthwheelError as error:
        raise VehicleError(f"{found}: {name}: {error}") from None


def refused(found: Stated, reason: str) -> VehicleError:
    return VehicleError(f"{found.source}: {found.name}: {reason}")


def prior_of(given: Mapping[str, str | float], name: str) -> tuple[float, float]:
    """Prior mean and standard deviation, SI, of a number that no vehicle file has, as stated or by its row."""
    row = quantity_of(name)
    found = stated(given, name, row.unit, row.mean or 0.0)
    if found.free:
        raise refused(found, "is estimated already; give its standard deviation")
    return found.value, found.or_sigma(row.sigma)
