"""The command line: identify, states, simulate, vehicle. Heavy imports wait until a command needs them."""

import json
import math
import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fifthwheel import __version__

if TYPE_CHECKING:
    from fifthwheel.identify import Identification
    from fifthwheel.logs import Record
    from fifthwheel.observe import States
    from fifthwheel.vehicle import Vehicle

app = typer.Typer(
    name="fifthwheel",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Parameters and states of articulated heavy vehicles, from the sensors they have.",
)

Logs = Annotated[list[Path], typer.Argument(help="Logs of one truck: CSV or Parquet.", show_default=False)]
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


class Preset(StrEnum):
    """Settings by name."""

    default = "default"
    article = "article"


def example(*lines: str) -> str:
    """Examples for the end of a command's help."""
    return "**Examples**\n\n" + "\n\n".join(f"`{line}`" for line in lines)


@app.command(
    epilog=example(
        "fifthwheel identify drive.csv --vehicle truck.toml",
        "fifthwheel identify bend.csv ramp.csv -v truck.toml -s signals.toml -o result",
        "fifthwheel identify drive.csv -v truck.toml --hold tractor.front.cornering_stiffness",
        "fifthwheel identify drive.csv -v truck.toml --preset article --json",
    )
)
def identify(
    logs: Logs,
    vehicle: VehicleOption,
    signals: SignalsOption = None,
    out: OutOption = Path("fifthwheel-out"),
    hold: Annotated[
        list[str] | None, typer.Option("--hold", help="A parameter that keeps its value; may be repeated.")
    ] = None,
    validate: Annotated[
        list[Path] | None, typer.Option("--validate", help="A log to predict only; may be repeated.")
    ] = None,
    preset: Annotated[Preset, typer.Option(help="Our settings, or the article's.")] = Preset.default,
    passes: Annotated[int | None, typer.Option(min=1, help="At most so many times through the logs a stage.")] = None,
    check: CheckOption = True,
    as_json: JsonOption = False,
) -> None:
    """Tyre cornering stiffnesses, trailer yaw inertia and payload height from logs, then the states.

    Reads the logs, runs both stages and the state estimator, prints every parameter with sigma and verdict, and writes
    identification.json, vehicle.toml (the identified truck), states.parquet and report.html.
    """
    from dataclasses import replace

    from fifthwheel.identify import Settings, article
    from fifthwheel.identify import identify as run
    from fifthwheel.observe import Observer

    truck, both = _vehicle(vehicle), _records([*logs, *(validate or [])], signals)
    records, unseen = both[: len(logs)], both[len(logs) :]
    settings = article() if preset is Preset.article else Settings()
    settings = replace(settings, held=tuple(hold or ()), check=check, passes=passes or settings.passes)
    folder = _folder(out)
    with _progress(quiet=as_json) as progress:
        found = run(records, truck, settings, validate=unseen, progress=progress)
        progress("states", 0, len(records))
        states = []
        for i, record in enumerate((*records, *unseen), 1):
            observer = Observer(found.vehicle, record.signals, found.observer_settings(record.name))
            states.append(observer.batch(record))
            progress("states", i, len(records) + len(unseen))
    files = _write(found, [*records, *unseen], states, folder)
    if as_json:
        print(json.dumps(json.loads(found.to_json()) | {"files": files}, indent=2))
    else:
        from fifthwheel.report import show_identification

        show_identification(found)
        _say_files(files)


@app.command(
    epilog=example(
        "fifthwheel states drive.csv --vehicle fifthwheel-out/vehicle.toml",
        "fifthwheel states drive.csv -v fifthwheel-out/vehicle.toml -i fifthwheel-out/identification.json",
        "fifthwheel states drive.parquet -v truck.toml --json > states.json",
        "fifthwheel states drive.csv -v truck.toml --at sideslip.semitrailer=-2.34",
    )
)
def states(
    logs: Logs,
    vehicle: VehicleOption,
    signals: SignalsOption = None,
    out: OutOption = Path("fifthwheel-states"),
    min_speed: Annotated[float, typer.Option(min=0.5, help="Below this the model does not hold, m/s.")] = 5.0,
    identification: Annotated[
        Path | None,
        typer.Option("--identification", "-i", help="identification.json, for the sensors' zeros, delays and noise."),
    ] = None,
    at: Annotated[
        list[str] | None, typer.Option("--at", help="Where a sideslip is told, x on its unit in m; may be repeated.")
    ] = None,
    check: CheckOption = True,
    as_json: JsonOption = False,
) -> None:
    """Sideslip, roll and articulation of a known truck: states.parquet and report.html."""
    from dataclasses import replace

    from fifthwheel.identify.result import sensors_told
    from fifthwheel.logs import check as plausibility
    from fifthwheel.logs import raise_errors
    from fifthwheel.observe import Observer, ObserverSettings, save

    truck, records = _vehicle(vehicle), _records(logs, signals)
    told = _identification(identification)
    settings = ObserverSettings(min_speed=min_speed, places=_places(at or []))
    folder = _folder(out)
    found = []
    with _progress(quiet=as_json) as progress:
        for i, record in enumerate(records):
            progress("states", i, len(records))
            if check:
                raise_errors(plausibility(record, wheelbase=truck.wheelbase))
            own = replace(settings, **sensors_told(told, record.name)) if told else settings
            found.append(Observer(truck, record.signals, own).batch(record))
        progress("states", len(records), len(records))
    save(found, folder / "states.parquet")
    from fifthwheel.report import show_states, write_report

    write_report(folder / "report.html", None, records, found, title=truck.name)
    files = {name: str(folder / name) for name in ("states.parquet", "report.html")}
    if as_json:
        print(
            json.dumps({"version": __version__, "logs": [_states_summary(s) for s in found], "files": files}, indent=2)
        )
    else:
        show_states(found, records)
        _say_files(files)


@app.command(
    epilog=example(
        "fifthwheel simulate drive.csv --vehicle cheng_cebon_2011",
        "fifthwheel simulate hard.parquet -v truck.toml --manoeuvre sweep --speed 80 --seed 3",
    )
)
def simulate(
    log: Annotated[Path, typer.Argument(help="File to write: .csv or .parquet.", show_default=False)],
    vehicle: VehicleOption = "cheng_cebon_2011",
    manoeuvre: Annotated[str, typer.Option(help="lane_changes, sweep, random or straight.")] = "lane_changes",
    count: Annotated[int, typer.Option(min=1, max=1000, help="Lane changes, left and right in turn.")] = 15,
    speed: Annotated[float, typer.Option(help="km/h.")] = 88.0,
    rate: Annotated[float, typer.Option(min=5, max=1000, help="Samples a second, Hz.")] = 100.0,
    duration: Annotated[
        float | None, typer.Option(min=2, max=36_000, help="s; as the manoeuvre needs by default.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the sensors' noise.")] = 0,
    yaw_only: Annotated[bool, typer.Option("--yaw-only", help="A truck that does not roll.")] = False,
    as_json: JsonOption = False,
) -> None:
    """A log of the linear model with the noise of real gyros, the true states beside it as reference."""
    from fifthwheel.logs import write
    from fifthwheel.simulate import simulate as run

    record = run(
        _vehicle(vehicle),
        manoeuvre=manoeuvre,
        count=count,
        speed=speed / 3.6,
        rate=rate,
        duration=duration,
        seed=seed,
        roll=not yaw_only,
        name=log.stem,
    )
    write(record, log)
    if as_json:
        signals = {"signals": list(record.signals), "reference": list(record.reference)}
        print(json.dumps({"file": str(log), "samples": len(record), "span": record.span, **signals}, indent=2))
    else:
        typer.echo(f"{log}: {len(record)} samples, {record.span[1] - record.span[0]:.0f} s at {record.rate:.0f} Hz")


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


def _vehicle(name: str) -> "Vehicle":
    from fifthwheel.errors import VehicleError
    from fifthwheel.vehicle import catalogue, load

    if name in catalogue.names():
        return catalogue.get(name)
    if not Path(name).is_file():
        raise VehicleError(f"{name}: no such file, nor in the catalogue, which has {', '.join(catalogue.names())}")
    return load(Path(name))


def _records(paths: list[Path], signals: Path | None) -> "list[Record]":
    """The logs, each under a name of its own."""
    from fifthwheel.logs import SignalMap, read

    signal_map = SignalMap.load(signals) if signals else None
    stems = [path.stem for path in paths]
    names = [path.stem if stems.count(path.stem) == 1 else str(path) for path in paths]
    return [read(path, signal_map, name=name) for path, name in zip(paths, names, strict=True)]


def _identification(path: Path | None) -> Any:
    """What an identification.json holds."""
    from fifthwheel.errors import SignalError

    if path is None:
        return None
    try:
        told = json.loads(path.read_text(encoding="utf-8"))
        told["sensors"], told["logs"]
    except (ValueError, KeyError, TypeError) as error:
        raise SignalError(f"{path}: not an identification.json ({error!r}); give the one that identify wrote") from None
    return told


def _places(texts: list[str]) -> dict[str, float]:
    """ "signal=x" as signal: x."""
    from fifthwheel.errors import SignalError

    places = {}
    for text in texts:
        name, _, place = text.partition("=")
        try:
            places[name] = float(place)
        except ValueError:
            places[name] = math.nan
        if not math.isfinite(places[name]):
            raise SignalError(f"{text}: expected signal=x with x in m, such as sideslip.semitrailer=-2.34")
    return places


def _folder(path: Path) -> Path:
    from fifthwheel.errors import FifthwheelError

    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FifthwheelError(f"{path}: {error.strerror}; choose another folder with --out") from error
    return path


def _write(found: "Identification", records: "list[Record]", states: "list[States]", folder: Path) -> dict[str, str]:
    from fifthwheel.observe import save
    from fifthwheel.report import write_report
    from fifthwheel.vehicle import save as save_vehicle

    found.save(folder / "identification.json")
    save_vehicle(found.vehicle, folder / "vehicle.toml")
    save(states, folder / "states.parquet")
    write_report(folder / "report.html", found, records, states, title=found.vehicle.name)
    return {n: str(folder / n) for n in ("identification.json", "vehicle.toml", "states.parquet", "report.html")}


def _states_summary(found: "States") -> dict[str, Any]:
    from fifthwheel.observe import Status

    share = {status.name.lower(): float((found.status == status).mean()) for status in Status}
    return {"name": found.name, "samples": len(found.time), "status": share, "states": list(found.values)}


def _say_files(files: dict[str, str]) -> None:
    typer.echo("Written: " + ", ".join(files.values()))


@contextmanager
def _progress(*, quiet: bool) -> "Iterator[Callable[[str, int, int], None]]":
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
    show_cursor = "\x1b[?25h" if sys.stderr.isatty() else ""
    os.write(2, f"{show_cursor}interrupted; files that were already written are whole\n".encode())
    os._exit(130)
