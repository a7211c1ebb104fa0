"""How the front end in use spells a setting: an argument in Python, an option of the command line, or a question of the
workbench.

Messages and reports name settings by `setting`, so that each reader gets the words of the program in front of them.
"""

import shlex
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache
from typing import Literal

from fifthwheel.base.options import IdentifyOptions, TruckOptions
from fifthwheel.base.settings import Option, options_of

FrontEnd = Literal["python", "command line", "workbench"]
ONLY_PREDICT, NAME_OF_RESULT = "Only predict", "Name of the result"
"""Questions of the workbench that are no options of an identification."""
_front_end: ContextVar[FrontEnd] = ContextVar("front_end", default="python")


@dataclass(frozen=True, kw_only=True)
class _Spelling:
    """Of one setting in each front end; empty where the front end does not have it."""

    argument: str
    flag: str
    question: str = ""
    option: Option | None = None
    """With the words of the workbench for its choices."""


_OTHERS = {
    "accuracy": _Spelling(argument="accuracy", flag="--accuracy"),
    "allow_outside": _Spelling(argument="allow_outside=True", flag="--allow-outside"),
    "body": _Spelling(argument="body", flag="--body"),
    "changes": _Spelling(argument="changes", flag="--set"),
    "everything": _Spelling(argument="everything=True", flag="--all"),
    "figures": _Spelling(argument="figures", flag="--figures"),
    "folders": _Spelling(argument="folders", flag="--files"),
    "force": _Spelling(argument="force=True", flag="--force", question="Delete"),
    "identification": _Spelling(argument="identification", flag="--identification"),
    "max_speed": _Spelling(argument="max_speed", flag="--max-speed"),
    "model": _Spelling(argument="", flag="--model"),
    "out": _Spelling(argument="out", flag="--out", question=NAME_OF_RESULT),
    "target": _Spelling(argument="targets", flag="--target"),
    "validate": _Spelling(argument="validate", flag="--validate", question=ONLY_PREDICT),
    "vehicle": _Spelling(argument="vehicle", flag="--vehicle", question="Vehicle file"),
}
"""Settings that are no fields of `IdentifyOptions` or `TruckOptions`."""
_ARGUMENTS = {"statements": "given", "load": "Occasion(load=...)"}
"""Arguments of Python whose name is not that of the setting."""
_COMMANDS = {"signals": "“Propose a map”", "vehicle show": "the page Truck"}
"""What the workbench has in place of a command."""


@contextmanager
def spelled_for(front_end: FrontEnd) -> Iterator[None]:
    """Spell settings for a front end in the block, also in coroutines and threads of asyncio that start there."""
    token = _front_end.set(front_end)
    try:
        yield
    finally:
        _front_end.reset(token)


def start_front_end(front_end: FrontEnd) -> None:
    """Spell settings for a front end from now on: where a process starts that serves no other one."""
    _front_end.set(front_end)


def front_end() -> FrontEnd:
    """The front end in use."""
    return _front_end.get()


def question(name: str, option: Option) -> str:
    """The question of the workbench for a setting."""
    return option.label or name.replace("_", " ").capitalize()


def setting(name: str, *values: str) -> str:
    """A setting as the front end in use spells it, with its value or values; empty if the front end lacks it.

    Args:
        name: field of `IdentifyOptions` or `TruckOptions`, or another setting that a message names.
        values: for the command line; a statement is NAME=STATEMENT.

    Example:
        >>> setting("tyres", "saturating"), setting("statements", "steer.*.delay=+- 5 ms")
        ('tyres="saturating"', 'given={"steer.*.delay": "+- 5 ms"}')
        >>> with spelled_for("command line"):
        ...     setting("tyres", "saturating"), setting("statements", "steer.*.delay=+- 5 ms")
        ('--tyres saturating', "--set 'steer.*.delay=+- 5 ms'")
        >>> with spelled_for("workbench"):
        ...     setting("tyres", "linear"), setting("statements")
        ('“Tyres”: “Linear, with an unknown softening”', '“State a number”')
    """
    spelling = _spellings()[name]
    match _front_end.get():
        case "python":
            return _argument(spelling.argument, values)
        case "command line":
            return " ".join(f"{spelling.flag} {_quoted(value)}" for value in values) or spelling.flag
        case "workbench":
            choices = spelling.option.choices if spelling.option else {}
            answers = ", ".join(f"“{choices[value]}”" if value in choices else value for value in values)
            return f"“{spelling.question}”{': ' * bool(answers)}{answers}" if spelling.question else ""


def command(words: str) -> str:
    """A command in a sentence, such as "`fifthwheel signals`", or what the workbench has in its place."""
    return _COMMANDS[words] if _front_end.get() == "workbench" else f"`fifthwheel {words}`"


@cache
def _spellings() -> dict[str, _Spelling]:
    found = dict(_OTHERS)
    for kind in (TruckOptions, IdentifyOptions):
        for name, option in options_of(kind).items():
            text = option.label or (option.help.removesuffix(".") if kind is TruckOptions else question(name, option))
            found[name] = _Spelling(
                argument=_ARGUMENTS.get(name, name),
                flag=option.flags_of(name)[0].partition("/")[0],
                question=text.partition(";")[0].partition(":")[0],
                option=option,
            )
    return found


def _argument(argument: str, values: tuple[str, ...]) -> str:
    if not values or not argument:
        return argument
    if argument == "given":
        pairs = (value.partition("=") for value in values)
        return "given={" + ", ".join(f'"{name}": "{statement}"' for name, _, statement in pairs) + "}"
    text = f'"{values[0].replace("-", "_")}"'  # Python has "prediction_error" where the command line has a hyphen
    return argument.replace("...", text) if "..." in argument else f"{argument}={text}"


def _quoted(value: str) -> str:
    """A value for a shell; of NAME=STATEMENT only the statement has quotes, unless the name needs them too."""
    name, equals, statement = value.partition("=")
    return name + equals + shlex.quote(statement) if equals and shlex.quote(name) == name else shlex.quote(value)
