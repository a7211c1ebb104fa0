"""The application that the commands join, with examples in their help."""

from collections.abc import Callable

import typer

app = typer.Typer(
    name="fifthwheel",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Estimate parameters and states of articulated heavy vehicles from logged sensor signals.",
)

export_app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode="markdown",
    help="Write an estimator or the model for other programs.",
)
app.add_typer(export_app, name="export")


def command(*examples: str, of: typer.Typer = app) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Register a function as the command of its name; its help ends with the examples."""
    epilog = "**Examples**\n\n" + "\n\n".join(f"`{line}`" for line in examples)
    return of.command(epilog=epilog)
