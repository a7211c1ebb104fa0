"""fifthwheel compare, assess and verify"""

import sys
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from fifthwheel.apps.cli import options, terminal
from fifthwheel.apps.cli.app import command, quantity_option
from fifthwheel.base.atomic import one_run, reserved, result_folder


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
    force: options.ForceFileOption = False,
    as_json: options.JsonOption = False,
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
    terminal.print_result(comparison.as_dict(), partial(comparison_document, comparison), files, as_json=as_json)


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
    figures: options.FiguresOption = None,
    force: options.ForceOption = False,
    as_json: options.JsonOption = False,
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

    options.require_figures(figures, out)
    source = identification_file(truck) or Path(truck)
    with one_run(source):
        subject = read_truck(truck)
    example = "semitrailer.payload.height=1.8m"
    changed = {
        path: read_quantity(text, unit_of(path), f"--set {path}")
        for path, text in named_texts("--set", changes or (), f"PATH=VALUE, such as {example}").items()
    }
    assessment = run_assessment(
        subject,
        speed=quantity_option("--speed", speed, "m/s", "km/h"),
        body=dict(named_texts("--body", body or (), "NAME=VALUE, such as half_track=0.93m")),
        changes={path: value for path, (value, _) in changed.items()},
        sigmas={path: sigma for path, (_, sigma) in changed.items() if sigma},
        nonlinear=not linear,
    )
    files: dict[str, Path] = {}
    if out is not None:
        with result_folder(out, "assess", ASSESSMENT_FILES, inputs=[source], force=force) as folder:
            provenance = gather_provenance([source], {}, sys.argv[1:])
            written = write_assessment(
                assessment,
                folder,
                source=source,
                identification=subject if isinstance(subject, Identification) else None,
                provenance=provenance,
                figures=figures,
            )
            files = terminal.in_folder(out, written)
    terminal.print_result(assessment.as_dict(), partial(assessment_document, assessment), files, as_json=as_json)


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
    as_json: options.JsonOption = False,
) -> None:
    """Verify that the files of a result, and its logs, map and vehicle file, are those of its run.

    Compares the SHA-256 of each file with the one recorded in run.json and in the JSON files of the result. The exit
    code is 1 if a file differs or is missing. docs/assess.md shows how to sign a result.
    """
    from fifthwheel.results.report.verification import verify as run_verification

    verification = run_verification(result, files or ())
    if as_json:
        terminal.print_json(verification.as_dict())
    else:
        terminal.print_result({}, verification.document, {}, as_json=False)
    if not verification.is_intact:
        raise typer.Exit(1)
