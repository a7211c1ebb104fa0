"""fifthwheel evaluate"""

import sys
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from fifthwheel._atomic import result_folder
from fifthwheel.cli import options, terminal
from fifthwheel.cli.app import command


@command(
    "fifthwheel evaluate circle.csv --test steady_state --vehicle truck.toml",
    "fifthwheel evaluate random.mf4 --test frequency_response -s signals.toml -o evaluated",
    "fifthwheel evaluate lane-changes.csv --test lane_change -v truck.toml --json",
    "fifthwheel simulate step.csv --manoeuvre step && fifthwheel evaluate step.csv --test step",
)
def evaluate(
    log: Annotated[
        Path,
        typer.Argument(help="Log of one test run: CSV, Parquet, MF4, MATLAB, MCAP or a CAN trace.", show_default=False),
    ],
    test: Annotated[
        str,
        typer.Option(
            help="steady_state, frequency_response, step, lane_change, pulse or sine_with_dwell.", show_default=False
        ),
    ],
    vehicle: Annotated[
        str | None,
        typer.Option(
            "--vehicle",
            "-v",
            help="The vehicle: a TOML file, a name from `fifthwheel vehicle`, or a result folder. Its wheelbase is for "
            "steady_state; its units are in their order.",
        ),
    ] = None,
    signals: options.SignalsOption = None,
    check: options.CheckOption = True,
    allow_outside: options.AllowOutsideOption = False,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Folder for evaluation.json and evaluation.html. Default: no files."),
    ] = None,
    figures: options.FiguresOption = None,
    force: options.ForceOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Evaluate the log of a test by a method of ISO: understeer, gains, response times, damping.

    Each measure has a sigma from the log itself. The conditions of ISO 15037-2 that a log shows are listed, met or not.
    docs/evaluate.md defines the measures and says what is implemented of each standard.
    """
    from fifthwheel.errors import FifthwheelError
    from fifthwheel.evaluate import evaluate as run_evaluation
    from fifthwheel.pages.page import checked_format
    from fifthwheel.report import gather_provenance, provenance_of_run
    from fifthwheel.report.evaluation import evaluation_document
    from fifthwheel.workflow import EVALUATION_FILES, read_vehicle, write_evaluation

    if figures:
        checked_format(figures)
        if out is None:
            raise FifthwheelError("--figures: needs a folder; add -o FOLDER")
    truck = read_vehicle(vehicle) if vehicle else None
    (record,) = terminal.load_records([log], signals, allow_outside=allow_outside)
    evaluation = run_evaluation(record, test, vehicle=truck, check=check)
    files: dict[str, Path] = {}
    if out is not None:
        read = [log, *([Path(vehicle)] if vehicle else []), *([signals] if signals else [])]
        with result_folder(out, "evaluate", EVALUATION_FILES, inputs=read, force=force) as folder:
            origin = provenance_of_run([log], vehicle, signals, command=sys.argv[1:]) if vehicle else None
            origin = origin or gather_provenance(read, {}, sys.argv[1:])
            written = write_evaluation(evaluation, folder, provenance=origin, figures=figures)
            files = terminal.in_folder(out, written)
    terminal.print_result(evaluation.as_dict(), partial(evaluation_document, evaluation), files, as_json=as_json)
