"""The application that the commands join, with examples in their help."""

from collections.abc import Callable
from typing import Any

import typer
from typer.core import TyperGroup

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


fleet_app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode="markdown",
    help="Many trips of many trucks: identify, combine, follow changes.",
)
app.add_typer(fleet_app, name="fleet")


class _VehicleGroup(TyperGroup):
    """Commands on vehicles; another word is the name of a vehicle of the catalogue."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        named = args if args[0] in self.commands or args[0].startswith("-") else ["catalogue", *args]
        return super().resolve_command(ctx, named)


vehicle_app = typer.Typer(cls=_VehicleGroup, rich_markup_mode="markdown")
app.add_typer(vehicle_app, name="vehicle")


def command(*examples: str, of: typer.Typer = app) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Register a function as the command of its name; its help ends with the examples."""
    epilog = "**Examples**\n\n" + "\n\n".join(f"`{line}`" for line in examples)
    return of.command(epilog=epilog)
