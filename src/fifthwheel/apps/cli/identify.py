"""fifthwheel signals, check, design, identify and states: from a log to the states of its truck"""

import math
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fifthwheel.apps.cli import common
from fifthwheel.apps.cli.app import Only, command, quantity_option
from fifthwheel.base.atomic import atomic_write, one_run, reserved, result_folder
from fifthwheel.base.options import IdentifyOptions, ObserverOptions

if TYPE_CHECKING:
    from fifthwheel.truck import Vehicle

_OPTIONS = Only(("statements", "any_load", "knowledge", "trailer", "load", "road"))
"""Options of an identification for predictions before it."""


@command(
    "fifthwheel signals run.mf4",
    "fifthwheel signals run.csv --vehicle truck.toml --out signals.toml",
    "fifthwheel signals monday.csv tuesday.csv --vehicle truck.toml --out signals.toml",
    "fifthwheel signals run.blf --database truck.dbc --database trailer.arxml --out signals.toml",
    "fifthwheel signals run.mf4 --signals signals.toml --save run.parquet",
)
def signals(
    logs: common.Logs,
    signals: common.SignalsOption = None,
    allow_outside: common.AllowOutsideOption = False,
    database: Annotated[
        list[Path] | None,
        typer.Option("--database", "-d", help="DBC or ARXML file for CAN frames; may be repeated."),
    ] = None,
    vehicle: Annotated[
        str | None,
        typer.Option("--vehicle", "-v", help="The vehicle: names of its units, and wheelbase for the steering ratio."),
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="File for the proposed signals.toml.")] = None,
    save: Annotated[
        Path | None, typer.Option("--save", help="With --signals: file for the record, .csv or .parquet.")
    ] = None,
    whole: Annotated[bool, typer.Option("--whole", help="Read all of a large file, not a sample.")] = False,
    force: common.ForceFileOption = False,
    as_json: common.JsonOption = False,
) -> None:
    """List the contents of a log, or of all logs of one logger, and propose a signals.toml.

    Lists every column with unit, sampling rate, range and missing samples. Proposes which column is which signal, from
    names, units and the kinematics of a turning vehicle (signs, degrees, steering ratio). Of a text table, MDF or
    Parquet file above 100 MB, a sample is read, unless --whole is given. Edit the proposal, then use it with --signals:
    here to see the resulting record, and in the other commands.
    """
    from fifthwheel.apps.workflow.inputs import read_vehicle, survey_files
    from fifthwheel.base.errors import FifthwheelError

    truck = read_vehicle(vehicle) if vehicle else None
    if signals is not None:
        with reserved(save, force=force):
            if len(logs) > 1:
                raise FifthwheelError("--signals: shows the record of one log, got several; give them one by one")
            _show_record(logs[0], signals, truck, save, as_json, allow_outside=allow_outside)
        return
    if save is not None:
        raise FifthwheelError("--save: needs --signals; propose a map with --out first, and check it")
    from fifthwheel.base.pages.terminal import show
    from fifthwheel.data.logs.map_text import is_unchanged
    from fifthwheel.results.report.logs import survey_document

    with reserved(out, force=force or is_unchanged(out)), common.reading_bar(logs) as progress:
        contents = survey_files(logs, truck, databases=database or [], map_file=out, whole=whole, progress=progress)
    if as_json:
        common.print_json(contents.as_dict())
        return
    show(survey_document(contents.survey, contents.proposal))
    typer.echo(f"\nWritten: {out}" if out is not None else f"\n{contents.signals_toml}", nl=out is not None)


def _show_record(
    log: Path, signals: Path, truck: "Vehicle | None", save: Path | None, as_json: bool, *, allow_outside: bool
) -> None:
    """Show the record that a map makes of a log."""
    from fifthwheel.data.logs import write_record
    from fifthwheel.data.logs.files import record_writer
    from fifthwheel.estimate.time_bases import check_signals

    if save is not None:
        record_writer(save)  # refuses an unknown format before reading
    (record,) = common.load_records([log], signals, allow_outside=allow_outside)
    findings = check_signals(record, truck)
    if save is not None:
        write_record(record, save)
    if as_json:
        contents = {"name": record.name, "span": record.span, "rate": record.rate}
        contents |= {name: list(getattr(record, name)) for name in ("signals", "reference", "notes")}
        common.print_json(contents | {"findings": [str(finding) for finding in findings]})
        return
    from fifthwheel.base.pages.terminal import show
    from fifthwheel.results.report.logs import record_document

    show(record_document(record, findings))
    if save is not None:
        common.print_files({save.name: save})


@command(
    "fifthwheel check run.csv --vehicle truck.toml",
    "fifthwheel check bend.csv ramp.csv -v truck.toml -s signals.toml",
    "fifthwheel check run.csv -v truck.toml --exclude 12.5..14",
    "fifthwheel check later.csv -v result",
    "fifthwheel check run.csv -v truck.toml --set semitrailer.roll_stiffness=exact",
    "fifthwheel check run.csv -v truck.toml --set tractor.yaw_inertia=free --json",
    "fifthwheel check run.csv -v truck.toml --plot time.html",
)
def check(
    logs: common.Logs,
    vehicle: common.VehicleOption,
    signals: common.SignalsOption = None,
    allow_outside: common.AllowOutsideOption = False,
    exclude: common.ExcludeOption = None,
    *,
    chosen: Annotated[IdentifyOptions, _OPTIONS],
    plot: Annotated[
        Path | None, typer.Option(help="HTML file for measured and predicted channels, with their time offsets.")
    ] = None,
    force: common.ForceFileOption = False,
    as_json: common.JsonOption = False,
) -> None:
    """Predict the sigma of each parameter from these logs, and what would reduce it.

    Predicts the sigma of each parameter that `identify` would estimate from all logs together. Uses the values of the
    vehicle file and does no fit. For each parameter with a large sigma, it predicts the sigma if another parameter were
    known, another manoeuvre driven or another signal logged. It also lists implausible signals, and late
    ones.
    """
    from fifthwheel.apps.workflow.results import read_truck
    from fifthwheel.apps.workflow.start import starts_of
    from fifthwheel.estimate.design.assess import predict_sigmas
    from fifthwheel.estimate.identify.given import require_signals

    start = starts_of(read_truck(vehicle), chosen, logs)[-1]
    truck, settings = start.vehicle, start.one_stage
    with reserved(plot, force=force):
        records = common.load_records(logs, signals, allow_outside=allow_outside, exclude=exclude)
        common.warn_of_masses(truck)
        common.print_load_differences(truck, records)
        require_signals(settings, *records)
        if plot is not None:
            from fifthwheel.results.report.logs import write_time_offsets

            write_time_offsets(plot, records, truck)
    assessment = predict_sigmas(records, truck, settings, earlier=start.earlier)
    if as_json:
        print(assessment.to_json())
    else:
        from fifthwheel.base.pages.terminal import show
        from fifthwheel.results.report.information import information_document

        show(information_document(assessment))
        if plot is not None:
            common.print_files({plot.name: plot})


@command(
    "fifthwheel design --vehicle truck.toml",
    "fifthwheel design -v truck.toml --target semitrailer.yaw_inertia=10% --speed 80km/h",
    "fifthwheel design -v truck.toml --target semitrailer.payload.height=15% --set semitrailer.roll_axis_height=exact",
    "fifthwheel design -v truck.toml --channels yaw_rate.tractor,articulation.semitrailer --out run.csv",
    "fifthwheel design -v truck.toml --signals signals.toml",
    "fifthwheel design -v result --load 0t",
)
def design(
    vehicle: common.VehicleOption,
    target: Annotated[
        list[str] | None,
        typer.Option(
            "--target",
            help="NAME=FRACTION: required sigma of a parameter as a fraction of its value, such as "
            "semitrailer.yaw_inertia=10%; may be repeated. Default: 5% of every cornering stiffness and of the yaw "
            "inertia of every unit behind the first.",
        ),
    ] = None,
    speed: Annotated[
        str | None,
        typer.Option(
            help="Speed of the run, such as 22m/s; a number alone is in km/h. Default: the best of 50, 65, 80, 88 km/h."
        ),
    ] = None,
    max_speed: Annotated[str, typer.Option(help="Highest speed to try; above 88km/h it is tried too.")] = "88km/h",
    max_acceleration: Annotated[
        float, typer.Option(min=0.1, max=4, help="Largest lateral acceleration of any unit, m/s^2.")
    ] = 1.5,
    channels: Annotated[
        list[str] | None,
        typer.Option(
            "--channels",
            help="Signals to be logged in addition to speed and steer angle, separated by commas; may be repeated. "
            "Default: yaw rate and roll rate of every unit.",
        ),
    ] = None,
    *,
    signals: Annotated[
        Path | None, typer.Option("--signals", "-s", help="Signal map; its sensor classes and '+-' give the priors.")
    ] = None,
    chosen: Annotated[IdentifyOptions, _OPTIONS],
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="File for time, speed and steer angle of the run: .csv or .parquet."),
    ] = None,
    force: common.ForceFileOption = False,
    as_json: common.JsonOption = False,
) -> None:
    """Design the shortest test run that reaches the required accuracy.

    Tries lane changes, sweeps, random steering and bends, repeated one to twelve times, at several speeds and lateral
    accelerations. For each it predicts the sigma of every parameter after `identify`, at the values of the vehicle
    file, with the noise of the sensors and of a good road (class A of ISO 8608). If no run reaches the targets, it
    prints the best run and the parameters that limit the accuracy.
    """
    from fifthwheel.apps.workflow.results import read_truck
    from fifthwheel.apps.workflow.runs import design_run
    from fifthwheel.apps.workflow.start import starts_of, targets_of
    from fifthwheel.data.logs import SignalMap, write_record
    from fifthwheel.data.logs.files import record_writer

    if out:
        record_writer(out)  # refuses an unknown format before the search
    (start,) = starts_of(read_truck(vehicle), chosen)
    with reserved(out, force=force):
        with common.progress_bar(quiet=as_json) as progress:
            result = design_run(
                start.vehicle,
                targets_of(target or ()),
                start.one_stage,
                earlier=start.earlier,
                channels=[name.strip() for text in channels or [] for name in text.split(",")],
                sensors=SignalMap.load(signals, allow_outside=True).sensors if signals else {},
                speed=quantity_option("--speed", speed, "m/s", "km/h") if speed else None,
                max_speed=quantity_option("--max-speed", max_speed, "m/s", "km/h"),
                max_acceleration=max_acceleration,
                progress=progress,
            )
        if out:
            write_record(result.record(), out)
    if as_json:
        print(result.to_json(**({"files": {out.name: str(out)}} if out else {})))
    else:
        from fifthwheel.base.pages.terminal import show
        from fifthwheel.results.report.information import design_document

        show(design_document(result))
        if out:
            common.print_files({out.name: out})


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
    logs: common.Logs,
    vehicle: common.VehicleOption,
    signals: common.SignalsOption = None,
    allow_outside: common.AllowOutsideOption = False,
    exclude: common.ExcludeOption = None,
    out: common.OutOption = Path("fifthwheel-out"),
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
    figures: common.FiguresOption = None,
    force: common.ForceOption = False,
    as_json: common.JsonOption = False,
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

    common.require_figures(figures, out)
    inputs = [*logs, *(validate or [])]
    result = identification_file(vehicle)
    file = vehicle_file(vehicle)
    results = [path for path in (result, chosen.knowledge and knowledge_file(chosen.knowledge)) if path]
    before = [signals] if signals else []
    # what a result keeps may grow in place
    read = [*inputs, *before, *([] if result else [Path(file)]), *(path for path in results if path.parent != out)]
    with result_folder(out, "identify", IDENTIFICATION_FILES, inputs=read, force=force) as folder:
        starts = starts_of(read_truck(vehicle), chosen, logs)  # within the lock of a result that grows
        records = common.load_records(inputs, signals, allow_outside=allow_outside, exclude=exclude)
        used = dict(zip(logs, records, strict=False))
        for start in starts:
            common.print_load_differences(start.vehicle, [used[path] for path in start.logs])
        with common.progress_bar(quiet=as_json) as progress:
            runs = run_loads(starts, used, validate=records[len(logs) :], progress=progress)
        provenance = provenance_of_run(inputs, file, signals, *results, command=sys.argv[1:])
        text = vehicle_text(file)
        written = write_loads(
            starts, runs, folder, provenance=provenance, figures=figures, vehicle_text=text, name=out.resolve().name
        )
        files = common.in_folder(out, written)
    run = runs[-1]
    document = partial(identification_document, run.identification, run.conclusion)
    common.print_result(run.as_dict(), document, files, as_json=as_json)


@command(
    "fifthwheel states run.csv --vehicle fifthwheel-out/vehicle.toml",
    "fifthwheel states run.csv -v fifthwheel-out",
    "fifthwheel states run.parquet -v truck.toml --json > states.json",
    "fifthwheel states run.csv -v truck.toml --at sideslip.semitrailer=-2.34",
    "fifthwheel states run.csv -v truck.toml --smooth --bank",
    "fifthwheel states run.csv -v truck.toml --friction 0.3",
    "fifthwheel states run.csv -v truck.toml --out states.mf4",
)
def states(
    logs: common.Logs,
    vehicle: common.VehicleOption,
    signals: common.SignalsOption = None,
    allow_outside: common.AllowOutsideOption = False,
    out: Annotated[
        Path,
        typer.Option("--out", "-o", help="Folder for the results, or one file for the states only: .mf4 or .mcap."),
    ] = Path("fifthwheel-states"),
    *,
    chosen: ObserverOptions,
    identification: common.IdentificationOption = None,
    at: Annotated[
        list[str] | None,
        typer.Option(
            "--at",
            help="SIGNAL=X: compute the sideslip at the position x (m) on the vehicle unit. Default: at the CoG. May "
            "be repeated.",
        ),
    ] = None,
    smooth: Annotated[bool, typer.Option("--smooth", help="Use later samples too.")] = False,
    check: common.CheckOption = True,
    figures: common.FiguresOption = None,
    force: common.ForceOption = False,
    as_json: common.JsonOption = False,
) -> None:
    """Estimate sideslip, roll, articulation and load transfer of a known vehicle.

    Writes states.parquet, states.json (a summary, and the digests of the files that were read) and report.html. A file
    with the ending .mf4 has all columns in SI; one with .mcap has messages of ROS 2 with the velocity and its
    covariance, TwistWithCovarianceStamped, and the articulation angles, JointState, where the status is ok or coasting.

    The columns of states.parquet are time, every state and its sigma (SI), status, nis and log. nis is the health of
    the filter; 1 is expected. Status: 0 ok, 1 coasting, 2 too slow, 3 input missing, 4 inconsistent: the measurements
    contradict the vehicle, the speed or the steer angle; 5 settling.

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
    from fifthwheel.apps.workflow.results import STATES_FILES, states_writer, write_results
    from fifthwheel.apps.workflow.runs import run_states
    from fifthwheel.apps.workflow.start import named_values
    from fifthwheel.estimate.identify import Identification
    from fifthwheel.estimate.observe import ObserverSettings
    from fifthwheel.results.report import provenance_of_run
    from fifthwheel.results.report.states import states_document

    write_file = states_writer(out, len(logs))
    common.require_figures(figures, None if write_file else out)
    vehicle, identification = vehicle_and_identification(vehicle, identification)
    with one_run(*([identification, Path(vehicle)] if identification else [])):
        truck = read_vehicle(vehicle)
        stored = Identification.load(identification) if identification else None
    positions = named_values("--at", at or (), "SIGNAL=X with x in m, such as sideslip.semitrailer=-2.34", _position)
    settings = ObserverSettings(**vars(chosen), positions=positions)
    read = [*logs, Path(vehicle), *(path for path in (signals, identification) if path)]
    with (
        reserved(out if write_file else None, force=force),
        atomic_write(out)
        if write_file
        else result_folder(out, "states", STATES_FILES, inputs=read, force=force) as target,
    ):
        records = common.load_records(logs, signals, allow_outside=allow_outside)
        with common.progress_bar(quiet=as_json) as progress:
            run = run_states(
                records, truck, settings, identification=stored, smooth=smooth, check=check, progress=progress
            )
        for note in run.notes:
            typer.echo(note, err=True)
        if write_file:
            write_file(run.states, run.records, target)
            files = {out.name: out}
        else:
            provenance = provenance_of_run(logs, vehicle, signals, identification, command=sys.argv[1:])
            written = write_results(run, target, provenance=provenance, figures=figures, name=out.resolve().name)
            files = common.in_folder(out, written)
    document = partial(states_document, run.states, run.records, run.conclusion)
    common.print_result(run.as_dict(), document, files, as_json=as_json)


def _position(text: str) -> float:
    x = float(text)
    if not math.isfinite(x):
        raise ValueError
    return x
