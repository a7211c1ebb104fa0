"""The application that the commands join, with examples in their help and former names of their options."""

from collections.abc import Callable
from typing import Any

import typer
from typer.core import TyperCommand

app = typer.Typer(
    name="fifthwheel",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Estimate parameters and states of articulated heavy vehicles from logged sensor signals.",
)

export_app = typer.Typer(
    no_args_is_help=True, rich_markup_mode="markdown", help="Write an estimator in another language."
)
app.add_typer(export_app, name="export")

RENAMED_OPTIONS = {"--hold": "--fix", "--want": "--target"}
"""Former name of an option -> its name. Remove the former names in the next version."""


class CommandWithFormerNames(TyperCommand):
    """A command that accepts the former names of its options, with a warning."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse arguments in which former names are replaced."""
        own = {name for parameter in self.params for name in parameter.opts}
        return super().parse_args(ctx, [_present_name(argument, own) for argument in args])


def command(*examples: str, of: typer.Typer = app) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Register a function as the command of its name; its help ends with the examples."""
    epilog = "**Examples**\n\n" + "\n\n".join(f"`{line}`" for line in examples)
    return of.command(cls=CommandWithFormerNames, epilog=epilog)


def _present_name(argument: str, own: set[str]) -> str:
    """An argument with the present name of its option, if the command has it."""
    former, equals, value = argument.partition("=")
    present = RENAMED_OPTIONS.get(former)
    if present not in own:
        return argument
    typer.echo(f"warning: {former} is now called {present}; use {present}, the next version removes {former}", err=True)
    return f"{present}{equals}{value}"
