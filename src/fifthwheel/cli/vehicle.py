"""fifthwheel vehicle"""

from typing import Annotated

import typer

from fifthwheel.cli.app import app, example


@app.command(epilog=example("fifthwheel vehicle", "fifthwheel vehicle cheng_cebon_2011 > truck.toml"))
def vehicle(
    name: Annotated[str | None, typer.Argument(help="One of the catalogue; lists them if left out.")] = None,
) -> None:
    """The catalogue of published trucks: list them, or print one as a TOML file to start from."""
    from fifthwheel.vehicle import catalogue

    if name is None:
        for known in catalogue.names():
            typer.echo(f"{known:24s} {catalogue.get(known).source}")
    else:
        typer.echo(catalogue.text(name), nl=False)
