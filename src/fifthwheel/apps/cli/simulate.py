"""fifthwheel simulate and reproduce"""

from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from fifthwheel.apps.cli import common
from fifthwheel.apps.cli.app import command
from fifthwheel.base.atomic import reserved, result_folder

if TYPE_CHECKING:
    from fifthwheel.model.plant import DrivenTruck
    from fifthwheel.truck import Vehicle


@command(
    "fifthwheel simulate run.csv --vehicle cheng_cebon_2011",
    "fifthwheel simulate sweep.parquet -v truck.toml --manoeuvre sweep --speed 80 --seed 3",
    "fifthwheel simulate run.csv --model nonlinear --manoeuvre test_track",
    "fifthwheel simulate run.parquet --model nonlinear --manoeuvre everyday --sensors sensors.toml --all-truth",
    "fifthwheel simulate wet.csv --model nonlinear --with friction=0.6 --with 'bank=2 deg'",
    "fifthwheel simulate rough.csv --model nonlinear --manoeuvre straight --with roughness=B",
    "fifthwheel simulate drive.csv --model longitudinal --duration 600",
    "fifthwheel simulate brake.csv --model nonlinear --manoeuvre single_sine --braking 3",
)
def simulate(
    log: Annotated[Path, typer.Argument(help="File to write: .csv or .parquet.", show_default=False)],
    vehicle: common.VehicleOption = "cheng_cebon_2011",
    model: Annotated[
        Literal["linear", "nonlinear", "longitudinal"],
        typer.Option(
            help="The linear yaw-roll model, the nonlinear multibody vehicle with a driver, or the longitudinal "
            "motion of a vehicle of this mass in traffic on hills, with engine and gears."
        ),
    ] = "linear",
    manoeuvre: Annotated[
        str,
        typer.Option(
            help="lane_changes, sweep, random, straight, single_sine, step, pulse, sine_with_dwell or "
            "slowly_increasing_steer; with the linear model also bend, with the nonlinear model also test_track, "
            "constant_radius, slow_turns and everyday."
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
    seed: Annotated[int, typer.Option(min=0, help="Seed of the sensor noise, of random courses and rough roads.")] = 0,
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
    force: common.ForceFileOption = False,
    as_json: common.JsonOption = False,
) -> None:
    """Simulate a log with the noise of real gyros, and the true states as reference signals."""
    from fifthwheel.apps.workflow.inputs import read_vehicle
    from fifthwheel.base.errors import SignalError
    from fifthwheel.data.logs import write_record
    from fifthwheel.data.logs.files import record_writer

    record_writer(log)  # refuses an unknown format before the simulation
    truck, files = read_vehicle(vehicle), [str(log)]
    given: dict[str, Any] = {"speed": None if speed is None else speed / 3.6, "count": count, "duration": duration}
    given = {name: value for name, value in given.items() if value is not None}
    nonlinear_only = {"--sensors": sensors, "--with": properties, "--all-truth": all_truth}
    nonlinear_only |= {"--braking": braking is not None}
    with reserved(log, force=force):
        if model == "linear":
            from fifthwheel.model.simulate import simulate as run_linear

            if refused := [option for option, value in nonlinear_only.items() if value]:
                raise SignalError(f"{', '.join(refused)}: not available in the linear model; add --model nonlinear")
            record = run_linear(
                truck, manoeuvre=manoeuvre, rate=rate, seed=seed, roll=not yaw_only, name=log.stem, **given
            )
        elif model == "longitudinal":
            from fifthwheel.model.plant.powered import drive

            lateral = nonlinear_only | {"--count": count, "--speed": speed, "--yaw-only": yaw_only}
            lateral |= {"--manoeuvre": manoeuvre != "lane_changes"}
            if refused := [option for option, value in lateral.items() if value]:
                raise SignalError(f"{', '.join(refused)}: not available in the longitudinal model; remove it")
            driven = _driven(truck, seed)
            record = drive(driven, duration=duration or 600.0, rate=min(rate, 100.0), seed=seed, name=log.stem)
        else:
            if yaw_only:
                raise SignalError("--yaw-only: the nonlinear vehicle always rolls; remove it, or use --model linear")
            from fifthwheel.apps.workflow.start import named_texts
            from fifthwheel.model.manoeuvres import course as make_course
            from fifthwheel.model.plant import Plant, Properties
            from fifthwheel.model.plant.properties import with_changes
            from fifthwheel.model.plant.sensors import read_sensors

            fitted = read_sensors(sensors) if sensors else None
            course = make_course(manoeuvre, truck, braking=braking, seed=seed, **given)
            changed = named_texts("--with", properties or (), "PROPERTY=VALUE, such as 'bank=2 deg'")
            plant = Plant(truck, with_changes(Properties(), changed))
            powertrain = _driven(truck, seed) if manoeuvre == "everyday" else None
            with common.progress_bar(quiet=as_json) as progress:
                run = plant.drive(course, rate=rate, driven=powertrain, seed=seed, name=log.stem, progress=progress)
            record = run.record(fitted, seed=seed, everything=all_truth)
        write_record(record, log)
    if as_json:
        signals = {"signals": list(record.signals), "reference": list(record.reference)}
        common.print_json({"file": str(log), "files": files, "samples": len(record), "span": record.span, **signals})
    else:
        duration = record.span[1] - record.span[0]
        typer.echo(f"{', '.join(files)}: {len(record)} samples, {duration:.0f} s at {record.rate:.0f} Hz")
        if model == "linear":
            typer.echo("Its tyres are linear: identify it with --tyres linear.")


def _driven(truck: "Vehicle", seed: int) -> "DrivenTruck":
    """A powertrain with random numbers, for a vehicle."""
    import numpy as np

    from fifthwheel.model.plant import DrivenTruck

    gross = sum(unit.mass for unit in truck.units)
    return DrivenTruck.drawn(gross, np.random.default_rng(seed), wheels=sum(truck.tyres().values()))


@command(
    "fifthwheel reproduce",
    "fifthwheel reproduce --quick --out quick",
    "fifthwheel reproduce --quick --seeds 10 --arms default --vehicle truck.toml",
)
def reproduce(
    out: common.OutOption = Path("fifthwheel-reproduction"),
    quick: Annotated[
        bool, typer.Option("--quick", help="Fewer seeds and lane changes, and no study of settings.")
    ] = False,
    seeds: Annotated[
        int | None, typer.Option(min=1, max=10_000, help="Seeds of every experiment. Default: 20, with --quick 3.")
    ] = None,
    arms: Annotated[
        list[str] | None,
        typer.Option(
            help="article, default (two stages), 'one stage', or 'default, front fixed'; may be repeated. Default: all."
        ),
    ] = None,
    vehicle: Annotated[
        str | None,
        typer.Option(
            "--vehicle",
            "-v",
            help="A tractor and semitrailer in place of the truck of section 3, without section 4 and the study of "
            "settings.",
        ),
    ] = None,
    force: common.ForceOption = False,
    as_json: common.JsonOption = False,
) -> None:
    """Reproduce sections 3 and 4 of Cheng and Cebon (2011) with the nonlinear vehicle.

    Writes Figures 4 to 9, a table with published and reproduced values, the estimates of
    every seed (parameters.parquet) and time histories of seed 0 (histories.parquet). Needs
    `pip install 'fifthwheel[studies]'`. Takes about half an hour on two cores, most of
    it for one stage; with --quick three to four minutes.
    """
    from fifthwheel.apps.cheng_cebon_2011 import table
    from fifthwheel.apps.cheng_cebon_2011.reproduce import FILES
    from fifthwheel.apps.cheng_cebon_2011.reproduce import reproduce as run
    from fifthwheel.apps.workflow.inputs import read_vehicle

    truck = None if vehicle is None else read_vehicle(vehicle)
    with (
        result_folder(out, "reproduce", FILES, inputs=[Path(vehicle)] if vehicle else (), force=force) as folder,
        common.progress_bar(quiet=as_json) as progress,
    ):
        result = run(folder, quick=quick, seeds=seeds, arms=arms or (), vehicle=truck, progress=progress)
    files = common.in_folder(out, [path.name for path in result.files])
    contents = {"rows": [asdict(row) for row in result.rows]}
    common.print_result(contents, partial(table.document, result.rows), files, as_json=as_json)
