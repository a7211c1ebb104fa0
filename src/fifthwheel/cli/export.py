"""fifthwheel export"""

from pathlib import Path
from typing import Annotated

import typer

from fifthwheel._atomic import result_folder
from fifthwheel.cli import options, terminal
from fifthwheel.cli.app import command, export_app


@command(
    "fifthwheel export c --vehicle result/vehicle.toml --identification result/identification.json",
    "fifthwheel export c -v truck.toml --signal speed --signal steer.tractor.front --signal yaw_rate.tractor",
    "fifthwheel export c -v truck.toml --bank --out observer",
    of=export_app,
)
def c(
    vehicle: options.VehicleOption,
    identification: Annotated[
        Path | None,
        typer.Option(
            "--identification", "-i", help="An identification.json: sensor errors and noise that all its logs share."
        ),
    ] = None,
    signal: Annotated[
        list[str] | None,
        typer.Option(
            "--signal",
            help="A signal that the control unit has; may be repeated. Default: those of the identification, or speed, "
            "the steer angles that the vehicle file says, yaw rate and roll rate of every unit.",
        ),
    ] = None,
    min_speed: Annotated[
        float, typer.Option(min=0.5, help="The model is not valid below this speed, m/s; no states are given there.")
    ] = 5.0,
    bank: Annotated[bool, typer.Option("--bank", help="Also estimate the bank of the road.")] = False,
    out: options.OutOption = Path("fifthwheel-c"),
    force: options.ForceOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Write the state observer of a vehicle as a library in C99, with a build file and a test program.

    The library needs no heap and, of the C library, only sqrt, fabs and ceil; it computes in double or, with
    -DFW_FLOAT, in single precision. It treats missing samples, gaps and wrong measurements like `fifthwheel states`.
    """
    from fifthwheel.export import FILES, export_c
    from fifthwheel.identify import Identification
    from fifthwheel.workflow import exported_observer, read_vehicle

    truck = read_vehicle(vehicle)
    stored = Identification.load(identification) if identification else None
    observer = exported_observer(truck, signal, stored, min_speed=min_speed, estimate_bank=bank)
    read = [Path(vehicle), *([identification] if identification else [])]
    with result_folder(out, "export c", FILES, inputs=read, force=force) as folder:
        files = {path.name: path for path in export_c(observer, folder)}
        files = terminal.in_folder(out, files)
    if as_json:
        described = {"inputs": observer.inputs, "measured": observer.outputs, "states": observer.reported}
        terminal.print_json(described | {"files": terminal.as_text(files)})
    else:
        terminal.print_files(files)
