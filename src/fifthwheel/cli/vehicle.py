"""fifthwheel vehicle"""

from typing import Annotated

import typer

from fifthwheel.cli.app import command
from fifthwheel.cli.options import JsonOption
from fifthwheel.cli.terminal import print_json


@command("fifthwheel vehicle", "fifthwheel vehicle cheng_cebon_2011 > truck.toml", "fifthwheel vehicle --json")
def vehicle(
    name: Annotated[str | None, typer.Argument(help="A vehicle of the catalogue. Default: list them.")] = None,
    as_json: JsonOption = False,
) -> None:
    """List the catalogue of published vehicles, or print one as a vehicle file.

    With --json, a vehicle is printed as its parameters in SI by their paths.
    """
    from fifthwheel.vehicle import catalogue

    if name is None:
        sources = {entry: catalogue.get(entry).source for entry in catalogue.names()}
        if as_json:
            print_json({"vehicles": [{"name": entry, "source": source} for entry, source in sources.items()]})
        else:
            typer.echo("\n".join(f"{entry:24s} {source}" for entry, source in sources.items()))
    elif as_json:
        truck = catalogue.get(name)
        print_json({"name": name, "source": truck.source, "parameters": truck.parameters()})
    else:
        typer.echo(catalogue.text(name), nl=False)
