"""Base of all components of a vehicle: immutable, keyword-only, finite, with errors that name the path and the cure."""

import math
from collections.abc import Iterable, Iterator, Mapping
from reprlib import repr as shorten
from types import UnionType
from typing import Annotated, Any, ClassVar, TypeVar, Union, get_args, get_origin

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from fifthwheel.base.errors import VehicleError, suggestion
from fifthwheel.truck.quantities import UNITS, Quantity, register

Number = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]


V = TypeVar("V")
NOTHING_KNOWN = Quantity()


class HashableDict(dict[str, V]):
    """A dictionary in a frozen component, not to be altered."""

    def __hash__(self) -> int:  # type: ignore[override]
        return hash(frozenset(self.items()))


NonNegatives = Annotated[Mapping[str, NonNegative], AfterValidator(HashableDict)]
"""Numbers >= 0 by name."""
Texts = Annotated[Mapping[str, str], AfterValidator(HashableDict)]
"""Texts by name."""


def number(
    unit: str,
    description: str,
    row: Quantity = NOTHING_KNOWN,
    *,
    plausible: tuple[float, float] | None = None,
    **limits: Any,
) -> Any:
    """A field that is a parameter: a number with a path, and what is known of it where nobody states more.

    Its SI unit is the same wherever a component has this key; default and limits are those of `pydantic.Field`. A
    number that has no lower limit, or one below 0, may be 0 or negative. A vehicle file with a number outside
    `plausible` is refused: no road vehicle has it, heavy haulage included. Estimates and samples of Monte Carlo studies
    may be outside.
    """
    extra: dict[str, Any] = {"unit": unit, "plausible": plausible, "row": row}
    return Field(description=description, json_schema_extra=extra, **limits)


class Component(BaseModel):
    """A component of a vehicle. Each of its numbers is a parameter of the vehicle; see `number`.

    Raises:
        VehicleError: a value is not valid; each line of the message names the path from the outermost named component.
        TypeError: a class has a number without a unit.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", validate_default=True)
    owner: ClassVar[str] = ""
    """Last word of the path of such a component, if it decides what is known of its numbers."""
    si_units: ClassVar[Mapping[str, str]]
    """SI unit of each number by its key."""
    plausible: ClassVar[Mapping[str, tuple[float, float]]]
    """Range of the numbers of road vehicles by key, SI."""
    ranges: ClassVar[Mapping[str, tuple[float, float]]]
    """The same within the limits of the fields, for every number."""

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        extras = {key: field.json_schema_extra for key, field in cls.model_fields.items()}
        numbers: dict[str, Any] = {key: extra for key, extra in extras.items() if isinstance(extra, dict)}
        cls.si_units = {key: extra["unit"] for key, extra in numbers.items()}
        cls.plausible = {key: extra["plausible"] for key, extra in numbers.items() if extra["plausible"]}
        anything = (-math.inf, math.inf)
        limits = {key: [*field.metadata, *_nested(field.annotation)] for key, field in cls.model_fields.items()}
        cls.ranges = {key: _range(limits[key], cls.plausible.get(key, anything)) for key in cls.si_units}
        for key, field in cls.model_fields.items():
            if _is_number(field.annotation) != (key in cls.si_units):
                raise TypeError(f"{cls.__name__}.{key}: a number, and only a number, has a unit; use `number`")
        for key, number in numbers.items():
            lowest = _range(limits[key], anything)[0]
            row = number["row"]._replace(unit=number["unit"], signed=lowest < 0)
            register(f"{cls.owner}.{key}".lstrip("."), row)

    def __init__(self, **data: Any) -> None:
        try:
            super().__init__(**data)
        except ValidationError as error:
            raise VehicleError(_message(error, self._prefix(data), type(self).model_fields)) from None

    @classmethod
    def require_plausible(cls, key: str, value: float, *, path: str, written: object) -> None:
        """Raise a VehicleError where a number that the user states, SI, is outside the range of road vehicles; the
        message has its path, and the value as `written`."""
        low, high = cls.plausible.get(key, (-math.inf, math.inf))
        if not low <= value <= high:
            unit = "" if cls.si_units[key] == "1" else f" {cls.si_units[key]}"
            raise VehicleError(
                f"{path}: expected {low:g} to {high:g}{unit}, the range of road vehicles, got {written}; check the"
                " number and its unit"
            )

    @classmethod
    def _prefix(cls, data: dict[str, Any]) -> str:
        """Beginning of the paths of this component: its name and a dot."""
        name = data.get("name")
        return f"{name}." if isinstance(name, str) else ""


def _range(limits: Iterable[Any], plausible: tuple[float, float]) -> tuple[float, float]:
    """Lowest and highest number within the limits of a field and a plausible range; a limit may be excluded."""
    low, high = plausible
    for limit in limits:
        low = max(low, getattr(limit, "ge", low), getattr(limit, "gt", low))
        high = min(high, getattr(limit, "le", high), getattr(limit, "lt", high))
    return low, high


def _nested(annotation: Any) -> Iterator[Any]:
    """The limits of the numbers in an annotation such as `Positive | None`."""
    for part in get_args(annotation):
        yield from getattr(part, "metadata", ())
        yield from _nested(part)


def _is_number(annotation: Any) -> bool:
    if get_origin(annotation) is Annotated:
        return _is_number(get_args(annotation)[0])
    if get_origin(annotation) in (Union, UnionType):
        return any(map(_is_number, get_args(annotation)))
    return annotation is float


_EXPECTED = {
    "greater_than": "a number > {gt:g}",
    "greater_than_equal": "a number >= {ge:g}",
    "less_than_equal": "a number <= {le:g}",
    "finite_number": "a finite number",
    **dict.fromkeys(("float_type", "float_parsing"), "a number"),
    "string_pattern_mismatch": "a name of lower-case letters, digits and _, a letter first",
}
"""In a message, by the type of an error of pydantic and with its context."""


def _message(error: ValidationError, prefix: str, keys: Iterable[str]) -> str:
    """One line for each invalid value: path, expected, got, cure."""
    lines = []
    invalid = {e["loc"][:1] for e in error.errors() if e["type"] == "value_error"}
    for e in error.errors():
        path, context, value = _path(e["loc"]), e.get("ctx", {}), e["input"]
        match e["type"]:
            case "value_error" if isinstance(context.get("error"), VehicleError):
                nameless = e["loc"] and isinstance(e["loc"][-1], str)  # such as sprung
                outer = "" if e["loc"][:1] == ("axles",) else prefix  # the path of an axle does not contain its group
                lines.append(f"{outer}{path}.{context['error']}" if nameless else f"{outer}{context['error']}")
                continue
            case "too_short" if e["loc"] in invalid:
                continue  # the element that is missing is the invalid one, which has its own line
            case "too_long":
                expected, value = f"at most {context['max_length']}", context["actual_length"]
            case "missing":
                cure = "give it, or give the unit a class" if e["loc"][-1] in UNITS else "give it"
                lines.append(f"{prefix}{path}: expected a value, got none; {cure}")
                continue
            case "extra_forbidden":
                lines.append(f"{prefix}{path}: no such key; {suggestion(str(e['loc'][-1]), keys)}")
                continue
            case kind:
                expected = _EXPECTED.get(kind, "{msg}").format(**context, msg=e["msg"].removeprefix("Input should be "))
        cure = "check its unit" if e["type"] == "less_than_equal" or context.get("ge") else "correct it"
        lines.append(f"{prefix}{path}: expected {expected}, got {shorten(value)}; {cure}")
    return "\n".join(lines)


def _path(location: tuple[str | int, ...]) -> str:
    return "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in location).removeprefix(".")
