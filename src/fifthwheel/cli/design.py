"""fifthwheel design"""

from pathlib import Path
from typing import Annotated

import typer

from fifthwheel._atomic import reserved
from fifthwheel.cli import options
from fifthwheel.cli.app import OF_A_DESIGN, command, quantity_option
from fifthwheel.cli.terminal import print_files, progress_bar
from fifthwheel.options import IdentifyOptions


@command(
    "fifthwheel design --vehicle truck.toml",
    "fifthwheel design -v truck.toml --target semitrailer.yaw_inertia=10% --speed 80km/h",
    "fifthwheel design -v truck.toml --target semitrailer.payload.height=15% --fix semitrailer.roll_axis_height",
    "fifthwheel design -v truck.toml --channels yaw_rate.tractor,articulation.semitrailer --out run.csv",
)
def design(
    vehicle: options.VehicleOption,
    target: Annotated[
        list[str] | None,
        typer.Option(
            "--target",
            help="NAME=FRACTION: required sigma of a parameter as a fraction of its value, such as "
            "semitrailer.yaw_inertia=10%; may be repeated. Default: 5% of every cornering stiffness and of the yaw "
            "inertia of every unit behind the first.",
        ),
    ] = None,
    speed: Annotated[
        str | None,
        typer.Option(help="Speed of the run, such as 80km/h or 22m/s. Default: the best of 50, 65, 80 and 88 km/h."),
    ] = None,
    max_speed: Annotated[str, typer.Option(help="Highest speed to try.")] = "88km/h",
    max_acceleration: Annotated[
        float, typer.Option(min=0.1, max=4, help="Largest lateral acceleration of any unit, m/s^2.")
    ] = 1.5,
    channels: Annotated[
        list[str] | None,
        typer.Option(
            "--channels",
            help="Signals to be logged in addition to speed and steer angle, separated by commas; may be repeated. "
            "Default: yaw rate and roll rate of every unit.",
        ),
    ] = None,
    *,
    chosen: Annotated[IdentifyOptions, OF_A_DESIGN],
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="File for time, speed and steer angle of the run: .csv or .parquet."),
    ] = None,
    force: options.ForceFileOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Design the shortest test run that reaches the required accuracy.

    Tries lane changes, sweeps, random steering and bends, repeated one to twelve times, at several speeds and lateral
    accelerations. For each it predicts the sigma of every parameter after `identify`, at the values of the vehicle
    file, with the noise of the sensors and of a good road (class A of ISO 8608). If no run reaches the targets, it
    prints the best run and the parameters that limit the accuracy.
    """
    from fifthwheel.logs import write_record
    from fifthwheel.logs.files import record_writer
    from fifthwheel.workflow import chosen_one_stage, design_run, read_vehicle
    from fifthwheel.workflow.settings import fractions

    if out:
        record_writer(out)  # refuses an unknown format before the search
    truck = read_vehicle(vehicle)
    truck, settings = chosen_one_stage(truck, chosen)
    with reserved(out, force=force):
        with progress_bar(quiet=as_json) as progress:
            result = design_run(
                truck,
                fractions("--target", target or ()),
                settings,
                channels=[name.strip() for text in channels or [] for name in text.split(",")],
                speed=quantity_option("--speed", speed, "m/s", "km/h") if speed else None,
                max_speed=quantity_option("--max-speed", max_speed, "m/s", "km/h"),
                max_acceleration=max_acceleration,
                progress=progress,
            )
        if out:
            write_record(result.record(), out)
    if as_json:
        print(result.to_json(**({"files": {out.name: str(out)}} if out else {})))
    else:
        from fifthwheel.pages.terminal import show
        from fifthwheel.report.design import design_document

        show(design_document(result))
        if out:
            print_files({out.name: out})
