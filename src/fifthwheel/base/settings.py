"""Settings: frozen data, validated when made; which of them are options of the command line and of the workbench."""

import ast
import inspect
import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import MISSING, asdict, dataclass, field, fields
from functools import cache, partial
from itertools import pairwise
from reprlib import repr as shorten
from textwrap import dedent, fill
from typing import Annotated, Any, NamedTuple, TypeVar, get_args, get_origin, get_type_hints

from fifthwheel.base.errors import SignalError

T = TypeVar("T")


@dataclass(frozen=True)
class Cure:
    """What to do where a setting is refused; metadata of its annotation."""

    text: str


@dataclass(frozen=True)
class Stored:
    """The form for JSON of a setting that is no plain data, such as an own function; metadata of its annotation."""

    form: Callable[[Any], Any]


class Limits(NamedTuple):
    """Numbers above gt, below lt, and of ge to le; metadata of the annotation of a number."""

    gt: float | None = None
    ge: float | None = None
    lt: float | None = None
    le: float | None = None

    def __repr__(self) -> str:
        return ", ".join(f"{name}={limit:g}" for name, limit in self._asdict().items() if limit is not None)

    def __get_pydantic_core_schema__(self, source: Any, handler: Callable[[Any], dict[str, Any]]) -> dict[str, Any]:
        return handler(source) | {name: limit for name, limit in self._asdict().items() if limit is not None}


Positive = Annotated[float, Limits(gt=0)]
NonNegative = Annotated[float, Limits(ge=0)]
Fraction = Annotated[float, Limits(gt=0, lt=1)]
FinitePositive = Annotated[float, Limits(gt=0, lt=math.inf)]
FiniteNonNegative = Annotated[float, Limits(ge=0, lt=math.inf)]
Finite = Annotated[float, Limits(gt=-math.inf, lt=math.inf)]
Count = Annotated[int, Limits(ge=1)]


@dataclass(frozen=True, kw_only=True)
class Option:
    """A setting that a user can choose; metadata of its annotation."""

    help: str
    flags: tuple[str, ...] = ()
    """On the command line; default: the name of the setting."""
    label: str = ""
    """In the workbench; default: the name of the setting."""
    choices: Mapping[str, str] = field(default_factory=dict, hash=False)
    """Words of the workbench for each choice."""
    smallest: float | None = None
    """That a front end accepts, where this is more than the limit of the setting."""
    unit: str = ""
    """SI unit of a quantity that the command line takes as a text, with any unit or in this one."""

    def flags_of(self, name: str) -> tuple[str, ...]:
        """On the command line, for the setting of this name."""
        return self.flags or (f"--{name.replace('_', '-')}",)


class _Made:
    """An attribute of a class, made from it when it is read."""

    def __init__(self, make: Callable[[Any], Any]) -> None:
        self.make = make

    def __get__(self, instance: object, kind: Any) -> Any:
        return self.make(kind)


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Base of all settings.

    Raises:
        SignalError: a value has another type or is outside its range; each line names a setting and the cure.
    """

    __signature__ = _Made(lambda kind: _signature(kind))

    def __init_subclass__(cls) -> None:
        type.__setattr__(cls, "__doc__", _Made(partial(_documentation, text=cls.__doc__)))

    def __post_init__(self) -> None:
        from pydantic import ValidationError  # slow to import, and not needed for the options in a help text

        kind: Any = type(self)
        given = {f.name: getattr(self, f.name) for f in fields(self)}
        listed = {name: _plain(value) for name, value in given.items()}
        try:
            valid = _model(kind).model_validate(listed)
        except ValidationError as error:
            hints = _hints(kind)
            raise SignalError("\n".join(_sentence(dict(e), hints[str(e["loc"][0])]) for e in error.errors())) from None
        for name in given:
            object.__setattr__(self, name, getattr(valid, name))

    def as_dict(self) -> dict[str, Any]:
        """All fields by name, for JSON."""
        kind: Any = type(self)
        found = {name: _metadata(hint, Stored) for name, hint in _hints(kind).items()}
        forms = {name: stored.form(getattr(self, name)) for name, stored in found.items() if stored}
        return asdict(self) | forms


def _plain(value: Any) -> Any:
    """A number of NumPy as one of Python, a list as a tuple."""
    is_number = hasattr(value, "dtype") and value.shape == ()
    return value.item() if is_number else tuple(value) if isinstance(value, list) else value


def options_of(kind: Any) -> dict[str, Option]:
    """The option of each setting that a user can choose, by its name."""
    found = {name: _metadata(hint, Option) for name, hint in _hints(kind).items()}
    return {name: option for name, option in found.items() if option is not None}


@cache
def meanings(kind: Any) -> dict[str, str]:
    """What each field of settings means: the text below it, else its help on the command line."""
    found = {name: option.help for name, option in options_of(kind).items()}
    for base in reversed(kind.__mro__[:-1]):
        try:
            (tree,) = ast.parse(dedent(inspect.getsource(base))).body
        except (OSError, TypeError):  # no source, such as in a frozen program
            continue
        for statement, text in pairwise(getattr(tree, "body", ())):
            match statement, text:
                case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(value=ast.Constant(value=str(sentences))):
                    found[name] = " ".join(sentences.split())
    return {f.name: found.get(f.name, "") for f in fields(kind)}


def shown(value: Any) -> str:
    """A value of a setting: a number without the digits of a conversion of units, other settings by their name."""
    if isinstance(value, Settings):
        return f"{type(value).__name__}()"
    if isinstance(value, tuple):
        return "(" + ", ".join(map(shown, value)) + ")"
    return f"{value:.4g}" if isinstance(value, float) and value < 1e4 else repr(value)


def _default(setting: Any) -> str:
    """The default of a field, shortened; "" if it has none."""
    value = setting.default if setting.default_factory is MISSING else setting.default_factory()
    text = "" if value is MISSING else shown(value)
    return text if len(text) < 60 else shorten(value)


def _signature(kind: Any) -> inspect.Signature:
    """Without the types, which would fill a screen with their limits and cures."""
    parameters = inspect.signature(kind.__init__).parameters.values()
    plain = [parameter.replace(annotation=inspect.Parameter.empty) for parameter in parameters]
    kind.__init__.__signature__ = inspect.Signature(plain)  # help() shows it too
    return inspect.Signature(plain[1:])


def _documentation(kind: Any, text: str | None) -> str | None:
    """A docstring with all fields before its sections."""
    if not text or "__match_args__" not in vars(kind):  # the decorator of dataclasses reads it before it sets this
        return text
    head, *sections = re.split(r"\n\n(?=[A-Z]\w+:\n)", inspect.cleandoc(text), maxsplit=1)
    defaults = {f.name: f" (default {default})" if (default := _default(f)) else "" for f in fields(kind)}
    entries = [f"    {name}{defaults[name]}: {meaning}" for name, meaning in meanings(kind).items()]
    lines = [fill(entry, width=110, subsequent_indent=8 * " ") for entry in entries]
    return "\n\n".join([head, "\n".join(["Args:", *lines]), *sections])


def limits(kind: Any, name: str) -> tuple[float | None, float | None]:
    """Smallest and largest number that a setting may be; None where it has no limit, or excludes it."""
    found = _metadata(_hints(kind)[name], Limits) or Limits()
    return found.ge, found.le


def arguments(settings: Settings) -> list[str]:
    """The options of the command line that state these settings."""
    words, kind = [], type(settings)
    for name, option in options_of(kind).items():
        value, flag = getattr(settings, name), option.flags_of(name)[0].split("/")
        if isinstance(value, tuple):
            words += [f"{flag[0]}={text}" for text in value]
        elif value != getattr(kind, name):
            words.append(flag[not value] if isinstance(value, bool) else f"{flag[0]}={value}")
    return words


@cache
def _hints(kind: Any) -> dict[str, Any]:
    hints = get_type_hints(kind, include_extras=True)
    return {f.name: hints[f.name] for f in fields(kind)}


@cache
def _model(kind: Any) -> Any:
    """Validates the fields of settings."""
    from pydantic import ConfigDict, create_model

    definitions: dict[str, Any] = {name: (hint, ...) for name, hint in _hints(kind).items()}
    return create_model(kind.__name__, __config__=ConfigDict(strict=True, protected_namespaces=()), **definitions)


def _metadata(hint: Any, kind: type[T]) -> T | None:
    """The first metadata of a type in an annotation."""
    return next((item for item in _all_metadata(hint) if isinstance(item, kind)), None)


def _all_metadata(hint: Any) -> Iterator[Any]:
    if get_origin(hint) is Annotated:
        yield from hint.__metadata__
        hint = hint.__origin__
    for part in get_args(hint):
        yield from _all_metadata(part)


def _sentence(error: Mapping[str, Any], hint: Any) -> str:
    """An error of pydantic as a sentence with the cure."""
    where = ", ".join(str(step) for step in error["loc"] if step != "[key]")
    if isinstance(error.get("ctx", {}).get("error"), SignalError):
        return f"{error['loc'][0]}, {error['ctx']['error']}" if len(error["loc"]) > 1 else str(error["ctx"]["error"])
    expected = error["msg"].removeprefix("Input should be ")
    if error["type"].startswith(("greater", "less", "float", "int_", "finite")):
        expected = _range(_metadata(hint, Limits) or Limits(), whole=error["type"].startswith("int_"))
    if error["type"] == "too_short":
        expected = "at least one value"
    cure = _metadata(hint, Cure)
    return f"{where}: expected {expected}, got {shorten(error['input'])}; {cure.text if cure else 'correct it'}"


def _range(limits: Limits, *, whole: bool) -> str:
    """The numbers within limits, in words."""
    gt, ge, lt, le = limits
    if ge is not None and (le is not None or lt not in (None, math.inf)):
        return f"between {ge:g} and {le if le is not None else lt:g}"
    words = [f"of {ge:g} or more"] if ge is not None else []
    words += [f"above {gt:g}"] if gt not in (None, -math.inf) else []
    words += [f"below {lt:g}"] if lt not in (None, math.inf) else []
    words += [f"at most {le:g}"] if le is not None else []
    noun = "a finite number" if math.inf in (lt, le) else "a whole number" if whole else "a number"
    return " ".join([noun, " and ".join(words)]).strip()
