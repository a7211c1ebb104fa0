"""fifthwheel weigh"""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from fifthwheel._atomic import atomic_write, reserved
from fifthwheel.cli import terminal
from fifthwheel.cli.app import command
from fifthwheel.cli.options import AllowOutsideOption, ForceFileOption, JsonOption, SignalsOption, VehicleOption


@command(
    "fifthwheel weigh run.mf4 --vehicle truck.toml --signals signals.toml --out weighed.toml",
    "fifthwheel weigh parked.csv -v truck.toml -o weighed.toml --tolerance 0.05",
    "fifthwheel weigh --slip slip.toml -v truck.toml -o weighed.toml",
)
def weigh(
    vehicle: VehicleOption,
    log: Annotated[
        Path | None, typer.Argument(help="A log with axle loads: axle_load.tractor.drive, ...", show_default=False)
    ] = None,
    slip: Annotated[
        Path | None, typer.Option(help="A file with the loads of a weighbridge, instead of a log.", show_default=False)
    ] = None,
    signals: SignalsOption = None,
    allow_outside: AllowOutsideOption = False,
    out: Annotated[Path, typer.Option("--out", "-o", help="Vehicle file to write.")] = Path("weighed.toml"),
    tolerance: Annotated[
        float,
        typer.Option(
            min=0.0,
            help="Permitted difference between the measured front axle load and the one predicted from the other "
            "axles, as a fraction of the tractor's axle loads.",
        ),
    ] = 0.02,
    force: ForceFileOption = False,
    as_json: JsonOption = False,
) -> None:
    """Set masses and CoG positions of a vehicle file from the axle loads in a log, or from weighbridge slips.

    Axle loads come from on-board weighing: J1939 vehicle weight, the trailer's axle load sum, or the pressure of air
    springs with a calibration (points in signals.toml). Samples at rest are used, or straight running if there are
    none. The load of the front axle may be missing. Yaw and roll inertias stay as they are.

    A slip file has the loads as masses in tables `[laden]`, `[solo]` (the tractor alone) and `[empty]`, such as
    `tractor.drive = "10500 kg"`, and their standard deviation, `accuracy = "1 %"`. The file then states how well
    masses and CoG positions are known.
    """
    from fifthwheel.errors import FifthwheelError
    from fifthwheel.report.vehicle import weighed_document
    from fifthwheel.vehicle.weighing import Slip
    from fifthwheel.workflow import read_vehicle, vehicle_text, weigh_by_slip, weigh_vehicle

    truck, text = read_vehicle(vehicle), vehicle_text(vehicle)
    if (log is None) == (slip is None):
        raise FifthwheelError(f"--slip: expected either a log or a slip, got {'both' if log else 'none'}; give one")
    with reserved(out, force=force):
        if log is not None:
            (record,) = terminal.load_records([log], signals, allow_outside=allow_outside)
            weighed = weigh_vehicle(record, truck, tolerance=tolerance, text=text)
        elif slip is not None:
            weighed = weigh_by_slip(Slip.load(slip), text, name=slip.name)
        with atomic_write(out) as temporary:
            temporary.write_text(weighed.text or weighed.vehicle.to_toml(), encoding="utf-8")
    document = partial(weighed_document, weighed.loads, truck, weighed.vehicle)
    terminal.print_result(weighed.as_dict(), document, {"vehicle": out}, as_json=as_json)
