"""fifthwheel identify"""

import sys
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from fifthwheel._atomic import result_folder
from fifthwheel.cli import options, terminal
from fifthwheel.cli.app import command


class Method(StrEnum):
    """Identification method."""

    one_stage = "one-stage"
    two_stage = "two-stage"
    article = "article"


class Form(StrEnum):
    """Form of the one-stage method."""

    output_error = "output-error"
    prediction_error = "prediction-error"


class TyreChoice(StrEnum):
    """Law of the side forces in the one-stage method."""

    linear = "linear"
    saturating = "saturating"
    auto = "auto"


@command(
    "fifthwheel identify run.csv --vehicle truck.toml",
    "fifthwheel identify bend.csv ramp.csv -v truck.toml -s signals.toml -o result",
    "fifthwheel identify run.csv -v truck.toml --validate other.csv",
    "fifthwheel identify run.csv -v truck.toml --exclude 12.5..14",
    "fifthwheel identify run.csv -v truck.toml --fix tractor.front.cornering_stiffness",
    "fifthwheel identify run.csv -v truck.toml --free tractor.yaw_inertia --consider roll_stiffness=5%",
    "fifthwheel identify snow.csv -v truck.toml --tyres saturating --friction 0.3",
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
    method: Annotated[
        Method,
        typer.Option(
            help="one-stage; two-stage: dual Kalman filter; article: two-stage with the settings of Cheng and Cebon "
            "(2011)."
        ),
    ] = Method.one_stage,
    fix: options.FixOption = None,
    free: options.FreeOption = None,
    prior: options.PriorOption = None,
    consider: options.ConsiderOption = None,
    any_load: options.AnyLoadOption = False,
    sensor: options.SensorOption = None,
    suspension_from: options.SuspensionOption = None,
    form: Annotated[
        Form,
        typer.Option(help="Compare the logs with a free-running model, or with one-step predictions."),
    ] = Form.output_error,
    tyres: Annotated[
        TyreChoice,
        typer.Option(
            help="linear; saturating: at the friction of the road, which is estimated too; auto: what the logs support."
        ),
    ] = TyreChoice.linear,
    friction: Annotated[
        float | None,
        typer.Option(
            min=0.05,
            max=1.5,
            help="Probable peak friction of the road for tyres that saturate: 0.75 dry, 0.6 wet, 0.3 snow. Default: "
            "0.75.",
        ),
    ] = None,
    validate: Annotated[
        list[Path] | None,
        typer.Option(
            "--validate",
            help="A log for validation: it is predicted with the identified vehicle and not used for the estimation; "
            "may be repeated.",
        ),
    ] = None,
    passes: Annotated[
        int | None,
        typer.Option(min=1, help="Maximum number of passes through the logs in each stage; two stages only."),
    ] = None,
    check: options.CheckOption = True,
    figures: options.FiguresOption = None,
    force: options.ForceOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Estimate cornering stiffness, yaw inertia, payload height and states from logs.

    Prints every parameter with sigma and verdict. Writes identification.json, vehicle.toml (the identified vehicle),
    states.parquet, report.html and run.json (digests of these files). --free, --prior, --consider, --any-load,
    --sensor, --suspension-from, --form, --tyres and --friction belong to the one-stage method.
    """
    from fifthwheel.logs import start_reader

    start_reader()
    from fifthwheel.pages.page import checked_format
    from fifthwheel.report import provenance_of_run
    from fifthwheel.report.identification import identification_document
    from fifthwheel.workflow import (
        IDENTIFICATION_FILES,
        IdentifyOptions,
        read_vehicle,
        run_identification,
        vehicle_text,
        write_results,
    )

    if figures:
        checked_format(figures)
    truck = read_vehicle(vehicle)
    chosen = IdentifyOptions(
        method=method,
        form=form,
        tyres=tyres,
        friction=friction,
        fix=fix or (),
        free=free or (),
        prior=prior or (),
        consider=consider or (),
        sensor=sensor or (),
        any_load=any_load,
        passes=passes,
        check=check,
    )
    truck, settings = chosen.settings(truck, options.chosen_identification(suspension_from))
    inputs = [*logs, *(validate or [])]
    read = [*inputs, Path(vehicle), *(path for path in (signals, suspension_from) if path)]
    with result_folder(out, "identify", IDENTIFICATION_FILES, inputs=read, force=force) as folder:
        records = terminal.load_records(inputs, signals, allow_outside=allow_outside, exclude=exclude)
        terminal.warn_of_axle_loads(truck, records)
        with terminal.progress_bar(quiet=as_json) as progress:
            run = run_identification(
                records[: len(logs)], truck, settings, validate=records[len(logs) :], progress=progress
            )
        provenance = provenance_of_run(inputs, vehicle, signals, suspension_from, command=sys.argv[1:])
        written = write_results(run, folder, provenance=provenance, figures=figures, vehicle_text=vehicle_text(vehicle))
        files = terminal.in_folder(out, written)
    document = partial(identification_document, run.identification, run.conclusion)
    terminal.print_result(run.as_dict(), document, files, as_json=as_json)
