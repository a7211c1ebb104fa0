"""The application that the commands join, with examples in their help and options made from settings."""

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import typer
from typer.core import TyperGroup

from fifthwheel.base.settings import Option, Settings, limits, options_of

COMMANDS = (
    *("vehicle", "weigh", "mass", "roll-test", "signals", "check", "design", "identify", "states", "compare"),
    *("assess", "evaluate", "validate", "verify", "knowledge", "live", "app", "fleet", "export", "simulate"),
    *("reproduce", "selfcheck"),
)
"""In the order of a user's way from a truck and a log to its states."""
_KEYWORD = inspect.Parameter.KEYWORD_ONLY


class _Commands(TyperGroup):
    """The commands in the order of a user's way."""

    def list_commands(self, ctx: Any) -> list[str]:
        return sorted(super().list_commands(ctx), key=COMMANDS.index)


class _Vehicles(TyperGroup):
    """Commands on vehicles; another word is the name of a vehicle of the catalogue."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        named = args if args[0] in self.commands or args[0].startswith("-") else ["catalogue", *args]
        return super().resolve_command(ctx, named)


app = typer.Typer(
    name="fifthwheel",
    cls=_Commands,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # its tables leave a third of a terminal for the help, and cut names
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Estimate parameters and states of articulated heavy vehicles from logged sensor signals.",
)


def _group(name: str, help: str, *, cls: type[TyperGroup] = TyperGroup, alone: bool = False) -> typer.Typer:
    """Commands below a word, which is a command of its own if it can stand `alone`."""
    group = typer.Typer(cls=cls, no_args_is_help=not alone, rich_markup_mode=None)
    app.add_typer(group, name=name, help=help, short_help=help)
    return group


export_app = _group("export", "Write an estimator or the model for other programs.")
fleet_app = _group("fleet", "Many trips of many trucks: identify, combine, follow changes.")
knowledge_app = _group("knowledge", "Knowledge of one truck from its logs: show, history, forget a log, merge.")
vehicle_app = _group(
    "vehicle",
    "List the catalogue of published vehicles, print one of them, or describe your own.",
    cls=_Vehicles,
    alone=True,
)


@dataclass(frozen=True)
class Only:
    """The settings that a command offers, where these are not all; metadata of the annotation of its parameter."""

    names: tuple[str, ...]


def command(*examples: str, of: typer.Typer = app) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Register a function as the command of its name; its help ends with the examples.

    A parameter whose annotation is a class of settings becomes the options of these settings.
    """
    epilog = "Examples:\n\n\b\n" + "\n".join(f"  {line}" for line in examples)

    def register(function: Callable[..., None]) -> Callable[..., None]:
        first = " ".join((function.__doc__ or "").partition("\n\n")[0].split())
        of.command(epilog=epilog, short_help=first)(_with_options(function))  # by default it is cut to one line
        return function

    return register


def _with_options(function: Callable[..., None]) -> Callable[..., None]:
    """The function with a parameter for each option of its settings."""
    parameters: list[inspect.Parameter] = []
    offered: dict[str, tuple[type[Settings], dict[str, Option]]] = {}
    for parameter in inspect.signature(function).parameters.values():
        kind, *only = get_args(parameter.annotation) or (parameter.annotation,)
        if not (isinstance(kind, type) and issubclass(kind, Settings)):
            parameters.append(parameter.replace(kind=_KEYWORD))
            continue
        known = options_of(kind)
        names = only[0].names if only else tuple(known)
        offered[parameter.name] = kind, {name: known[name] for name in names}
        parameters += [_parameter(kind, name, known[name]) for name in names]

    def run(**values: Any) -> None:
        for parameter, (kind, options) in offered.items():
            given = {name: _value(option, name, values.pop(name)) for name, option in options.items()}
            values[parameter] = kind(**{name: value for name, value in given.items() if value is not None})
        function(**values)

    run.__name__, run.__doc__, run.__module__ = function.__name__, function.__doc__, function.__module__
    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    return run


def _parameter(kind: type[Settings], name: str, option: Option) -> inspect.Parameter:
    """The parameter that typer reads for a setting."""
    hint, default, help = get_type_hints(kind)[name], getattr(kind, name), option.help
    if get_origin(hint) is tuple:
        hint, default = list[str] | None, None
        help += " May be repeated." if help.endswith(".") else "; may be repeated."
    elif option.unit:
        hint = str | None
    smallest, largest = limits(kind, name)
    info = typer.Option(
        *option.flags_of(name),
        help=help,
        min=option.smallest or smallest,
        max=largest,
    )
    return inspect.Parameter(name, _KEYWORD, default=default, annotation=Annotated[hint, info])


def _value(option: Option, name: str, value: Any) -> Any:
    """The value of a setting from that of typer; None for the default."""
    if isinstance(value, str) and option.unit:
        return quantity_option(option.flags_of(name)[0], value, option.unit, option.unit)
    return tuple(value) if isinstance(value, list) else value


def quantity_option(flag: str, text: str, si: str, usual: str) -> float:
    """The quantity that an option states, in SI; a number without a unit is in the usual one.

    Raises:
        SignalError: it is not such a quantity.
    """
    from fifthwheel.base.errors import SignalError, UnitError
    from fifthwheel.base.units import quantity

    try:
        return quantity(text if text[-1:].isalpha() else f"{text} {usual}", si)
    except UnitError as error:
        raise SignalError(f"{flag} {text}: {error}") from None
