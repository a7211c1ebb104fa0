"""Options that several commands share, reading inputs, and writing messages on a terminal"""

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

if TYPE_CHECKING:
    from fifthwheel.base.pages import Document
    from fifthwheel.data.record import Record
    from fifthwheel.truck import Vehicle


Logs = Annotated[
    list[Path],
    typer.Argument(help="Logs of one vehicle, of any format of docs/logs.md, such as CSV or MF4.", show_default=False),
]
VehicleOption = Annotated[
    str,
    typer.Option(
        "--vehicle",
        "-v",
        help="The vehicle: a TOML file, a name from `fifthwheel vehicle`, or a result folder of `fifthwheel identify`.",
    ),
]
SignalsOption = Annotated[
    Path | None,
    typer.Option(
        "--signals",
        "-s",
        help="Signal map (signals.toml). Needed if the column headers are not signal names such as yaw_rate.tractor.",
    ),
]
AllowOutsideOption = Annotated[
    bool,
    typer.Option("--allow-outside", help="Read databases that --signals names outside of the folder of the map."),
]
ExcludeOption = Annotated[
    list[str] | None,
    typer.Option(
        "--exclude",
        help="FIRST..LAST: leave out this window of all logs, s, such as 12.5..14; LOG=FIRST..LAST of one log, by its "
        "name without ending. May be repeated.",
    ),
]
OutOption = Annotated[Path, typer.Option("--out", "-o", help="Folder for the results; created if it does not exist.")]
ForceOption = Annotated[
    bool,
    typer.Option("--force", help="Replace also files that are not results of an earlier run of this command."),
]
ForceFileOption = Annotated[bool, typer.Option("--force", help="Replace a file that exists.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print the result as JSON instead of tables.")]
CheckOption = Annotated[bool, typer.Option("--check/--no-check", help="Refuse logs with implausible signals.")]
OF_RESULT = "Default: that of the result folder, if --vehicle is one."
IdentificationOption = Annotated[
    Path | None,
    typer.Option(
        "--identification",
        "-i",
        help=f"An identification.json: sensor errors, noise, and the uncertainty of the vehicle. {OF_RESULT}",
    ),
]
FiguresOption = Annotated[
    Literal["svg", "png", "pdf"] | None,
    typer.Option("--figures", help="Also write every figure of the report to OUT/figures; needs matplotlib."),
]
_LARGE = 20_000_000
"""Bytes of all logs from which reading shows its progress."""


def windows(texts: list[str] | None) -> dict[str, list[tuple[float, float]]]:
    """ "FIRST..LAST" or "LOG=FIRST..LAST" as windows, s, by the name of the log; "" for all logs."""
    from fifthwheel.base.errors import FifthwheelError

    result: dict[str, list[tuple[float, float]]] = {}
    for text in texts or []:
        log, _, window = text.rpartition("=")
        first, separator, last = window.partition("..")
        try:
            ends = float(first), float(last)
        except ValueError:
            separator = ""
        if not separator:
            raise FifthwheelError(f"--exclude {text}: expected FIRST..LAST in s, such as 12.5..14, or LOG=FIRST..LAST")
        result.setdefault(log, []).append(ends)
    return result


def require_figures(figures: str | None, out: Path | None) -> None:
    """Refuse --figures before the computation, where they cannot be drawn or there is no folder for them."""
    from fifthwheel.base.errors import FifthwheelError
    from fifthwheel.base.pages.html import checked_format

    if figures:
        checked_format(figures)
        if out is None:
            raise FifthwheelError("--figures: needs a folder; add -o FOLDER")


def load_records(
    paths: list[Path], signals: Path | None, *, allow_outside: bool, exclude: list[str] | None = None
) -> "list[Record]":
    """The records of logs without the windows of --exclude, with a progress bar if they are large."""
    from fifthwheel.apps.workflow.inputs import read_records
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
    from fifthwheel.apps.workflow.measured_vehicle import axle_load_differences

    for difference in axle_load_differences(vehicle, records):
        typer.echo(difference, err=True)


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
