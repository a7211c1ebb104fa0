"""fifthwheel simulate"""

import json
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fifthwheel.cli.app import JsonOption, VehicleOption, app, example, progress_bar, read_vehicle

if TYPE_CHECKING:
    from fifthwheel.logs import Record
    from fifthwheel.plant import Drive
    from fifthwheel.vehicle import Vehicle


class Model(StrEnum):
    """What is simulated."""

    linear = "linear"
    nonlinear = "nonlinear"


ONLY_NONLINEAR = "The nonlinear truck only: "


@app.command(
    epilog=example(
        "fifthwheel simulate drive.csv --vehicle cheng_cebon_2011",
        "fifthwheel simulate hard.parquet -v truck.toml --manoeuvre sweep --speed 80 --seed 3",
        "fifthwheel simulate drive.csv --model nonlinear --manoeuvre test_track --film strip.png",
        "fifthwheel simulate drive.parquet --model nonlinear --manoeuvre everyday --sensors sensors.toml --all-truth",
        "fifthwheel simulate wet.csv --model nonlinear --with friction=0.6 --with 'bank=2 deg'",
    )
)
def simulate(
    log: Annotated[Path, typer.Argument(help="File to write: .csv or .parquet.", show_default=False)],
    vehicle: VehicleOption = "cheng_cebon_2011",
    model: Annotated[
        Model, typer.Option(help="The linear yaw-roll model, or a multibody truck on MuJoCo with a driver.")
    ] = Model.linear,
    manoeuvre: Annotated[
        str,
        typer.Option(
            help="lane_changes, sweep, random or straight; the nonlinear truck also test_track, single_sine, step,"
            " constant_radius and everyday."
        ),
    ] = "lane_changes",
    count: Annotated[
        int | None, typer.Option(min=1, max=1000, help="Lane changes, left and right in turn; 15 by default.")
    ] = None,
    speed: Annotated[float | None, typer.Option(help="km/h; that of the manoeuvre, mostly 88, by default.")] = None,
    rate: Annotated[float, typer.Option(min=5, max=1000, help="Samples a second, Hz.")] = 100.0,
    duration: Annotated[
        float | None, typer.Option(min=2, max=36_000, help="s; as the manoeuvre needs by default.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the sensors' noise, and of random courses.")] = 0,
    yaw_only: Annotated[bool, typer.Option("--yaw-only", help="The linear model only: a truck without roll.")] = False,
    sensors: Annotated[
        Path | None,
        typer.Option(help=ONLY_NONLINEAR + "a TOML file of sensors with noise, bias, scale, delay, dropouts."),
    ] = None,
    properties: Annotated[
        list[str] | None,
        typer.Option("--with", help=ONLY_NONLINEAR + "a property=value of docs/plant.md; may be repeated."),
    ] = None,
    all_truth: Annotated[
        bool, typer.Option("--all-truth", help=ONLY_NONLINEAR + "tyre forces, positions and all, as reference.")
    ] = False,
    film: Annotated[
        Path | None,
        typer.Option(help=ONLY_NONLINEAR + "a picture strip (.png, .svg) or a film (.gif) of its liveliest moment."),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """A log of a simulated truck with the noise of real gyros, the true states beside it as reference."""
    from fifthwheel.errors import SignalError
    from fifthwheel.logs import write
    from fifthwheel.logs.files import writer

    writer(log)  # before the truck is driven
    truck = read_vehicle(vehicle)
    given: dict[str, Any] = {"speed": None if speed is None else speed / 3.6, "count": count, "duration": duration}
    files = [str(log)]
    if model is Model.linear:
        foreign = {"--sensors": sensors, "--with": properties, "--all-truth": all_truth, "--film": film}
        if wrong := [option for option, value in foreign.items() if value]:
            raise SignalError(f"{', '.join(wrong)}: the linear model has no such thing; add --model nonlinear")
        record = _linear(truck, manoeuvre, rate, seed, roll=not yaw_only, name=log.stem, given=given)
    else:
        if yaw_only:
            raise SignalError("--yaw-only: the nonlinear truck rolls; leave it out, or take --model linear")
        from fifthwheel.plant.sensors import load
        from fifthwheel.report.film import SUFFIXES
        from fifthwheel.report.film import film as draw

        if film and film.suffix.lower() not in SUFFIXES:  # before the truck is driven
            raise SignalError(f"{film.name}: expected a name that ends in {', '.join(SUFFIXES)}")
        fitted = load(sensors) if sensors else None
        course = {"name": manoeuvre, "seed": seed, **given}
        drive = _drive(truck, course, rate, log.stem, properties or [], quiet=as_json)
        record = drive.record(fitted, seed=seed, everything=all_truth)
    write(record, log)
    if film:
        files.append(str(draw(drive, film)))
    if as_json:
        signals = {"signals": list(record.signals), "reference": list(record.reference)}
        told = {"file": str(log), "files": files, "samples": len(record), "span": record.span, **signals}
        print(json.dumps(told, indent=2))
    else:
        seconds = record.span[1] - record.span[0]
        typer.echo(f"{', '.join(files)}: {len(record)} samples, {seconds:.0f} s at {record.rate:.0f} Hz")


def _linear(
    truck: "Vehicle", manoeuvre: str, rate: float, seed: int, *, roll: bool, name: str, given: dict[str, Any]
) -> "Record":
    from fifthwheel.simulate import simulate as run

    told = {key: value for key, value in given.items() if value is not None}
    return run(truck, manoeuvre=manoeuvre, rate=rate, seed=seed, roll=roll, name=name, **told)


def _drive(
    truck: "Vehicle", asked: dict[str, Any], rate: float, name: str, properties: list[str], *, quiet: bool
) -> "Drive":
    from fifthwheel.errors import VehicleError
    from fifthwheel.plant import Plant, Properties, course
    from fifthwheel.plant.properties import changed

    pairs = dict(text.partition("=")[::2] for text in properties)
    if bare := [key for key, value in pairs.items() if not value]:
        raise VehicleError(f"--with {bare[0]}: expected property=value, such as 'bank=2 deg'")
    path = course(vehicle=truck, **asked)
    plant = Plant(truck, changed(Properties(), pairs))
    with progress_bar(quiet=quiet) as progress:
        return plant.drive(path, rate=rate, name=name, progress=progress)
