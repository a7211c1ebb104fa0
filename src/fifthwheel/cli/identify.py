"""fifthwheel identify"""

import sys
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from fifthwheel._atomic import result_folder
from fifthwheel.cli import options, terminal
from fifthwheel.cli.app import command
from fifthwheel.options import IdentifyOptions


@command(
    "fifthwheel identify run.csv --vehicle truck.toml",
    "fifthwheel identify bend.csv ramp.csv -v truck.toml -s signals.toml -o result",
    "fifthwheel identify run.csv -v truck.toml --validate other.csv",
    "fifthwheel identify run.csv -v truck.toml --exclude 12.5..14",
    "fifthwheel identify run.csv -v truck.toml --set semitrailer.mass='33.4 t +- 0.5 %' --set steer_delay='+- 5 ms'",
    "fifthwheel identify run.csv -v truck.toml --set tractor.yaw_inertia=free --set roll_stiffness='+- 5 %'",
    "fifthwheel identify snow.csv -v truck.toml --tyres saturating --set road.friction=snow",
    "fifthwheel identify later.csv --vehicle result -o result",
    "fifthwheel identify empty.csv -v empty.toml --knowledge result --load empty -o result_empty",
    "fifthwheel identify run.csv -v truck.toml --knowledge merged.json",
    "fifthwheel identify run.csv -v truck.toml --suspension-from known_load/identification.json",
    "fifthwheel identify run.csv -v truck.toml --method article --json",
    "fifthwheel identify run.csv -v truck.toml --figures svg",
)
def identify(
    logs: options.Logs,
    vehicle: options.VehicleOption,
    signals: options.SignalsOption = None,
    allow_outside: options.AllowOutsideOption = False,
    exclude: options.ExcludeOption = None,
    out: options.OutOption = Path("fifthwheel-out"),
    *,
    chosen: IdentifyOptions,
    validate: Annotated[
        list[Path] | None,
        typer.Option(
            "--validate",
            help="A log for validation: it is predicted with the identified vehicle and not used for the estimation; "
            "may be repeated.",
        ),
    ] = None,
    figures: options.FiguresOption = None,
    force: options.ForceOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Estimate cornering stiffness, yaw inertia, payload height and states from logs.

    Prints every parameter with sigma and verdict. Writes identification.json, vehicle.toml (the identified vehicle),
    knowledge.json (what the logs told, for later ones), states.parquet, report.html and run.json (digests of these
    files). With a result folder as --vehicle the estimates begin with what its logs told. --any-load,
    --suspension-from, --form, --tyres, --knowledge, --trailer and --load belong to the one-stage method; two stages
    take values and "exact" of parameters by --set.
    """
    from fifthwheel.logs import start_reader

    start_reader()
    from fifthwheel.pages.page import checked_format
    from fifthwheel.report import provenance_of_run
    from fifthwheel.report.identification import identification_document
    from fifthwheel.workflow import (
        IDENTIFICATION_FILES,
        identification_file,
        knowledge_file,
        read_truck,
        run_identification,
        start_of,
        vehicle_text,
        with_date,
        write_results,
    )

    if figures:
        checked_format(figures)
    truck = read_truck(vehicle)
    start = with_date(start_of(truck, chosen), logs[0])
    terminal.warn_of_replaced_options(chosen)
    inputs = [*logs, *(validate or [])]
    result = identification_file(vehicle)
    file = str(result.with_name("vehicle.toml")) if result else vehicle
    kept = None if chosen.knowledge is None else knowledge_file(chosen.knowledge)
    before = [chosen.suspension_from, kept, result]
    read = [*inputs, Path(file), *(path for path in (signals, *before) if path)]
    grown = [result, kept, *([Path(file)] if result else [])]  # a result grows in place
    read = [path for path in read if path not in grown or path.parent != out]
    with result_folder(out, "identify", IDENTIFICATION_FILES, inputs=read, force=force) as folder:
        records = terminal.load_records(inputs, signals, allow_outside=allow_outside, exclude=exclude)
        terminal.warn_of_axle_loads(start.vehicle, records)
        with terminal.progress_bar(quiet=as_json) as progress:
            run = run_identification(
                records[: len(logs)],
                start.vehicle,
                start.settings,
                knowledge=start.knowledge,
                occasion=start.occasion,
                validate=records[len(logs) :],
                progress=progress,
            )
        provenance = provenance_of_run(inputs, file, signals, *before, command=sys.argv[1:])
        written = write_results(run, folder, provenance=provenance, figures=figures, vehicle_text=vehicle_text(file))
        files = terminal.in_folder(out, written)
    document = partial(identification_document, run.identification, run.conclusion)
    terminal.print_result(run.as_dict(), document, files, as_json=as_json)
