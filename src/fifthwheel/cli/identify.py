"""fifthwheel identify"""

import json
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

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

if TYPE_CHECKING:
    from fifthwheel.identify import Identification, OneStage
    from fifthwheel.logs import Record
    from fifthwheel.observe import States
    from fifthwheel.vehicle import Vehicle


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
    hold: Annotated[
        list[str] | None, typer.Option("--hold", help="A parameter that keeps its value; may be repeated.")
    ] = None,
    free: Annotated[
        list[str] | None,
        typer.Option("--free", help="A parameter to seek besides the usual ones; may be repeated. One stage only."),
    ] = None,
    prior: Annotated[
        list[str] | None,
        typer.Option(
            "--prior",
            help="NAME=PART: known to that part of its value and learned beside, such as relaxation_length=0.2; "
            "a path or the end of one, 0 for exact; may be repeated. One stage only.",
        ),
    ] = None,
    consider: Annotated[
        list[str] | None,
        typer.Option(
            "--consider",
            help="NAME=PART: known to that part of its value, never learned, counted in every sigma, such as "
            "roll_stiffness=0.1; may be repeated. One stage only.",
        ),
    ] = None,
    any_load: Annotated[
        bool,
        typer.Option(
            "--any-load", help="Seek CoG height and roll inertia apart: the load may be of any shape. One stage only."
        ),
    ] = False,
    form: Annotated[
        Form, typer.Option(help="Compare the logs with a free run, or with one step ahead. One stage only.")
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
    from fifthwheel.identify import OneStage, TwoStage, article
    from fifthwheel.identify import identify as run
    from fifthwheel.observe import Observer

    truck, both = read_vehicle(vehicle), read_records([*logs, *(validate or [])], signals)
    records, unseen = both[: len(logs)], both[len(logs) :]
    common: dict[str, Any] = {"held": tuple(hold or ()), "check": check}
    told = {"--free": free, "--prior": prior, "--consider": consider, "--any-load": any_load}
    settings: OneStage | TwoStage
    if method is Method.one_stage:
        _only("--passes", passes, "two-stage")
        settings = _one_stage(
            truck, free or [], prior or [], consider or [], any_load=any_load, form=form.name, common=common
        )
    else:
        for option, value in told.items():
            _only(option, value, "one-stage")
        preset = article() if method is Method.article else TwoStage()
        settings = replace(preset, **common, passes=passes or preset.passes)
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


def _one_stage(
    truck: "Vehicle",
    free: list[str],
    prior: list[str],
    consider: list[str],
    *,
    any_load: bool,
    form: Any,
    common: dict[str, Any],
) -> "OneStage":
    """Settings of the one-stage method; what is told replaces the default for the same names."""
    from fifthwheel.identify import OneStage
    from fifthwheel.identify.parameters import one_stage_sought

    plain = OneStage(**common, uniform_payload=not any_load, form=form)
    learned, considered = parts("--prior", prior), parts("--consider", consider)
    priors = {**plain.priors, **learned}
    usual = {name: part for name, part in plain.consider.items() if name not in learned}
    both = {**usual, **considered}
    return replace(
        plain,
        free=(*one_stage_sought(truck.lumped() if any_load else truck, plain), *free) if free else None,
        priors={name: part for name, part in priors.items() if part and name not in considered},
        consider={name: part for name, part in both.items() if part},
    )


def parts(option: str, texts: list[str]) -> dict[str, float]:
    """ "name=part" as name: part.

    Raises:
        FifthwheelError: a text that is not of this form.
    """
    from fifthwheel.errors import FifthwheelError

    found = {}
    for text in texts:
        name, _, part = text.partition("=")
        try:
            found[name] = float(part.removesuffix("%")) / (100 if part.endswith("%") else 1)
        except ValueError:
            found[name] = -1.0
        if not 0 <= found[name] < 10:
            raise FifthwheelError(
                f"{option} {text}: expected NAME=PART, such as roll_stiffness=0.1 or roll_stiffness=10%"
            )
    return found


def _write(found: "Identification", records: "list[Record]", states: "list[States]", folder: Path) -> dict[str, str]:
    from fifthwheel.observe import save
    from fifthwheel.report import write_report
    from fifthwheel.vehicle import save as save_vehicle

    found.save(folder / "identification.json")
    save_vehicle(found.vehicle, folder / "vehicle.toml")
    save(states, folder / "states.parquet")
    write_report(folder / "report.html", found, records, states, title=found.vehicle.name)
    return {n: str(folder / n) for n in ("identification.json", "vehicle.toml", "states.parquet", "report.html")}
