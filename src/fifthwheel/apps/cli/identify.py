"""fifthwheel identify"""

import sys
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from fifthwheel.apps.cli import options, terminal
from fifthwheel.apps.cli.app import command
from fifthwheel.base.atomic import result_folder
from fifthwheel.base.options import IdentifyOptions


@command(
    "fifthwheel identify run.csv --vehicle truck.toml",
    "fifthwheel identify bend.csv ramp.csv -v truck.toml -s signals.toml -o result",
    "fifthwheel identify run.csv -v truck.toml --validate other.csv",
    "fifthwheel identify run.csv -v truck.toml --exclude 12.5..14",
    "fifthwheel identify run.csv -v truck.toml --set semitrailer.mass='33.4 t +- 0.5 %' --set 'steer.*.delay=+- 5 ms'",
    "fifthwheel identify run.csv -v truck.toml --set tractor.yaw_inertia=free --set roll_stiffness='+- 5 %'",
    "fifthwheel identify snow.csv -v truck.toml --tyres saturating --set road.friction=snow",
    "fifthwheel identify later.csv --vehicle result -o result",
    "fifthwheel identify empty.csv laden.csv -v truck.toml --load empty.csv=0t",
    "fifthwheel identify run.csv -v truck.toml --knowledge merged.json",
    "fifthwheel identify run.csv -v truck.toml --knowledge known_load --load timber",
    "fifthwheel identify run.csv -v truck.toml --method article --json",
    "fifthwheel identify run.csv -v truck.toml --figures svg --note 'proving ground, dry, 40 t' --author 'J. Smith'",
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

    Prints every parameter with sigma and verdict. Writes identification.json, vehicle.toml (the identified
    vehicle), knowledge.json (the information of the logs, for later ones), states.parquet, report.html and run.json
    (digests of these files). With several loads (--load) these are of the last log's, and each other load has a
    folder of its own. With a result folder as --vehicle the estimates begin with the information of its logs.
    --any-load, --form, --tyres, --knowledge, --trailer, --load and --road belong to the one-stage
    method; two stages take ± of the estimated parameters, values and "exact" by --set.
    """
    from fifthwheel.data.logs import start_reader

    start_reader()
    from fifthwheel.apps.workflow.inputs import identification_file, vehicle_file, vehicle_text
    from fifthwheel.apps.workflow.results import IDENTIFICATION_FILES, read_truck, write_loads
    from fifthwheel.apps.workflow.runs import run_loads
    from fifthwheel.apps.workflow.start import starts_of
    from fifthwheel.estimate.identify.knowledge.storage import knowledge_file
    from fifthwheel.results.report import provenance_of_run
    from fifthwheel.results.report.identification import identification_document

    options.require_figures(figures, out)
    inputs = [*logs, *(validate or [])]
    result = identification_file(vehicle)
    file = vehicle_file(vehicle)
    results = [path for path in (result, chosen.knowledge and knowledge_file(chosen.knowledge)) if path]
    before = [signals] if signals else []
    # what a result keeps may grow in place
    read = [*inputs, *before, *([] if result else [Path(file)]), *(path for path in results if path.parent != out)]
    with result_folder(out, "identify", IDENTIFICATION_FILES, inputs=read, force=force) as folder:
        starts = starts_of(read_truck(vehicle), chosen, logs)  # within the lock of a result that grows
        records = terminal.load_records(inputs, signals, allow_outside=allow_outside, exclude=exclude)
        used = dict(zip(logs, records, strict=False))
        for start in starts:
            terminal.print_load_differences(start.vehicle, [used[path] for path in start.logs])
        with terminal.progress_bar(quiet=as_json) as progress:
            runs = run_loads(starts, used, validate=records[len(logs) :], progress=progress)
        provenance = provenance_of_run(inputs, file, signals, *results, command=sys.argv[1:])
        text = vehicle_text(file)
        written = write_loads(
            starts, runs, folder, provenance=provenance, figures=figures, vehicle_text=text, name=out.resolve().name
        )
        files = terminal.in_folder(out, written)
    run = runs[-1]
    document = partial(identification_document, run.identification, run.conclusion)
    terminal.print_result(run.as_dict(), document, files, as_json=as_json)
