"""fifthwheel app"""

from pathlib import Path
from typing import Annotated

import typer

from fifthwheel.apps.cli.app import command


@command(
    "fifthwheel app",
    "fifthwheel app trial --port 8080 --no-browser",
    "fifthwheel app trial --host 0.0.0.0 --token 'a long password'",
)
def app(
    folder: Annotated[Path, typer.Argument(help="Folder of the workspace; made if it is missing.")] = Path("workspace"),
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port to listen at; 0 for a free one.")] = 8080,
    host: Annotated[str, typer.Option(help="Address to listen at; any other than this computer needs --token.")] = (
        "127.0.0.1"
    ),
    token: Annotated[
        str | None, typer.Option(help="Who opens the pages must know it.", envvar="FIFTHWHEEL_TOKEN")
    ] = None,
    max_file: Annotated[float, typer.Option(min=0.001, help="Largest dropped file, GB.")] = 8.0,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Open the first page.")] = True,
) -> None:
    """Open the workbench: pages in your browser from a log to the identified truck.

    Logs, signals.toml, vehicle.toml and results are files in the folder, the same as those of the other commands.
    Ctrl-C ends the server; nothing is lost.
    """
    from fifthwheel.apps.app.serve import serve

    serve(
        folder,
        host=host,
        port=port,
        token=token,
        max_file=round(max_file * 1e9),
        ready=lambda address: typer.echo(f"{address}\nCtrl-C ends the workbench."),
        browser=browser,
    )
