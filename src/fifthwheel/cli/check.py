"""fifthwheel check"""

from pathlib import Path
from typing import Annotated

import typer

from fifthwheel._atomic import reserved
from fifthwheel.cli import options
from fifthwheel.cli.app import OF_LOGS, command
from fifthwheel.cli.terminal import load_records, print_files, warn_of_axle_loads
from fifthwheel.options import IdentifyOptions


@command(
    "fifthwheel check run.csv --vehicle truck.toml",
    "fifthwheel check bend.csv ramp.csv -v truck.toml -s signals.toml",
    "fifthwheel check run.csv -v truck.toml --exclude 12.5..14",
    "fifthwheel check run.csv -v truck.toml --fix semitrailer.roll_stiffness",
    "fifthwheel check run.csv -v truck.toml --free tractor.yaw_inertia --json",
    "fifthwheel check run.csv -v truck.toml --plot time.html",
)
def check(
    logs: options.Logs,
    vehicle: options.VehicleOption,
    signals: options.SignalsOption = None,
    allow_outside: options.AllowOutsideOption = False,
    exclude: options.ExcludeOption = None,
    *,
    chosen: Annotated[IdentifyOptions, OF_LOGS],
    plot: Annotated[
        Path | None, typer.Option(help="HTML file for measured and predicted channels, with their time offsets.")
    ] = None,
    force: options.ForceFileOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Predict the sigma of each parameter from these logs, and what would reduce it.

    Predicts the sigma of each parameter that `identify` would estimate from all logs together. Uses the values of the
    vehicle file and does no fit. For each parameter with a large sigma, it predicts the sigma if another parameter were
    known, another manoeuvre driven or another signal logged. It also lists implausible signals, and late
    ones.
    """
    from fifthwheel.identify.design.assess import assess_information
    from fifthwheel.workflow import chosen_one_stage, read_vehicle

    truck = read_vehicle(vehicle)
    truck, settings = chosen_one_stage(truck, chosen)
    with reserved(plot, force=force):
        records = load_records(logs, signals, allow_outside=allow_outside, exclude=exclude)
        warn_of_axle_loads(truck, records)
        if plot is not None:
            from fifthwheel.report.time_offsets import write_time_offsets

            write_time_offsets(plot, records, truck)
    assessment = assess_information(records, truck, settings)
    if as_json:
        print(assessment.to_json())
    else:
        from fifthwheel.pages.terminal import show
        from fifthwheel.report.information import information_document

        show(information_document(assessment))
        if plot is not None:
            print_files({plot.name: plot})
