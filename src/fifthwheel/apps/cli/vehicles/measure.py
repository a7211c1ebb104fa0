"""fifthwheel weigh, mass and roll-test"""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fifthwheel.apps.cli import terminal
from fifthwheel.apps.cli.app import command
from fifthwheel.apps.cli.options import (
    AllowOutsideOption,
    ExcludeOption,
    ForceFileOption,
    JsonOption,
    Logs,
    SignalsOption,
    VehicleOption,
)
from fifthwheel.base.atomic import reserved, write_text

if TYPE_CHECKING:
    from fifthwheel.truck import Measured


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
    none. The load of the front axle may be missing. Yaw and roll inertias stay as they are. Weights of units and of the
    vehicle are named and not used: `fifthwheel mass` uses them.

    A slip file has the loads as masses in tables `[laden]`, `[solo]` (the tractor alone) and `[empty]`, such as
    `tractor.drive = "10500 kg"`, and their standard deviation, `accuracy = "1 %"`. The file then states how well
    masses and CoG positions are known.
    """
    from fifthwheel.apps.workflow.inputs import read_vehicle, vehicle_text
    from fifthwheel.apps.workflow.measured_vehicle import weigh_by_slip, weigh_vehicle
    from fifthwheel.base.errors import FifthwheelError
    from fifthwheel.results.report.vehicle import weighed_document
    from fifthwheel.truck.slip import Slip

    truck, text = read_vehicle(vehicle), vehicle_text(vehicle)
    if (log is None) == (slip is None):
        raise FifthwheelError(f"--slip: expected either a log or a slip, got {'both' if log else 'none'}; give one")
    with reserved(out, force=force):
        if log is not None:
            (record,) = terminal.load_records([log], signals, allow_outside=allow_outside)
            weighed = weigh_vehicle(record, text, tolerance=tolerance)
        elif slip is not None:
            weighed = weigh_by_slip(Slip.load(slip), text, name=slip.name)
        write_text(out, weighed.text)
    document = partial(weighed_document, weighed.loads, truck, weighed.vehicle, weighed.unused)
    terminal.print_result(weighed.as_dict(), document, {"vehicle": out}, as_json=as_json)


@command(
    "fifthwheel mass drive.csv --vehicle truck.toml --out driven.toml",
    "fifthwheel mass morning.mf4 noon.mf4 -v truck.toml -s signals.toml -o driven.toml",
)
def mass(
    logs: Logs,
    vehicle: VehicleOption,
    signals: SignalsOption = None,
    allow_outside: AllowOutsideOption = False,
    exclude: ExcludeOption = None,
    out: Annotated[Path, typer.Option("--out", "-o", help="Vehicle file to write.")] = Path("driven.toml"),
    force: ForceFileOption = False,
    as_json: JsonOption = False,
) -> None:
    """Set the payload of a vehicle file from logs of ordinary driving with one load, and from axle loads in them.

    The mass follows from the force of the engine and the acceleration, on roads of unknown grade. The logs have speed,
    braking.<unit>, engine_speed and engine_torque, or drive_force in place of the engine; and if possible
    driveline_engaged, friction_torque and grade. `[driveline]` of the vehicle file states losses, scales and rotating
    masses. Axle loads and weights (axle_load.<axle group>, weight.<unit>, gross_weight) add to that or replace it; with
    axle loads the CoG of the laden unit follows, too. The new file states how well mass and CoG are known. Unladen
    masses stay; yaw inertia, stiffness and relaxation length of the tyres follow the load. If only the mass was wrong
    in the file, copy the masses from the new file.
    """
    from fifthwheel.apps.workflow.inputs import read_vehicle, vehicle_text
    from fifthwheel.apps.workflow.measured_vehicle import drive_vehicle
    from fifthwheel.results.report.vehicle import mass_document

    truck, text = read_vehicle(vehicle), vehicle_text(vehicle)
    with reserved(out, force=force):
        records = terminal.load_records(logs, signals, allow_outside=allow_outside, exclude=exclude)
        terminal.warn_of_masses(truck)
        driven = drive_vehicle(records, text)
        write_text(out, driven.text)
    document = partial(mass_document, driven.result, driven.before, driven.changed)
    terminal.print_result(driven.as_dict(), document, {"vehicle": out}, as_json=as_json)


@command(
    'fifthwheel roll-test -v truck.toml --load "2 t +- 10 kg" --shift "0.9 m +- 5 mm" --roll "0.42 deg +- 0.01 deg"',
    'fifthwheel roll-test -v truck.toml --load "2 t +- 1 %" --shift "0.9 m +- 1 %" --roll "0.42 deg +- 2 %" '
    '--displacement "0.7 mm +- 0.1 mm" --height "0.9 m +- 5 mm"',
)
def roll_test(
    vehicle: VehicleOption,
    load: Annotated[str, typer.Option(help="Mass of the load that is moved sideways.")],
    shift: Annotated[str, typer.Option(help="Distance by which it is moved.")],
    roll: Annotated[str, typer.Option(help="Change of the roll angle of the body.")],
    displacement: Annotated[
        str | None, typer.Option(help="Displacement of a point of the body to the side to which it leans.")
    ] = None,
    height: Annotated[str | None, typer.Option(help="Height of that point above the ground.")] = None,
    unit: Annotated[str | None, typer.Option(help="Unit with the load. Default: the last one.")] = None,
    out: Annotated[Path, typer.Option("--out", "-o", help="Vehicle file to write.")] = Path("tested.toml"),
    force: ForceFileOption = False,
    as_json: JsonOption = False,
) -> None:
    """Set roll stiffness and roll axis height of a vehicle file from a static test.

    A known load on the parked truck is moved sideways; an inclinometer measures how far the body rolls. A dial gauge
    near the height of the roll axis, if there is one, measures how far the body moves to the side there. State the
    standard deviation of each reading after +-. The vehicle file describes the truck with the load.
    """
    from fifthwheel.apps.workflow.inputs import read_vehicle
    from fifthwheel.apps.workflow.measured_vehicle import changed_numbers, roll_tested_vehicle
    from fifthwheel.results.report.vehicle import roll_test_document
    from fifthwheel.truck import RollTest

    truck = read_vehicle(vehicle)
    test = RollTest(
        unit=unit or truck.units[-1].name,
        load=_measured("--load", load, "kg"),
        shift=_measured("--shift", shift, "m"),
        roll=_measured("--roll", roll, "rad"),
        displacement=_measured("--displacement", displacement, "m") if displacement else None,
        height=_measured("--height", height, "m") if height else None,
    )
    with reserved(out, force=force):
        tested = roll_tested_vehicle(truck, test)
        tested.save(out)
    changed = changed_numbers(truck, tested)
    document = partial(roll_test_document, tested, changed)
    terminal.print_result({"parameters": changed}, document, {"vehicle": out}, as_json=as_json)


def _measured(option: str, text: str, si: str) -> "Measured":
    """A reading with its standard deviation; a FifthwheelError if the text is none."""
    from fifthwheel.base.errors import FifthwheelError
    from fifthwheel.base.units import uncertain_quantity
    from fifthwheel.truck import Measured

    try:
        value, sigma = uncertain_quantity(text, si)
    except FifthwheelError as error:
        raise FifthwheelError(f"{option}: {error}") from None
    if sigma is None:
        raise FifthwheelError(f"{option}: expected a standard deviation after '+-', got {text}; write '{text} +- 1 %'")
    return Measured(value, sigma)
