"""fifthwheel states"""

import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fifthwheel import __version__
from fifthwheel.cli.app import (
    CheckOption,
    FiguresOption,
    JsonOption,
    Logs,
    OutOption,
    SignalsOption,
    VehicleOption,
    app,
    example,
    expected,
    made_folder,
    progress_bar,
    read_records,
    read_vehicle,
    say_files,
)

if TYPE_CHECKING:
    from fifthwheel.logs import Record
    from fifthwheel.observe import States, Uncertainty
    from fifthwheel.vehicle import Vehicle


@app.command(
    epilog=example(
        "fifthwheel states drive.csv --vehicle fifthwheel-out/vehicle.toml",
        "fifthwheel states drive.csv -v fifthwheel-out/vehicle.toml -i fifthwheel-out/identification.json",
        "fifthwheel states drive.parquet -v truck.toml --json > states.json",
        "fifthwheel states drive.csv -v truck.toml --at sideslip.semitrailer=-2.34",
        "fifthwheel states drive.csv -v truck.toml --smooth --bank",
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
        typer.Option(
            "--identification",
            "-i",
            help="identification.json, for the sensors' zeros, delays and noise, and the truck's uncertainty.",
        ),
    ] = None,
    at: Annotated[
        list[str] | None, typer.Option("--at", help="Where a sideslip is told, x on its unit in m; may be repeated.")
    ] = None,
    smooth: Annotated[bool, typer.Option("--smooth", help="Use what comes later too; off-line only.")] = False,
    bank: Annotated[
        bool, typer.Option("--bank", help="Find the road's bank too; the steer zero must be known well.")
    ] = False,
    check: CheckOption = True,
    figures: FiguresOption = None,
    as_json: JsonOption = False,
) -> None:
    """Sideslip, roll and articulation of a known truck: states.parquet and report.html.

    Where identification.json tells how uncertain the truck's parameters are, every sigma contains what comes of that.
    """
    from dataclasses import replace

    from fifthwheel.logs import check as plausibility
    from fifthwheel.logs import raise_errors
    from fifthwheel.observe import Observer, ObserverSettings, save
    from fifthwheel.observe.noise import INITIAL
    from fifthwheel.report import Given, drawing, of_run, show_states, write_report
    from fifthwheel.report.state_words import conclude_states

    if figures:
        drawing.checked(figures)
    truck, records = read_vehicle(vehicle), read_records(logs, signals)
    told = _identification(identification)
    uncertainty = _uncertainty(identification, told)
    settings = ObserverSettings(min_speed=min_speed, places=_places(at or []), bank=INITIAL["bank"] if bank else None)
    folder = made_folder(out)
    found = []
    with progress_bar(quiet=as_json) as progress:
        for i, record in enumerate(records):
            progress("states", i, len(records))
            if check:
                raise_errors(plausibility(record, **expected(truck)))
            sensors, unsure = _sensors(told, record, truck, uncertainty) if told else ({}, uncertainty)
            observer = Observer(truck, record.signals, replace(settings, **sensors))
            found.append((observer.smooth if smooth else observer.batch)(record, unsure))
        progress("states", len(records), len(records))
    save(found, folder / "states.parquet")
    names = () if uncertainty is None else uncertainty.names
    drawn = write_report(
        folder / "report.html",
        None,
        records,
        found,
        title=truck.name,
        given=Given(smoothed=smooth, uncertain=names),
        provenance=of_run(logs, vehicle, signals, identification, command=sys.argv[1:]),
        figures=figures,
    )
    files = {name: str(folder / name) for name in ("states.parquet", "report.html", *(["figures"] if drawn else []))}
    if as_json:
        how = {"smoothed": smooth, "uncertain": list(names)}
        logs_told = [_states_summary(s) for s in found]
        conclusion = conclude_states(found, records).as_dict()
        everything = {"version": __version__, **how, "logs": logs_told, "conclusion": conclusion, "files": files}
        print(json.dumps(everything, indent=2))
    else:
        show_states(found, records)
        say_files(files)


def _sensors(
    told: Any, record: "Record", truck: "Vehicle", uncertainty: "Uncertainty | None"
) -> "tuple[dict[str, Any], Uncertainty | None]":
    """Zeros and noise of a log's sensors, and what is uncertain of them and the truck; of a new log from itself."""
    from fifthwheel.errors import SignalError
    from fifthwheel.identify.result import sensors_told
    from fifthwheel.identify.sensors import sensors_of

    if record.name not in {log["name"] for log in told["logs"]}:
        said = f"{record.name}: not a log of that identification; its sensors' zeros"
        try:
            found = sensors_of(record, truck, uncertainty)
        except SignalError as error:
            typer.echo(f"{said} are unknown, as sigma says ({error})", err=True)
        else:
            typer.echo(f"{said} are found from itself", err=True)
            return found
    return sensors_told(told, record.name), uncertainty


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


def _uncertainty(path: Path | None, told: Any) -> "Uncertainty | None":
    """What an identification.json says of how uncertain the truck is; None where it says nothing."""
    from fifthwheel.errors import SignalError
    from fifthwheel.observe import Uncertainty

    if not told or told.get("uncertainty") is None:
        return None
    try:
        return Uncertainty.from_dict(told["uncertainty"])
    except SignalError as error:
        raise SignalError(f"{path}: {error}") from None


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


def _states_summary(found: "States") -> dict[str, Any]:
    from fifthwheel.observe import Status

    share = {status.name.lower(): float((found.status == status).mean()) for status in Status}
    return {"name": found.name, "samples": len(found.time), "status": share, "states": list(found.values)}
