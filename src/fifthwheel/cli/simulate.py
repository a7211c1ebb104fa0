"""fifthwheel simulate"""

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from fifthwheel._atomic import reserved
from fifthwheel.cli.app import command
from fifthwheel.cli.options import ForceFileOption, JsonOption, VehicleOption
from fifthwheel.cli.terminal import print_json, progress_bar


class TruckModel(StrEnum):
    """The model that is simulated."""

    linear = "linear"
    nonlinear = "nonlinear"


@command(
    "fifthwheel simulate run.csv --vehicle cheng_cebon_2011",
    "fifthwheel simulate sweep.parquet -v truck.toml --manoeuvre sweep --speed 80 --seed 3",
    "fifthwheel simulate run.csv --model nonlinear --manoeuvre test_track --film strip.png",
    "fifthwheel simulate run.parquet --model nonlinear --manoeuvre everyday --sensors sensors.toml --all-truth",
    "fifthwheel simulate wet.csv --model nonlinear --with friction=0.6 --with 'bank=2 deg'",
    "fifthwheel simulate brake.csv --model nonlinear --manoeuvre single_sine --braking 3",
)
def simulate(
    log: Annotated[Path, typer.Argument(help="File to write: .csv or .parquet.", show_default=False)],
    vehicle: VehicleOption = "cheng_cebon_2011",
    model: Annotated[
        TruckModel,
        typer.Option(help="The linear yaw-roll model, or the nonlinear multibody vehicle with a driver."),
    ] = TruckModel.linear,
    manoeuvre: Annotated[
        str,
        typer.Option(
            help="lane_changes, sweep, random or straight; with the linear model also bend, with the nonlinear model "
            "also test_track, single_sine, step, constant_radius and everyday."
        ),
    ] = "lane_changes",
    count: Annotated[
        int | None,
        typer.Option(min=1, max=1000, help="Number of lane changes, alternately left and right. Default: 15."),
    ] = None,
    speed: Annotated[
        float | None, typer.Option(help="Speed, km/h. Default: that of the manoeuvre, usually 88.")
    ] = None,
    rate: Annotated[float, typer.Option(min=5, max=1000, help="Sampling rate, Hz.")] = 100.0,
    duration: Annotated[
        float | None, typer.Option(min=2, max=36_000, help="Duration, s. Default: that of the manoeuvre.")
    ] = None,
    braking: Annotated[
        float | None,
        typer.Option(help="Deceleration from 1 s on, m/s^2, up to 5; the speed falls to 6 m/s; nonlinear only."),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the sensor noise and of random courses.")] = 0,
    yaw_only: Annotated[bool, typer.Option("--yaw-only", help="No roll; linear model only.")] = False,
    sensors: Annotated[
        Path | None,
        typer.Option(help="A TOML file of sensors with noise, bias, scale factor, delay, dropouts; nonlinear only."),
    ] = None,
    properties: Annotated[
        list[str] | None,
        typer.Option("--with", help="PROPERTY=VALUE of docs/plant.md; nonlinear only; may be repeated."),
    ] = None,
    all_truth: Annotated[
        bool,
        typer.Option(
            "--all-truth",
            help="Write all true signals (tyre forces, positions, ...) as reference signals; nonlinear only.",
        ),
    ] = False,
    film: Annotated[
        Path | None,
        typer.Option(help="A strip of pictures (.png, .svg) or an animation (.gif); nonlinear only."),
    ] = None,
    force: ForceFileOption = False,
    as_json: JsonOption = False,
) -> None:
    """Simulate a log with the noise of real gyros, and the true states as reference signals."""
    from fifthwheel.errors import SignalError
    from fifthwheel.logs import write_record
    from fifthwheel.logs.files import record_writer
    from fifthwheel.workflow import read_vehicle

    record_writer(log)  # refuses an unknown format before the simulation
    truck, files = read_vehicle(vehicle), [str(log)]
    given: dict[str, Any] = {"speed": None if speed is None else speed / 3.6, "count": count, "duration": duration}
    given = {name: value for name, value in given.items() if value is not None}
    with reserved(log, film, force=force):
        if model is TruckModel.linear:
            from fifthwheel.simulate import simulate as run_linear

            nonlinear_only = {"--sensors": sensors, "--with": properties, "--all-truth": all_truth, "--film": film}
            nonlinear_only |= {"--braking": braking is not None}
            if refused := [option for option, value in nonlinear_only.items() if value]:
                raise SignalError(f"{', '.join(refused)}: not available in the linear model; add --model nonlinear")
            record = run_linear(
                truck, manoeuvre=manoeuvre, rate=rate, seed=seed, roll=not yaw_only, name=log.stem, **given
            )
        else:
            if yaw_only:
                raise SignalError("--yaw-only: the nonlinear vehicle always rolls; remove it, or use --model linear")
            from fifthwheel.manoeuvres import course as make_course
            from fifthwheel.plant import Plant, Properties
            from fifthwheel.plant.film import SUFFIXES
            from fifthwheel.plant.film import film as draw
            from fifthwheel.plant.properties import with_changes
            from fifthwheel.plant.sensors import read_sensors

            if film and film.suffix.lower() not in SUFFIXES:  # before the simulation
                raise SignalError(f"{film.name}: expected a name that ends in {', '.join(SUFFIXES)}")
            fitted = read_sensors(sensors) if sensors else None
            course = make_course(manoeuvre, truck, braking=braking, seed=seed, **given)
            plant = Plant(truck, with_changes(Properties(), _changes(properties or [])))
            with progress_bar(quiet=as_json) as progress:
                run = plant.drive(course, rate=rate, name=log.stem, progress=progress)
            record = run.record(fitted, seed=seed, everything=all_truth)
        write_record(record, log)
        if film:
            files.append(str(draw(run, film)))
    if as_json:
        signals = {"signals": list(record.signals), "reference": list(record.reference)}
        print_json({"file": str(log), "files": files, "samples": len(record), "span": record.span, **signals})
    else:
        duration = record.span[1] - record.span[0]
        typer.echo(f"{', '.join(files)}: {len(record)} samples, {duration:.0f} s at {record.rate:.0f} Hz")


def _changes(texts: list[str]) -> dict[str, str]:
    """ "property=value" as property: value."""
    from fifthwheel.errors import VehicleError

    changes = dict(text.partition("=")[::2] for text in texts)
    if incomplete := [key for key, value in changes.items() if not value]:
        raise VehicleError(f"--with {incomplete[0]}: expected PROPERTY=VALUE, such as 'bank=2 deg'")
    return changes
