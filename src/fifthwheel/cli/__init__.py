"""The command line, a module a command. Heavy imports wait until a command needs them."""

import os
import signal
import sys
from typing import Annotated, Any

import typer

from fifthwheel import __version__
from fifthwheel.cli import check, design, identify, reproduce, signals, simulate, states, vehicle, weigh  # noqa: F401 - they join the application
from fifthwheel.cli.app import app


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"fifthwheel {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and leave.")
    ] = False,
) -> None:
    """Options that come before a command."""


_REFUSED: Any = next(kind for kind in typer.BadParameter.__mro__ if kind.__name__ == "ClickException")


def main() -> None:
    """Entry point: exit code 0 when it ran, 2 for bad input or usage, 130 when interrupted."""
    from fifthwheel.errors import FifthwheelError

    before = signal.signal(signal.SIGINT, _interrupted)
    if len(sys.argv) == 1:
        sys.argv.append("--help")
    try:
        sys.exit(app(standalone_mode=False))
    except _REFUSED as error:
        _refuse(f"{error.format_message()} See fifthwheel --help")
    except FifthwheelError as error:
        _refuse(str(error))
    except OSError as error:
        _refuse(f"{error.filename or ''}: {error.strerror or error}")
    finally:
        signal.signal(signal.SIGINT, before)


def _refuse(message: str) -> None:
    typer.secho(f"error: {message}", fg="red", err=True)
    sys.exit(2)


def _interrupted(*_: object) -> None:
    """Leave at once, wherever the libraries are: whatever is written appears whole or not at all."""
    if "multiprocessing" in sys.modules:
        for child in sys.modules["multiprocessing"].active_children():
            child.kill()
    show_cursor = "\x1b[?25h" if sys.stderr.isatty() else ""
    os.write(2, f"{show_cursor}interrupted; files that were already written are whole\n".encode())
    os._exit(130)
