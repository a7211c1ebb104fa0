"""A statement of a user on a number, "33.4 t +- 0.5 %", "exact" or "free", as a text and in SI."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from fifthwheel.errors import FifthwheelError, VehicleError
from fifthwheel.identify.settings import MODEL_ERROR_UNITS, MODEL_ERRORS
from fifthwheel.names import ends_with
from fifthwheel.units import split_statement, uncertain_quantity
from fifthwheel.vehicle.parameters import FRICTION, ROADS

Kind = Literal["value", "sigma", "exact", "free"]

FORM = "NAME='VALUE +- SIGMA', 'VALUE', '+- SIGMA', 'exact' or 'free', such as semitrailer.mass='33.4 t +- 0.5 %'"
_FREE = re.compile(r"(.*?)\s*\bfree\s*", re.DOTALL)


@dataclass(frozen=True, kw_only=True)
class Statement:
    """What a user states of a number. The texts have units; a name may be the end of several paths."""

    name: str
    value: str = ""
    """Empty: that of the vehicle file, or the default."""
    sigma: str = ""
    """Of the kind "sigma": a standard deviation, with a unit or in per cent of the value."""
    kind: Kind = "value"
    """"value": the value alone, with the default uncertainty; "exact": sigma is 0; "free": a wide prior."""

    def __str__(self) -> str:
        """As in a command."""
        mark = {"value": "", "sigma": f"+- {self.sigma}"}.get(self.kind, self.kind)
        return f"{self.name}={f'{self.value} {mark}'.strip()}"


def parse(text: str) -> Statement:
    """A statement from "NAME=VALUE +- SIGMA".

    Raises:
        FifthwheelError: the text has another form.

    >>> parse("semitrailer.mass=31.2 t +- 0.5 %")
    Statement(name='semitrailer.mass', value='31.2 t', sigma='0.5 %', kind='sigma')
    >>> parse("tractor.cog=free").kind
    'free'
    """
    name, _, stated = (part.strip() for part in text.partition("="))
    if not name or not stated:
        raise FifthwheelError(f"--set {text}: expected {FORM}")
    if free := _FREE.fullmatch(stated):
        return Statement(name=name, value=free[1], kind="free")
    try:
        value, mark, sigma = split_statement(stated)
    except FifthwheelError as error:
        raise FifthwheelError(f"--set {text}: {error}") from None
    kind: Kind = "exact" if mark == "exact" else "sigma" if mark else "value"
    if kind == "sigma" and not sigma:
        raise FifthwheelError(f"--set {text}: expected a standard deviation behind '+-'; give it with a unit or in %")
    return Statement(name=name, value=value, sigma=sigma, kind=kind)


@dataclass(frozen=True, kw_only=True)
class Stated:
    """All statements on one number, resolved, SI."""

    name: str
    value: float
    has_value: bool
    """Whether the value is stated."""
    sigma: float | None
    """None if it is not stated."""
    free: bool
    source: Statement

    @property
    def relative(self) -> float:
        """sigma as a fraction of the value; a VehicleError if the value is not above 0."""
        if self.value <= 0:
            raise refused(self, f"expected a value above 0 for an estimated number, got {self.value:g}; correct it")
        return (self.sigma or 0.0) / self.value


_WIDE = -1.0
"""Stands for the sigma of a number that is free."""


def resolved(name: str, si: str, value: float, statements: Sequence[Statement]) -> Stated:
    """The statements on one number as one; a FifthwheelError where they disagree or a unit does not fit."""
    found = [(_quantity(s, si), s) for s in statements if s.value]
    _require_same(name, found)
    value = found[0][0] if found else value
    sigmas = [(_sigma(s, si, value), s) for s in statements if s.kind != "value"]
    _require_same(name, sigmas)
    sigma = sigmas[0][0] if sigmas else None
    if found and sigma is None and _is_road(found[0][1]):
        sigma = ROADS[found[0][1].value].sigma * value
    return Stated(
        name=name,
        value=value,
        has_value=bool(found),
        sigma=None if sigma == _WIDE else sigma,
        free=sigma == _WIDE,
        source=(sigmas or found)[0][1],
    )


def _is_road(statement: Statement) -> bool:
    """Whether the value is a kind of road."""
    return ends_with(FRICTION, statement.name) and statement.value in ROADS


def _quantity(statement: Statement, si: str) -> float:
    """The stated value, SI."""
    if _is_road(statement):
        return ROADS[statement.value].value
    try:
        return uncertain_quantity(statement.value, si, strict=True, unit_needed=si != "1")[0]
    except FifthwheelError as error:
        if ends_with(FRICTION, statement.name):
            expected = f"expected a number or one of {', '.join(ROADS)}, got {statement.value!r}; give one of them"
            raise VehicleError(f"--set {statement}: {expected}") from None
        cure = "" if ";" in str(error) else f"; give the value in {si}" if si != "1" else "; give a number"
        raise VehicleError(f"--set {statement}: {error}{cure}") from None


def _sigma(statement: Statement, si: str, value: float) -> float:
    """The stated standard deviation, SI."""
    if statement.kind in ("exact", "free"):
        return 0.0 if statement.kind == "exact" else _WIDE
    fraction = statement.name in {*MODEL_ERRORS} - {*MODEL_ERROR_UNITS} and statement.sigma.endswith("%")
    base = "1" if fraction else f"{value!r} {si}" if si != "1" else repr(value)
    try:
        return float(uncertain_quantity(f"{base} +- {statement.sigma}", si, strict=True)[1] or 0.0)
    except FifthwheelError as error:
        raise VehicleError(f"--set {statement}: {error}") from None


def _require_same(name: str, stated: Sequence[tuple[float, Statement]]) -> None:
    """Refuse statements on one number that disagree."""
    for number, statement in stated[1:]:
        if abs(number - stated[0][0]) > 1e-9 * abs(number):
            raise VehicleError(
                f"{name}: expected one statement, got --set '{stated[0][1]}' and --set '{statement}'; remove one"
            )


def refused(stated: Stated, reason: str) -> VehicleError:
    return VehicleError(f"--set {stated.source}: {stated.name}: {reason}")
