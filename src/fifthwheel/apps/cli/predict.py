"""fifthwheel check and design: predictions before an identification"""

from pathlib import Path
from typing import Annotated

import typer

from fifthwheel.apps.cli import options
from fifthwheel.apps.cli.app import Only, command, quantity_option
from fifthwheel.apps.cli.terminal import (
    load_records,
    print_files,
    print_load_differences,
    progress_bar,
    warn_of_masses,
)
from fifthwheel.base.atomic import reserved
from fifthwheel.base.options import IdentifyOptions

_OPTIONS = Only(("statements", "any_load", "knowledge", "trailer", "load", "road"))
"""Options of an identification for predictions before it."""


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
    logs: options.Logs,
    vehicle: options.VehicleOption,
    signals: options.SignalsOption = None,
    allow_outside: options.AllowOutsideOption = False,
    exclude: options.ExcludeOption = None,
    *,
    chosen: Annotated[IdentifyOptions, _OPTIONS],
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
    from fifthwheel.apps.workflow.results import read_truck
    from fifthwheel.apps.workflow.start import starts_of
    from fifthwheel.estimate.identify.design.assess import predict_sigmas
    from fifthwheel.estimate.identify.given import require_signals

    start = starts_of(read_truck(vehicle), chosen, logs)[-1]
    truck, settings = start.vehicle, start.one_stage
    with reserved(plot, force=force):
        records = load_records(logs, signals, allow_outside=allow_outside, exclude=exclude)
        warn_of_masses(truck)
        print_load_differences(truck, records)
        require_signals(settings, *records)
        if plot is not None:
            from fifthwheel.results.report.time_offsets import write_time_offsets

            write_time_offsets(plot, records, truck)
    assessment = predict_sigmas(records, truck, settings, earlier=start.earlier)
    if as_json:
        print(assessment.to_json())
    else:
        from fifthwheel.base.pages.terminal import show
        from fifthwheel.results.report.information import information_document

        show(information_document(assessment))
        if plot is not None:
            print_files({plot.name: plot})


@command(
    "fifthwheel design --vehicle truck.toml",
    "fifthwheel design -v truck.toml --target semitrailer.yaw_inertia=10% --speed 80km/h",
    "fifthwheel design -v truck.toml --target semitrailer.payload.height=15% --set semitrailer.roll_axis_height=exact",
    "fifthwheel design -v truck.toml --channels yaw_rate.tractor,articulation.semitrailer --out run.csv",
    "fifthwheel design -v truck.toml --signals signals.toml",
    "fifthwheel design -v result --load 0t",
)
def design(
    vehicle: options.VehicleOption,
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
        typer.Option(help="Speed of the run, such as 80km/h or 22m/s. Default: the best of 50, 65, 80 and 88 km/h."),
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
    force: options.ForceFileOption = False,
    as_json: options.JsonOption = False,
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
        with progress_bar(quiet=as_json) as progress:
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
        from fifthwheel.results.report.design import design_document

        show(design_document(result))
        if out:
            print_files({out.name: out})
