"""fifthwheel design"""

from pathlib import Path
from typing import Annotated

import typer

from fifthwheel.cli.app import JsonOption, VehicleOption, app, example, progress_bar, read_vehicle, say_files
from fifthwheel.cli.one_stage import (
    AnyLoadOption,
    ConsiderOption,
    FreeOption,
    HoldOption,
    PriorOption,
    one_stage,
    parts,
)


@app.command(
    epilog=example(
        "fifthwheel design --vehicle truck.toml",
        "fifthwheel design -v truck.toml --want semitrailer.yaw_inertia=2% --speed 80km/h",
        "fifthwheel design -v truck.toml --want semitrailer.payload.height=10% --hold semitrailer.roll_axis_height",
        "fifthwheel design -v truck.toml --channels yaw_rate.tractor,articulation.semitrailer --out drive.csv",
    )
)
def design(
    vehicle: VehicleOption,
    want: Annotated[
        list[str] | None,
        typer.Option(
            "--want",
            help="NAME=PART: a parameter and the sigma that is wanted of it, as a part of its value, such as "
            "semitrailer.yaw_inertia=2%; may be repeated. By default 5% of every cornering stiffness and of the yaw "
            "inertia of every unit behind the first.",
        ),
    ] = None,
    speed: Annotated[
        str | None,
        typer.Option(help="To be driven at, such as 80km/h or 22m/s; 50, 65, 80 and 88 km/h are tried by default."),
    ] = None,
    max_speed: Annotated[str, typer.Option(help="The fastest that is tried.")] = "88km/h",
    max_acceleration: Annotated[
        float, typer.Option(min=0.1, max=4, help="Largest lateral acceleration of any unit, m/s^2.")
    ] = 1.5,
    channels: Annotated[
        list[str] | None,
        typer.Option(
            "--channels",
            help="A signal that will be logged beside speed and steer angle, or several with commas between; may be "
            "repeated. By default the yaw and the roll rate of every unit.",
        ),
    ] = None,
    hold: HoldOption = None,
    free: FreeOption = None,
    prior: PriorOption = None,
    consider: ConsiderOption = None,
    any_load: AnyLoadOption = False,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="A file for time, speed and steer angle of the drive: .csv or .parquet."),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """The shortest drive that tells what is wanted of a truck, as well as it is wanted.

    Tries lane changes, sweeps, random steer and bends, once to twelve times, at several speeds and accelerations, and
    reckons for each, at the values of the vehicle file, how well `identify` would know every parameter afterwards.
    Where no drive tells enough, says which comes nearest and what stands in the way.
    """
    from dataclasses import replace

    from fifthwheel.identify.plan import plan
    from fifthwheel.identify.search import Planning
    from fifthwheel.logs import write
    from fifthwheel.logs.files import writer

    if out:
        writer(out)  # before the search
    truck = read_vehicle(vehicle)
    settings = one_stage(truck, free=free, hold=hold, prior=prior, consider=consider, any_load=any_load)
    truck = truck.lumped() if any_load else truck
    usual, fastest = Planning(), _speed("--max-speed", max_speed)
    speeds = (_speed("--speed", speed),) if speed else tuple(u for u in usual.speeds if u < fastest + 0.01)
    with progress_bar(quiet=as_json) as progress:
        found = plan(
            truck,
            parts("--want", want or []),
            settings,
            channels=[name.strip() for text in channels or [] for name in text.split(",")],
            planning=replace(usual, speeds=speeds or (fastest,), max_acceleration=max_acceleration),
            progress=progress,
        )
    if out:
        write(found.record(), out)
    if as_json:
        print(found.to_json(**({"files": {out.name: str(out)}} if out else {})))
    else:
        from fifthwheel.report.plan import show_plan

        show_plan(found)
        if out:
            say_files({out.name: str(out)})


def _speed(option: str, text: str) -> float:
    """A speed in m/s; without a unit it is in km/h.

    Raises:
        SignalError: it is no speed.
    """
    from fifthwheel.errors import SignalError
    from fifthwheel.logs.units import quantity

    try:
        return quantity(f"{float(text)} km/h" if _bare(text) else text, "m/s")
    except SignalError as error:
        raise SignalError(f"{option}: {error}") from error


def _bare(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
