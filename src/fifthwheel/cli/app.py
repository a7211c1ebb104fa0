"""What the commands share: the application, its options, reading trucks and logs, a progress bar."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from fifthwheel.logs import Record
    from fifthwheel.vehicle import Vehicle

app = typer.Typer(
    name="fifthwheel",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Parameters and states of articulated heavy vehicles, from the sensors they have.",
)

_LARGE = 20_000_000
"""Bytes from which reading shows how far it is."""

_LOADS_AGREE = 0.05
"""Weighing on board is hardly better."""

Logs = Annotated[
    list[Path],
    typer.Argument(help="Logs of one truck: CSV, Parquet, MF4, MATLAB, MCAP or CAN traces.", show_default=False),
]
VehicleOption = Annotated[
    str, typer.Option("--vehicle", "-v", help="The truck: a TOML file, or a name that `fifthwheel vehicle` lists.")
]
SignalsOption = Annotated[
    Path | None,
    typer.Option("--signals", "-s", help="Which column is which signal; needed where columns have names of their own."),
]
OutOption = Annotated[Path, typer.Option("--out", "-o", help="Folder for the results; made if missing.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print the result as JSON instead of tables.")]
CheckOption = Annotated[
    bool, typer.Option("--check/--no-check", help="Refuse signals that cannot be what they are called.")
]


class FigureFile(StrEnum):
    """As what figures are written."""

    svg = "svg"
    png = "png"
    pdf = "pdf"


FiguresOption = Annotated[
    FigureFile | None,
    typer.Option("--figures", help="Write every figure of the report to OUT/figures too; needs matplotlib."),
]


def example(*lines: str) -> str:
    """Examples for the end of a command's help."""
    return "**Examples**\n\n" + "\n\n".join(f"`{line}`" for line in lines)


def read_vehicle(name: str) -> "Vehicle":
    from fifthwheel.errors import VehicleError
    from fifthwheel.vehicle import catalogue, load

    if name in catalogue.names():
        return catalogue.get(name)
    if not Path(name).is_file():
        raise VehicleError(f"{name}: no such file, nor in the catalogue, which has {', '.join(catalogue.names())}")
    return load(Path(name))


def read_records(paths: list[Path], signals: Path | None) -> "list[Record]":
    """The logs, each under a name of its own, with a progress bar where they are large."""
    from fifthwheel.logs import SignalMap, read

    signal_map = SignalMap.load(signals) if signals else None
    stems = [path.stem for path in paths]
    names = [path.stem if stems.count(path.stem) == 1 else str(path) for path in paths]
    with reading(paths) as progress:
        return [read(p, signal_map, name=n, progress=progress(p)) for p, n in zip(paths, names, strict=True)]


@contextmanager
def reading(paths: list[Path]) -> "Iterator[Callable[[Path], Callable[[float], None]]]":
    """What gives each file its progress, shown on the terminal when they are large together."""
    size = sum(path.stat().st_size for path in paths if path.is_file())
    with progress_bar(quiet=size < _LARGE) as show:
        yield lambda path: lambda done: show(f"reading {path.name}", round(1000 * done), 1000)


def expected(truck: "Vehicle") -> dict[str, Any]:
    """What a check of a record should know of the truck."""
    units, steered = [unit.name for unit in truck.units], truck.steer_signals()
    return {"wheelbase": truck.wheelbase, "units": units, "steered": steered}


def say_loads(truck: "Vehicle", records: "list[Record]") -> None:
    """Tell where axle loads in the logs are not those of the vehicle file, as everything rests on its masses."""
    from fifthwheel.logs.weigh import PREFIX, static_loads

    expected = truck.axle_loads()
    for record in records:
        if not any(name.startswith(PREFIX) for name in record.signals):
            continue
        for path, load in static_loads(record).items():
            if path in expected and abs(load.value / expected[path] - 1) > _LOADS_AGREE:
                typer.echo(
                    f"{record.name}: {PREFIX}{path} is {load.value / 1e3:.1f} kN, the vehicle file makes it "
                    f"{expected[path] / 1e3:.1f} kN; `fifthwheel weigh` takes masses and CoG from the log",
                    err=True,
                )


def made_folder(path: Path) -> Path:
    from fifthwheel.errors import FifthwheelError

    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FifthwheelError(f"{path}: {error.strerror}; choose another folder with --out") from error
    return path


def say_files(files: dict[str, str]) -> None:
    typer.echo("Written: " + ", ".join(files.values()))


@contextmanager
def progress_bar(*, quiet: bool) -> "Iterator[Callable[[str, int, int], None]]":
    """A bar on the terminal that follows calls with title, done and total; nothing where there is no terminal."""
    if quiet or not sys.stderr.isatty():
        yield lambda title, done, total: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        tasks: dict[str, Any] = {}

        def show(title: str, done: int, total: int) -> None:
            if title not in tasks:
                tasks[title] = bar.add_task(title, total=total)
            bar.update(tasks[title], completed=done, total=total)

        yield show
