"""fifthwheel states"""

import math
import sys
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from fifthwheel.apps.cli import options, terminal
from fifthwheel.apps.cli.app import command
from fifthwheel.base.atomic import one_run, result_folder
from fifthwheel.base.options import ObserverOptions


@command(
    "fifthwheel states run.csv --vehicle fifthwheel-out/vehicle.toml",
    "fifthwheel states run.csv -v fifthwheel-out",
    "fifthwheel states run.parquet -v truck.toml --json > states.json",
    "fifthwheel states run.csv -v truck.toml --at sideslip.semitrailer=-2.34",
    "fifthwheel states run.csv -v truck.toml --smooth --bank",
    "fifthwheel states run.csv -v truck.toml --friction 0.3",
)
def states(
    logs: options.Logs,
    vehicle: options.VehicleOption,
    signals: options.SignalsOption = None,
    allow_outside: options.AllowOutsideOption = False,
    out: options.OutOption = Path("fifthwheel-states"),
    *,
    chosen: ObserverOptions,
    identification: options.IdentificationOption = None,
    at: Annotated[
        list[str] | None,
        typer.Option(
            "--at",
            help="SIGNAL=X: compute the sideslip at the position x (m) on the vehicle unit. Default: at the CoG. May "
            "be repeated.",
        ),
    ] = None,
    smooth: Annotated[bool, typer.Option("--smooth", help="Use later samples too.")] = False,
    check: options.CheckOption = True,
    figures: options.FiguresOption = None,
    force: options.ForceOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Estimate sideslip, roll, articulation and load transfer of a known vehicle.

    Writes states.parquet, states.json (a summary, and the digests of the files that were read) and report.html.

    The columns of states.parquet are time, every state and its sigma (SI), status, nis and log. nis is the health of
    the filter; 1 is expected. Status: 0 ok, 1 coasting, 2 too slow, 3 input missing, 4 inconsistent: the measurements
    contradict the vehicle, the speed or the steer angle.

    load_transfer.<axle group> is the load of the right wheels less that of the left ones, divided by their sum.
    predicted_load_transfer.<axle group> is its value in 0.6 s if steer angles and speed stay as they are. Where the
    magnitude of one of them and one sigma reach 0.9, a wheel is about to lift.

    A result folder of `identify` as --vehicle stands for its vehicle.toml and its identification.json. With an
    identification.json every sigma includes the uncertainty of the vehicle's parameters. If a log was not used
    for the identification, its sensor errors are estimated from the log itself.
    """
    from fifthwheel.data.logs import start_reader

    start_reader()
    from fifthwheel.apps.workflow.inputs import read_vehicle, vehicle_and_identification
    from fifthwheel.apps.workflow.results import STATES_FILES, write_results
    from fifthwheel.apps.workflow.runs import run_states
    from fifthwheel.apps.workflow.start import named_values
    from fifthwheel.estimate.identify import Identification
    from fifthwheel.estimate.observe import ObserverSettings
    from fifthwheel.results.report import provenance_of_run
    from fifthwheel.results.report.states import states_document

    options.require_figures(figures, out)
    vehicle, identification = vehicle_and_identification(vehicle, identification)
    with one_run(*([identification, Path(vehicle)] if identification else [])):
        truck = read_vehicle(vehicle)
        stored = Identification.load(identification) if identification else None
    positions = named_values("--at", at or (), "SIGNAL=X with x in m, such as sideslip.semitrailer=-2.34", _position)
    settings = ObserverSettings(**vars(chosen), positions=positions)
    read = [*logs, Path(vehicle), *(path for path in (signals, identification) if path)]
    with result_folder(out, "states", STATES_FILES, inputs=read, force=force) as folder:
        records = terminal.load_records(logs, signals, allow_outside=allow_outside)
        with terminal.progress_bar(quiet=as_json) as progress:
            run = run_states(
                records, truck, settings, identification=stored, smooth=smooth, check=check, progress=progress
            )
        for note in run.notes:
            typer.echo(note, err=True)
        provenance = provenance_of_run(logs, vehicle, signals, identification, command=sys.argv[1:])
        written = write_results(run, folder, provenance=provenance, figures=figures, name=out.resolve().name)
        files = terminal.in_folder(out, written)
    document = partial(states_document, run.states, run.records, run.conclusion)
    terminal.print_result(run.as_dict(), document, files, as_json=as_json)


def _position(_: str, text: str) -> float:
    x = float(text)
    if not math.isfinite(x):
        raise ValueError
    return x
