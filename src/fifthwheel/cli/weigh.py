"""fifthwheel weigh"""

import json
from pathlib import Path
from typing import Annotated

import typer

from fifthwheel.cli.app import (
    JsonOption,
    SignalsOption,
    VehicleOption,
    app,
    example,
    read_records,
    read_vehicle,
    say_files,
)


@app.command(
    epilog=example(
        "fifthwheel weigh drive.mf4 --vehicle truck.toml --signals signals.toml --out weighed.toml",
        "fifthwheel weigh parked.csv -v truck.toml -o weighed.toml --tolerance 0.05",
    )
)
def weigh(
    log: Annotated[Path, typer.Argument(help="A log with axle loads: axle_load.tractor.drive, …", show_default=False)],
    vehicle: VehicleOption,
    signals: SignalsOption = None,
    out: Annotated[Path, typer.Option("--out", "-o", help="The weighed truck, a TOML file.")] = Path("weighed.toml"),
    tolerance: Annotated[
        float,
        typer.Option(min=0.0, help="How far the front axle may bear other than expected, of the tractor's loads."),
    ] = 0.02,
    as_json: JsonOption = False,
) -> None:
    """Masses and CoG positions from the axle loads that a log holds.

    From on-board weighing: J1939 vehicle weight, the trailer's axle load sum, or the pressure of air springs with a
    calibration (points, in signals.toml). Taken at rest where the log has that, else straight on. The front axle may be
    missing. Yaw and roll inertias stay as they are.
    """
    from fifthwheel.errors import SignalError
    from fifthwheel.logs.weigh import static_loads
    from fifthwheel.vehicle import save, with_axle_loads

    truck, (record,) = read_vehicle(vehicle), read_records([log], signals)
    loads = static_loads(record)
    strange = [path for path in loads if path not in truck.axle_loads()]
    if strange:
        raise SignalError(
            f"axle_load.{strange[0]}: {truck.name} has no such axle group, it has {', '.join(truck.axle_loads())}"
        )
    weighed = with_axle_loads(truck, {path: load.value for path, load in loads.items()}, tolerance=tolerance)
    weighed = weighed.model_copy(update={"source": f"{truck.source}; weighed by {record.name}".removeprefix("; ")})
    save(weighed, out)
    if as_json:
        told = {
            path: {"value": one.value, "scatter": one.scatter, "samples": one.samples} for path, one in loads.items()
        }
        changed = {unit.name: {"mass": unit.mass, "cog": unit.cog} for unit in weighed.units}
        print(json.dumps({"loads": told, "units": changed, "files": {"vehicle": str(out)}}, indent=2))
        return
    from fifthwheel.report.signals import show_weighed

    show_weighed(loads, truck, weighed)
    say_files({"vehicle": str(out)})
