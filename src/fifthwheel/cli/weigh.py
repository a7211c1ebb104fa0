"""fifthwheel weigh"""

from pathlib import Path
from typing import Annotated

import typer

from fifthwheel._atomic import reserved
from fifthwheel.cli import terminal
from fifthwheel.cli.app import command
from fifthwheel.cli.options import AllowOutsideOption, ForceFileOption, JsonOption, SignalsOption, VehicleOption


@command(
    "fifthwheel weigh run.mf4 --vehicle truck.toml --signals signals.toml --out weighed.toml",
    "fifthwheel weigh parked.csv -v truck.toml -o weighed.toml --tolerance 0.05",
)
def weigh(
    log: Annotated[
        Path, typer.Argument(help="A log with axle loads: axle_load.tractor.drive, ...", show_default=False)
    ],
    vehicle: VehicleOption,
    signals: SignalsOption = None,
    allow_outside: AllowOutsideOption = False,
    out: Annotated[Path, typer.Option("--out", "-o", help="Vehicle file to write.")] = Path("weighed.toml"),
    tolerance: Annotated[
        float,
        typer.Option(
            min=0.0,
            help="Permitted difference between the measured front axle load and the one predicted from the other "
            "axles, "
            "as a fraction of the tractor's axle loads.",
        ),
    ] = 0.02,
    force: ForceFileOption = False,
    as_json: JsonOption = False,
) -> None:
    """Set masses and CoG positions of a vehicle file from the axle loads in a log.

    Axle loads come from on-board weighing: J1939 vehicle weight, the trailer's axle load sum, or the pressure of air
    springs with a calibration (points in signals.toml). Samples at rest are used, or straight running if there are
    none. The load of the front axle may be missing. Yaw and roll inertias stay as they are.
    """
    from fifthwheel.report.terminal.signals import show_weighed
    from fifthwheel.workflow import read_vehicle, weigh_vehicle

    truck = read_vehicle(vehicle)
    with reserved(out, force=force):
        (record,) = terminal.load_records([log], signals, allow_outside=allow_outside)
        weighed = weigh_vehicle(record, truck, tolerance=tolerance)
        weighed.vehicle.save(out)
    files = {"vehicle": out}
    if as_json:
        terminal.print_json(weighed.as_dict() | {"files": terminal.as_text(files)})
    else:
        show_weighed(weighed.loads, truck, weighed.vehicle)
        terminal.print_files(files)
