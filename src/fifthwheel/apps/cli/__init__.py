"""The command line, a module for each command or pair of commands. Slow imports wait until a command needs them."""

import gc
import os
import signal
import sys
from typing import Annotated, Any

import typer

from fifthwheel import __version__
from fifthwheel.apps.cli import (  # importing a command registers it
    export,  # noqa: F401
    identify,  # noqa: F401
    knowledge,  # noqa: F401
    results,  # noqa: F401
    serve,  # noqa: F401
    simulate,  # noqa: F401
    vehicles,  # noqa: F401
)
from fifthwheel.apps.cli.app import app
from fifthwheel.base.atomic import clean_up
from fifthwheel.base.spelling import spelled_for


def _print_version(requested: bool) -> None:
    if requested:
        typer.echo(f"fifthwheel {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Options before the command."""
    context.with_resource(spelled_for("command line"))


_UsageError: Any = next(kind for kind in typer.BadParameter.__mro__ if kind.__name__ == "ClickException")


def main() -> None:
    """Entry point. Exit code 0: the command ran; 1: a self-check failed; 2: wrong input or usage; 130: interrupted;
    143: terminated."""
    from fifthwheel.base.errors import FifthwheelError

    gc.set_threshold(100_000)  # the objects of imported modules and of records make no cycles
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")  # the search for them is slow
    previous = {number: signal.signal(number, _exit_at_once) for number in (signal.SIGINT, signal.SIGTERM)}
    if len(sys.argv) == 1:
        sys.argv.append("--help")
    try:
        sys.exit(app(standalone_mode=False))
    except _UsageError as error:
        if type(error).__name__ == "NoArgsIsHelpError":
            typer.echo(error.format_message(), err=True)
            sys.exit(2)
        context: Any = getattr(error, "ctx", None)
        words = context.command_path.removeprefix(context.find_root().command_path) if context else ""
        _refuse(f"{error.format_message()}{_of_numbers(error, context)} See fifthwheel{words} --help")
    except FifthwheelError as error:
        _refuse(str(error))
    except FileExistsError as error:
        _refuse(f"{error.filename}: expected a folder, got a file; choose another name")
    except OSError as error:
        _refuse(f"{error.filename or 'file'}: {error.strerror or error}; check path, permissions and free space")
    finally:
        gc.freeze()  # at its end the interpreter would search all objects for cycles
        for number, handler in previous.items():
            signal.signal(number, handler)


def _of_numbers(error: Any, context: Any) -> str:
    """The option for all numbers, where an unknown option may be the name of one."""
    flags = [flag for parameter in context.command.params for flag in parameter.opts] if context else []
    unknown = type(error).__name__ == "NoSuchOption"
    if not unknown or "--set" not in flags or error.possibilities or error.option_name[:2] != "--":
        return ""
    name = error.option_name.lstrip("-").replace("-", "_")
    return f". If it is a number of vehicle or road, state it by --set {name}=VALUE."


def _refuse(message: str) -> None:
    from fifthwheel.base.errors import printable_lines

    message = printable_lines(message)
    typer.secho(f"error: {message}", fg="red", err=True)
    sys.exit(2)


def _exit_at_once(number: int, _: object) -> None:
    """Exit at once, also from native code; files are written atomically, so none is incomplete."""
    if "multiprocessing" in sys.modules:
        for child in sys.modules["multiprocessing"].active_children():
            child.kill()
    clean_up()
    show_cursor = "\x1b[?25h" if sys.stderr.isatty() else ""
    os.write(2, f"{show_cursor}interrupted; files written before the interrupt are complete\n".encode())
    os._exit(128 + number)
