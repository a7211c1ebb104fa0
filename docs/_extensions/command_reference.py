"""The command line reference, from the application itself."""

from collections.abc import Iterator
from enum import EnumMeta
from typing import Any

import typer
from sphinx.application import Sphinx

from fifthwheel.apps import cli


def reference() -> Iterator[str]:
    """Markdown of every command: what it does, its usage, its options and examples."""
    for name, command in commands(typer.main.get_command(cli.app)):
        arguments = [parameter for parameter in command.params if parameter.param_type_name == "argument"]
        options = [parameter for parameter in command.params if parameter.param_type_name == "option"]
        usage = " ".join(["fifthwheel", name, *map(usage_of, arguments), "[OPTIONS]"])
        yield f"## {name}\n\n{command.help}\n\n```sh\n{usage}\n```\n"
        if arguments:
            yield table("argument", [(f"`{(a.metavar or a.name).upper()}`", a.help or "", "") for a in arguments])
        yield table("option", [(flags(o), o.help or "", default(o)) for o in options])
        yield (command.epilog or "") + "\n"


def commands(group: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Every command with its name, those of a group after the name of the group."""
    for name, command in sorted(group.commands.items()):
        if hasattr(command, "commands"):
            yield from commands(command, f"{prefix}{name} ")
        else:
            yield prefix + name, command


def usage_of(argument: Any) -> str:
    name = (argument.metavar or argument.name).upper() + ("..." if argument.nargs != 1 else "")
    return name if argument.required else f"[{name}]"


def flags(option: Any) -> str:
    names = ", ".join(f"`{flag}`" for flag in (*option.opts, *option.secondary_opts))
    if option.is_flag:
        return names
    values = " or ".join(f"`{value}`" for value in choices(option))
    return f"{names} {values or (option.metavar or option.name).upper()}"


def choices(option: Any) -> list[str]:
    """Values of an option that is an enumeration; releases of typer keep the type in different places."""
    kind = option.type_descriptor.annotation if hasattr(option, "type_descriptor") else option.type
    values = kind if isinstance(kind, EnumMeta) else getattr(kind, "choices", ())
    return [str(getattr(value, "value", value)) for value in values]


def default(option: Any) -> str:
    value = getattr(option.default, "value", option.default)
    hidden = value in (None, False, (), []) or callable(value)
    return "" if hidden else f"`{value}`"


def table(kind: str, rows: list[tuple[str, str, str]]) -> str:
    lines = [f"| {kind} | meaning | default |", "|---|---|---|"]
    lines += ["| " + " | ".join(cell.replace("|", r"\|").replace("\n", " ") for cell in row) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def add_reference(app: Sphinx, document: str, source: list[str]) -> None:
    if document == "cli":
        source[0] += "\n" + "\n".join(reference())


def setup(app: Sphinx) -> dict[str, Any]:
    app.connect("source-read", add_reference)
    return {"parallel_read_safe": True}
