"""fifthwheel compare, assess, verify, evaluate and validate"""

import sys
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fifthwheel.apps.cli import common
from fifthwheel.apps.cli.app import command, quantity_option
from fifthwheel.base.atomic import one_run, reserved, result_folder

if TYPE_CHECKING:
    from contextlib import AbstractContextManager

    from fifthwheel.data.record import Record
    from fifthwheel.results.evaluate import Evaluation, Validation
    from fifthwheel.truck import Vehicle


@command(
    "fifthwheel compare monday tuesday",
    "fifthwheel compare empty laden/identification.json --csv compared.csv --html compared.html",
    "fifthwheel compare monday tuesday wednesday --json",
)
def compare(
    runs: Annotated[
        list[Path],
        typer.Argument(
            help="Result folders of `fifthwheel identify`, or their identification.json; at least two. The first is "
            "the reference.",
            show_default=False,
        ),
    ],
    csv: Annotated[Path | None, typer.Option("--csv", help="CSV file for the table, in SI units.")] = None,
    html: Annotated[Path | None, typer.Option("--html", help="HTML file for the table and a plot.")] = None,
    force: common.ForceFileOption = False,
    as_json: common.JsonOption = False,
) -> None:
    """Compare the estimates of several identifications, with their differences in units of sigma.

    A difference of more than two sigma is real with a probability of 95 %. Errors of the vehicle file and of the model
    that all runs share cancel in a difference. Runs that share logs are marked: their difference is no test.
    """
    from fifthwheel.apps.workflow.results import compare_runs, write_comparison
    from fifthwheel.results.report.comparison import comparison_document

    with reserved(csv, html, force=force):
        comparison = compare_runs(runs)
        files = write_comparison(comparison, csv=csv, html=html)
    common.print_result(comparison.as_dict(), partial(comparison_document, comparison), files, as_json=as_json)


@command(
    "fifthwheel assess truck.toml",
    "fifthwheel assess fifthwheel-out --speed 80km/h -o assessed",
    "fifthwheel assess truck.toml --set semitrailer.payload.height=1.8m",
    "fifthwheel assess truck.toml --set 'semitrailer.payload.mass=24 t +- 2 %' --body 'half_track=0.93 m +- 1 %'",
    "fifthwheel assess truck.toml --body rear_overhang=2.7m --linear --json > assessment.json",
    "fifthwheel assess truck.toml --set driveline.launch_torque=1800Nm --set driveline.lowest_gear=11.7 "
    "--set driveline.final_drive=3.1 --set driveline.tyre_radius=0.5m",
)
def assess(
    truck: Annotated[
        str,
        typer.Argument(
            help="A vehicle file, a name from `fifthwheel vehicle`, or the result folder of `fifthwheel identify`.",
            show_default=False,
        ),
    ],
    changes: Annotated[
        list[str] | None,
        typer.Option("--set", help="PATH=VALUE: another value of a parameter, such as 1.8m; may be repeated."),
    ] = None,
    body: Annotated[
        list[str] | None,
        typer.Option(
            "--body",
            help="NAME=VALUE of half_track, width, front_overhang, rear_overhang, or an overhang between two units, "
            "such as semitrailer.front_overhang, or of brakes.AXLE_GROUP, a fraction of the braking force; a vehicle "
            "file has none of them; may be repeated.",
        ),
    ] = None,
    speed: Annotated[
        str, typer.Option(help="Speed of the high-speed measures, with a unit; a number is in km/h.")
    ] = "88 km/h",
    linear: Annotated[bool, typer.Option("--linear", help="Do not simulate the nonlinear truck.")] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", help="Folder for assessment.json, assess.html and evidence.html. Default: no files."
        ),
    ] = None,
    figures: common.FiguresOption = None,
    force: common.ForceOption = False,
    as_json: common.JsonOption = False,
) -> None:
    """Predict what a truck does: rollover, off-tracking, rearward amplification, damping, swept path.

    Each measure has a sigma, from the joint covariance of an identification or from the uncertainties in a vehicle
    file, and the probability that it meets the threshold of the Australian performance-based standards. The linear
    model and the nonlinear truck stand side by side. docs/assess.md defines the measures.
    """
    from fifthwheel.apps.workflow.inputs import identification_file
    from fifthwheel.apps.workflow.results import ASSESSMENT_FILES, read_truck, write_assessment
    from fifthwheel.apps.workflow.start import named_texts
    from fifthwheel.estimate.identify import Identification
    from fifthwheel.results.assess import assess as run_assessment
    from fifthwheel.results.report import gather_provenance
    from fifthwheel.results.report.assessment import assessment_document
    from fifthwheel.truck import unit_of
    from fifthwheel.truck.toml_format import read_quantity

    common.require_figures(figures, out)
    source = identification_file(truck) or Path(truck)
    with one_run(source):
        subject = read_truck(truck)
    example = "semitrailer.payload.height=1.8m"
    changed = {
        path: read_quantity(text, unit_of(path), f"--set {path}")
        for path, text in named_texts("--set", changes or (), f"PATH=VALUE, such as {example}").items()
    }
    files: dict[str, Path] = {}
    with _folder(out, "assess", ASSESSMENT_FILES, [source], force=force) as folder:
        assessment = run_assessment(
            subject,
            speed=quantity_option("--speed", speed, "m/s", "km/h"),
            body=dict(named_texts("--body", body or (), "NAME=VALUE, such as half_track=0.93m")),
            changes={path: value for path, (value, _) in changed.items()},
            sigmas={path: sigma for path, (_, sigma) in changed.items() if sigma},
            nonlinear=not linear,
        )
        if out is not None and folder is not None:
            provenance = gather_provenance([source], {}, sys.argv[1:])
            written = write_assessment(
                assessment,
                folder,
                source=source,
                identification=subject if isinstance(subject, Identification) else None,
                provenance=provenance,
                figures=figures,
            )
            files = common.in_folder(out, written)
    common.print_result(assessment.as_dict(), partial(assessment_document, assessment), files, as_json=as_json)


@command(
    "fifthwheel verify assessed",
    "fifthwheel verify handed-over/assessed --files handed-over/logs --files handed-over",
    "fifthwheel verify assessed/assessment.json --json",
)
def verify(
    result: Annotated[
        Path, typer.Argument(help="A result folder, or a JSON file of results in it.", show_default=False)
    ],
    files: Annotated[
        list[Path] | None,
        typer.Option("--files", help="Folder with files that are not at their recorded path; may be repeated."),
    ] = None,
    as_json: common.JsonOption = False,
) -> None:
    """Verify that the files of a result, and its logs, map and vehicle file, are those of its run.

    Compares the SHA-256 of each file with the one recorded in run.json and in the JSON files of the result. The exit
    code is 1 if a file differs or is missing. docs/assess.md shows how to sign a result.
    """
    from fifthwheel.results.report.provenance import verify as run_verification

    verification = run_verification(result, files or ())
    if as_json:
        common.print_json(verification.as_dict())
    else:
        common.print_result({}, verification.document, {}, as_json=False)
    if not verification.is_intact:
        raise typer.Exit(1)


LogArgument = Annotated[
    Path,
    typer.Argument(help="Log of one test run, of any format of docs/logs.md, such as MF4.", show_default=False),
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
    signals: common.SignalsOption = None,
    check: common.CheckOption = True,
    allow_outside: common.AllowOutsideOption = False,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Folder for evaluation.json and evaluation.html. Default: no files."),
    ] = None,
    figures: common.FiguresOption = None,
    force: common.ForceOption = False,
    as_json: common.JsonOption = False,
) -> None:
    """Evaluate the log of a test by a method of ISO: understeer, gains, response times, damping.

    Each measure has a sigma from the log itself. The conditions of ISO 15037-2 that a log shows are listed, met or not.
    docs/evaluate.md defines the measures and says what is implemented of each standard.
    """
    from fifthwheel.apps.workflow.inputs import read_vehicle
    from fifthwheel.apps.workflow.results import EVALUATION_FILES
    from fifthwheel.results.evaluate import evaluate as run_evaluation
    from fifthwheel.results.report.comparison import evaluation_document

    common.require_figures(figures, out)
    truck = read_vehicle(vehicle) if vehicle else None
    inputs = _inputs([log], vehicle, [signals])
    with _folder(out, "evaluate", EVALUATION_FILES, inputs, force=force) as folder:
        (record,) = common.load_records([log], signals, allow_outside=allow_outside)
        evaluation = run_evaluation(record, test, vehicle=truck, check=check)
        files = _written(evaluation, out, folder, [log], vehicle, [signals], figures=figures)
    common.print_result(evaluation.as_dict(), partial(evaluation_document, evaluation), files, as_json=as_json)


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
    signals: common.SignalsOption = None,
    results_signals: Annotated[
        Path | None, typer.Option("--results-signals", help="Signal map of RESULTS, as --signals of LOG.")
    ] = None,
    allow_outside: common.AllowOutsideOption = False,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Folder for validation.json and validation.html. Default: no files."),
    ] = None,
    figures: common.FiguresOption = None,
    force: common.ForceOption = False,
    as_json: common.JsonOption = False,
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
    from fifthwheel.results.report.comparison import validation_document

    common.require_figures(figures, out)
    stated = named_texts("--tolerance", tolerance or (), "NAME=VALUE, such as yaw_rate=5%")
    truck = read_vehicle(vehicle) if vehicle else None
    if _is_model(log):
        raise FifthwheelError(f"{log}: expected a log; give the model first: fifthwheel validate {log} {results}")
    if results_signals and _is_model(results):
        raise FifthwheelError("--results-signals: a map of a file of results; omit it for an FMU or plant")
    read, maps = [results, log], [signals, results_signals]
    with _folder(out, "validate", VALIDATION_FILES, _inputs(read, vehicle, maps), force=force) as folder:
        (measured,) = common.load_records([log], signals, allow_outside=allow_outside)
        if _is_model(results):
            simulated = _driven(results, truck, measured)
        else:
            (simulated,) = common.load_records([results], results_signals, allow_outside=allow_outside)
        validation = run_validation(simulated, measured, test, tolerances=stated, vehicle=truck)
        files = _written(validation, out, folder, read, vehicle, maps, figures=figures)
    common.print_result(validation.as_dict(), partial(validation_document, validation), files, as_json=as_json)


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


def _folder(
    out: Path | None, command: str, names: tuple[str, ...], inputs: list[Path], *, force: bool
) -> "AbstractContextManager[Path | None]":
    """The folder of a result that is written in the block, so that it is refused before a computation; None without."""
    return nullcontext() if out is None else result_folder(out, command, names, inputs=inputs, force=force)


def _inputs(logs: list[Path], vehicle: str | None, maps: list[Path | None]) -> list[Path]:
    from fifthwheel.apps.workflow.inputs import vehicle_file

    file = vehicle_file(vehicle) if vehicle else None
    return [*logs, *(Path(path) for path in (file, *maps) if path)]


def _written(
    evaluation: "Evaluation | Validation",
    out: Path | None,
    folder: Path | None,
    logs: list[Path],
    vehicle: str | None,
    maps: list[Path | None],
    *,
    figures: str | None,
) -> dict[str, Path]:
    """Write the files of a result to its folder, if there is one."""
    from fifthwheel.apps.workflow.inputs import vehicle_file
    from fifthwheel.apps.workflow.results import write_evaluation
    from fifthwheel.results.report import gather_provenance, provenance_of_run

    if out is None or folder is None:
        return {}
    file = vehicle_file(vehicle) if vehicle else None
    origin = provenance_of_run(logs, file, *maps, command=sys.argv[1:]) if file else None
    origin = origin or gather_provenance(_inputs(logs, vehicle, maps), {}, sys.argv[1:])
    return common.in_folder(out, write_evaluation(evaluation, folder, provenance=origin, figures=figures))
