"""fifthwheel identify"""

import json
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fifthwheel.cli.app import (
    CheckOption,
    JsonOption,
    Logs,
    OutOption,
    SignalsOption,
    VehicleOption,
    app,
    example,
    made_folder,
    progress_bar,
    read_records,
    read_vehicle,
    say_files,
)
from fifthwheel.cli.one_stage import (
    AnyLoadOption,
    ConsiderOption,
    FreeOption,
    HoldOption,
    PriorOption,
    one_stage,
)

if TYPE_CHECKING:
    from fifthwheel.identify import Identification, OneStage
    from fifthwheel.logs import Record
    from fifthwheel.observe import States


class Method(StrEnum):
    """How to identify, by name."""

    one_stage = "one-stage"
    two_stage = "two-stage"
    article = "article"


class Form(StrEnum):
    """What the one-stage method compares with the logs, by name."""

    output_error = "output-error"
    prediction_error = "prediction-error"


@app.command(
    epilog=example(
        "fifthwheel identify drive.csv --vehicle truck.toml",
        "fifthwheel identify bend.csv ramp.csv -v truck.toml -s signals.toml -o result",
        "fifthwheel identify drive.csv -v truck.toml --hold tractor.front.cornering_stiffness",
        "fifthwheel identify drive.csv -v truck.toml --free tractor.yaw_inertia --consider roll_stiffness=5%",
        "fifthwheel identify drive.csv -v truck.toml --method article --json",
    )
)
def identify(
    logs: Logs,
    vehicle: VehicleOption,
    signals: SignalsOption = None,
    out: OutOption = Path("fifthwheel-out"),
    method: Annotated[
        Method, typer.Option(help="Everything at once, the two stages, or the two stages as the article sets them.")
    ] = Method.one_stage,
    hold: HoldOption = None,
    free: FreeOption = None,
    prior: PriorOption = None,
    consider: ConsiderOption = None,
    any_load: AnyLoadOption = False,
    form: Annotated[
        Form,
        typer.Option(help="Compare the logs with a free run, or with one step ahead. One stage only."),
    ] = Form.output_error,
    validate: Annotated[
        list[Path] | None, typer.Option("--validate", help="A log to predict only; may be repeated.")
    ] = None,
    passes: Annotated[
        int | None, typer.Option(min=1, help="At most so many times through the logs a stage. Two stages only.")
    ] = None,
    check: CheckOption = True,
    as_json: JsonOption = False,
) -> None:
    """Tyre cornering stiffnesses, trailer yaw inertia and payload height from logs, then the states.

    Reads the logs, identifies the truck, runs the state estimator, prints every parameter with sigma and verdict, and
    writes identification.json, vehicle.toml (the identified truck), states.parquet and report.html.
    """
    from fifthwheel.identify import TwoStage, article
    from fifthwheel.identify import identify as run
    from fifthwheel.observe import Observer

    truck, both = read_vehicle(vehicle), read_records([*logs, *(validate or [])], signals)
    records, unseen = both[: len(logs)], both[len(logs) :]
    settings: OneStage | TwoStage
    if method is Method.one_stage:
        _only("--passes", passes, "two-stage")
        settings = one_stage(
            truck,
            free=free,
            hold=hold,
            prior=prior,
            consider=consider,
            any_load=any_load,
            form=form.name,
            check=check,
        )
    else:
        told = {"--free": free, "--prior": prior, "--consider": consider, "--any-load": any_load}
        for option, value in told.items():
            _only(option, value, "one-stage")
        preset = article() if method is Method.article else TwoStage()
        settings = replace(preset, held=tuple(hold or ()), check=check, passes=passes or preset.passes)
    folder = made_folder(out)
    with progress_bar(quiet=as_json) as progress:
        found = run(records, truck, settings, validate=unseen, progress=progress)
        progress("states", 0, len(records))
        states = []
        for i, record in enumerate((*records, *unseen), 1):
            observer = Observer(found.vehicle, record.signals, found.observer_settings(record.name))
            states.append(observer.batch(record, found.uncertainty(record.name)))
            progress("states", i, len(records) + len(unseen))
    files = _write(found, [*records, *unseen], states, folder)
    if as_json:
        print(json.dumps(json.loads(found.to_json()) | {"files": files}, indent=2))
    else:
        from fifthwheel.report import show_identification

        show_identification(found)
        say_files(files)


def _only(option: str, value: object, method: str) -> None:
    """Refuse an option that another method has."""
    if value:
        from fifthwheel.errors import FifthwheelError

        raise FifthwheelError(f"{option}: belongs to --method {method}; leave it out, or choose that method")


def _write(found: "Identification", records: "list[Record]", states: "list[States]", folder: Path) -> dict[str, str]:
    from fifthwheel.observe import save
    from fifthwheel.report import write_report
    from fifthwheel.vehicle import save as save_vehicle

    found.save(folder / "identification.json")
    save_vehicle(found.vehicle, folder / "vehicle.toml")
    save(states, folder / "states.parquet")
    write_report(folder / "report.html", found, records, states, title=found.vehicle.name)
    return {n: str(folder / n) for n in ("identification.json", "vehicle.toml", "states.parquet", "report.html")}
