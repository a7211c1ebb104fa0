"""fifthwheel evaluate and validate"""

import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fifthwheel.apps.cli import options, terminal
from fifthwheel.apps.cli.app import command
from fifthwheel.base.atomic import result_folder

if TYPE_CHECKING:
    from fifthwheel.data.record import Record
    from fifthwheel.results.evaluate import Evaluation, Validation
    from fifthwheel.truck import Vehicle

LogArgument = Annotated[
    Path,
    typer.Argument(help="Log of one test run: CSV, Parquet, MF4, MATLAB, MCAP or a CAN trace.", show_default=False),
]
TestOption = Annotated[
    str,
    typer.Option(
        help="steady_state, frequency_response, step, lane_change, pulse or sine_with_dwell.", show_default=False
    ),
]
OptionalVehicle = Annotated[
    str | None,
    typer.Option(
        "--vehicle",
        "-v",
        help="The vehicle: a TOML file, a name from `fifthwheel vehicle`, or a result folder. Its wheelbase is for "
        "steady_state; its units are in their order.",
    ),
]


@command(
    "fifthwheel evaluate circle.csv --test steady_state --vehicle truck.toml",
    "fifthwheel evaluate random.mf4 --test frequency_response -s signals.toml -o evaluated",
    "fifthwheel evaluate lane-changes.csv --test lane_change -v truck.toml --json",
    "fifthwheel simulate step.csv --manoeuvre step && fifthwheel evaluate step.csv --test step",
)
def evaluate(
    log: LogArgument,
    test: TestOption,
    vehicle: OptionalVehicle = None,
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
    from fifthwheel.apps.workflow.inputs import read_vehicle
    from fifthwheel.apps.workflow.results import EVALUATION_FILES
    from fifthwheel.results.evaluate import evaluate as run_evaluation
    from fifthwheel.results.report.evaluation import evaluation_document

    options.require_figures(figures, out)
    truck = read_vehicle(vehicle) if vehicle else None
    (record,) = terminal.load_records([log], signals, allow_outside=allow_outside)
    evaluation = run_evaluation(record, test, vehicle=truck, check=check)
    written = _written(
        "evaluate", evaluation, out, EVALUATION_FILES, [log], vehicle, [signals], figures=figures, force=force
    )
    terminal.print_result(evaluation.as_dict(), partial(evaluation_document, evaluation), written, as_json=as_json)


@command(
    "fifthwheel validate results.csv circle.mf4 -s signals.toml --test steady_state --vehicle truck.toml -o validated",
    "fifthwheel validate results.csv log.csv --test steady_state -v truck.toml --tolerance understeer_gradient=5%",
    "fifthwheel validate results.csv log.csv --test step --tolerance 'yaw_rate=5% + 0.2deg/s' --json",
    "fifthwheel validate truck.fmu log.csv --test step -v truck.toml",
    "fifthwheel validate plant log.csv --test step -v truck.toml",
)
def validate(
    results: Annotated[
        Path,
        typer.Argument(
            help="Results of a simulation, in any format of a log; an FMU, which is run with the speed and steer angle "
            "of LOG; or `plant`, the nonlinear truck.",
            show_default=False,
        ),
    ],
    log: LogArgument,
    test: TestOption,
    vehicle: OptionalVehicle = None,
    tolerance: Annotated[
        list[str] | None,
        typer.Option(
            help="NAME=VALUE of a measure or curve, or the beginning of its name, such as yaw_rate=5% or "
            "'response_time=10% + 20ms'; may be repeated. Default: docs/evaluate.md."
        ),
    ] = None,
    signals: options.SignalsOption = None,
    results_signals: Annotated[
        Path | None, typer.Option("--results-signals", help="Signal map of RESULTS, as --signals of LOG.")
    ] = None,
    allow_outside: options.AllowOutsideOption = False,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Folder for validation.json and validation.html. Default: no files."),
    ] = None,
    figures: options.FiguresOption = None,
    force: options.ForceOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Validate a model: the results of its simulation against the measured log of the same test.

    Both are evaluated by the same test method. Each measure and each characteristic curve is inside or outside of its
    tolerance, or undecided where sigma is too large. The default tolerances are ours, and those of no standard.
    """
    from fifthwheel.apps.workflow.inputs import read_vehicle
    from fifthwheel.apps.workflow.results import VALIDATION_FILES
    from fifthwheel.apps.workflow.start import named_texts
    from fifthwheel.base.errors import FifthwheelError
    from fifthwheel.results.evaluate import validate as run_validation
    from fifthwheel.results.report.evaluation import validation_document

    options.require_figures(figures, out)
    stated = named_texts("--tolerance", tolerance or (), "NAME=VALUE, such as yaw_rate=5%")
    truck = read_vehicle(vehicle) if vehicle else None
    if _is_model(log):
        raise FifthwheelError(f"{log}: expected a log; give the model first: fifthwheel validate {log} {results}")
    (measured,) = terminal.load_records([log], signals, allow_outside=allow_outside)
    if _is_model(results):
        if results_signals:
            raise FifthwheelError("--results-signals: a map of a file of results; omit it for an FMU or plant")
        simulated = _driven(results, truck, measured)
    else:
        (simulated,) = terminal.load_records([results], results_signals, allow_outside=allow_outside)
    validation = run_validation(simulated, measured, test, tolerances=stated, vehicle=truck)
    maps = [signals, results_signals]
    written = _written(
        "validate", validation, out, VALIDATION_FILES, [results, log], vehicle, maps, figures=figures, force=force
    )
    terminal.print_result(validation.as_dict(), partial(validation_document, validation), written, as_json=as_json)


def _is_model(path: Path) -> bool:
    """Whether an argument of `validate` is an FMU or the nonlinear truck."""
    return str(path) == "plant" or path.suffix == ".fmu"


def _driven(model: Path, truck: "Vehicle | None", log: "Record") -> "Record":
    """The results of an FMU or of the nonlinear truck with the inputs of a log."""
    from fifthwheel.base.errors import FifthwheelError
    from fifthwheel.results.evaluate.driven_model import fmu_results, plant_results

    if model.suffix == ".fmu":
        return fmu_results(model, log)
    if truck is None:
        raise FifthwheelError("plant: needs the truck; add --vehicle")
    return plant_results(truck, log)


def _written(
    command: str,
    evaluation: "Evaluation | Validation",
    out: Path | None,
    names: tuple[str, ...],
    logs: list[Path],
    vehicle: str | None,
    maps: list[Path | None],
    *,
    figures: str | None,
    force: bool,
) -> dict[str, Path]:
    """Write the files of a result to its folder, if there is one."""
    from fifthwheel.apps.workflow.inputs import vehicle_file
    from fifthwheel.apps.workflow.results import write_evaluation
    from fifthwheel.results.report import gather_provenance, provenance_of_run

    if out is None:
        return {}
    file = vehicle_file(vehicle) if vehicle else None
    inputs = [*logs, *(Path(path) for path in (file, *maps) if path)]
    with result_folder(out, command, names, inputs=inputs, force=force) as folder:
        origin = provenance_of_run(logs, file, *maps, command=sys.argv[1:]) if file else None
        origin = origin or gather_provenance(inputs, {}, sys.argv[1:])
        return terminal.in_folder(out, write_evaluation(evaluation, folder, provenance=origin, figures=figures))
