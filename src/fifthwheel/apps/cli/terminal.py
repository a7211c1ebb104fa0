"""Reading inputs and writing messages on a terminal, with progress bars."""

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:
    from fifthwheel.base.pages import Document
    from fifthwheel.data.record import Record
    from fifthwheel.truck import Vehicle

_LARGE = 20_000_000
"""Bytes of all logs from which reading shows its progress."""


def load_records(
    paths: list[Path], signals: Path | None, *, allow_outside: bool, exclude: list[str] | None = None
) -> "list[Record]":
    """The records of logs without the windows of --exclude, with a progress bar if they are large."""
    from fifthwheel.apps.cli.options import windows
    from fifthwheel.apps.workflow import read_records
    from fifthwheel.data.logs import SignalMap

    signal_map = SignalMap.load(signals, allow_outside=allow_outside) if signals else None
    with reading_bar(paths) as progress:
        return read_records(paths, signal_map, exclude=windows(exclude), progress=progress)


def warn_of_masses(vehicle: "Vehicle") -> None:
    """Print unusual masses in the vehicle file."""
    from fifthwheel.truck.weighing import unusual_masses

    for warning in unusual_masses(vehicle):
        typer.secho(f"warning: {warning}", fg="yellow", err=True)


def print_load_differences(vehicle: "Vehicle", records: "Sequence[Record]") -> None:
    """Print axle loads in the logs that are not those of the vehicle file."""
    from fifthwheel.apps.workflow import axle_load_differences

    for difference in axle_load_differences(vehicle, records):
        typer.echo(str(difference), err=True)


def print_json(contents: Any) -> None:
    """Print data as JSON."""
    print(json.dumps(contents, indent=2))


def in_folder(folder: Path, names: Iterable[str]) -> dict[str, Path]:
    """The path of each result in a folder by its name."""
    return {name: folder / name for name in names}


def print_files(files: Mapping[str, Path]) -> None:
    """Print the paths of the files that were written."""
    typer.echo("Written: " + ", ".join(map(str, files.values())))


def print_result(
    contents: Mapping[str, Any], document: "Callable[[], Document] | None", files: Mapping[str, Path], *, as_json: bool
) -> None:
    """Print a result and the files that were written, as JSON or for people.

    The files have their names in the JSON. `document` makes what people read, if it is more than the files.
    """
    if as_json:
        print_json({**contents, "files": {name: str(path) for name, path in files.items()}})
        return
    if document is not None:
        from fifthwheel.base.pages.terminal import show

        show(document())
    if files:
        print_files(files)


@contextmanager
def reading_bar(paths: list[Path]) -> "Iterator[Callable[[str, int, int], None]]":
    """A progress bar for reading logs, shown if they are large together."""
    size = sum(path.stat().st_size for path in paths if path.is_file())
    with progress_bar(quiet=size < _LARGE) as show:
        yield show


def progress_bar(*, quiet: bool) -> "AbstractContextManager[Callable[[str, int, int], None]]":
    """`fw.progress_bar`, imported where it is used."""
    from fifthwheel.base.pages.terminal import progress_bar as shown

    return shown(quiet=quiet)
