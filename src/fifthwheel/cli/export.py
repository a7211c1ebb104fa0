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
    "fifthwheel export c -v truck.toml --learner --passes 0 --out learner",
    of=export_app,
)
def c(
    vehicle: options.VehicleOption,
    identification: Annotated[
        Path | None,
        typer.Option(
            "--identification",
            "-i",
            help="An identification.json: sensor errors and noise that all its logs share; of a learner, the settings.",
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
    learner: Annotated[
        bool, typer.Option("--learner", help="Write the learner, which also estimates the parameters of the vehicle.")
    ] = False,
    passes: Annotated[
        int | None,
        typer.Option(min=0, help="Of a learner: passes over a segment with excitation; 0 saves memory."),
    ] = None,
    segment: Annotated[
        int | None, typer.Option(min=1, help="Of a learner: samples of such a segment; they stay in memory.")
    ] = None,
    out: options.OutOption = Path("fifthwheel-c"),
    force: options.ForceOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Write the state observer of a vehicle, or its learner, as a library in C99 with a build file and a test program.

    The library needs no heap and, of the C library, only sqrt, fabs, exp and ceil; it computes in double or, with
    -DFW_FLOAT, in single precision. It treats missing samples, gaps and wrong measurements like `fifthwheel states`;
    a learner does what `Learner` does in Python.
    """
    from fifthwheel.errors import FifthwheelError
    from fifthwheel.export import FILES, LEARNER_FILES, export_c
    from fifthwheel.filters.initial_state import INITIAL_SIGMA
    from fifthwheel.identify import Identification
    from fifthwheel.identify.online import Learner
    from fifthwheel.observe import Observer
    from fifthwheel.workflow import exported_learner, exported_observer, read_vehicle

    truck = read_vehicle(vehicle)
    stored = Identification.load(identification) if identification else None
    estimator: Observer | Learner
    if learner:
        if bank:
            raise FifthwheelError("--bank: a learner always has the bank of the road as a state; omit --bank")
        estimator = exported_learner(truck, signal, stored, min_speed=min_speed, passes=passes, segment=segment)
        problem = estimator.live.problem
        described = {
            "inputs": problem.inputs,
            "measured": problem.outputs,
            "estimated": tuple(u.name for u in problem.estimated),
        }
    else:
        if passes is not None or segment is not None:
            raise FifthwheelError("--passes, --segment: settings of a learner; add --learner, or omit them")
        prior = INITIAL_SIGMA["bank"] if bank else None
        estimator = exported_observer(truck, signal, stored, min_speed=min_speed, bank=prior)
        described = {"inputs": estimator.inputs, "measured": estimator.outputs, "states": estimator.reported}
    read = [Path(vehicle), *([identification] if identification else [])]
    names = LEARNER_FILES if learner else FILES
    with result_folder(out, "export c", names, inputs=read, force=force) as folder:
        files = {path.name: path for path in export_c(estimator, folder)}
        files = terminal.in_folder(out, files)
    if as_json:
        terminal.print_json(described | {"files": terminal.as_text(files)})
    else:
        terminal.print_files(files)
