"""fifthwheel check"""

from typing import TYPE_CHECKING, Annotated

import typer

from fifthwheel.cli.app import (
    JsonOption,
    Logs,
    SignalsOption,
    VehicleOption,
    app,
    example,
    read_records,
    read_vehicle,
)

if TYPE_CHECKING:
    from fifthwheel.identify import OneStage
    from fifthwheel.vehicle import Vehicle

FreeOption = Annotated[
    list[str] | None,
    typer.Option("--free", help="A parameter to seek besides the usual ones; may be repeated."),
]
HoldOption = Annotated[
    list[str] | None,
    typer.Option("--hold", help="A parameter that keeps its value, taken for known; may be repeated."),
]


@app.command(
    epilog=example(
        "fifthwheel check drive.csv --vehicle truck.toml",
        "fifthwheel check bend.csv ramp.csv -v truck.toml -s signals.toml",
        "fifthwheel check drive.csv -v truck.toml --hold semitrailer.roll_stiffness",
        "fifthwheel check drive.csv -v truck.toml --free tractor.yaw_inertia --json",
    )
)
def check(
    logs: Logs,
    vehicle: VehicleOption,
    signals: SignalsOption = None,
    free: FreeOption = None,
    hold: HoldOption = None,
    as_json: JsonOption = False,
) -> None:
    """Before `identify`: what these logs can tell of the truck, what they cannot, and what would help.

    Reckons, at the values of the vehicle file and without a fit, how well the logs together would tell each parameter,
    and how much better if something were known, driven or logged besides. Lists all that looks wrong with the logs.
    """
    from fifthwheel.identify.outlook import outlook

    truck = read_vehicle(vehicle)
    found = outlook(read_records(logs, signals), truck, settings(truck, free, hold))
    if as_json:
        print(found.to_json())
    else:
        from fifthwheel.report.outlook import show_outlook

        show_outlook(found)


def settings(truck: "Vehicle", free: list[str] | None, hold: list[str] | None) -> "OneStage":
    """Of the fit that is looked out on: the default one, with more that is sought and some that is held."""
    from dataclasses import replace

    from fifthwheel.identify import OneStage
    from fifthwheel.identify.parameters import one_stage_sought

    usual = OneStage(held=tuple(hold or ()))
    return replace(usual, free=(*one_stage_sought(truck, usual), *free)) if free else usual
