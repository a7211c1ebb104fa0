"""fifthwheel identify"""

import json
import sys
from contextlib import suppress
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fifthwheel.cli.app import (
    CheckOption,
    FiguresOption,
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
    say_loads,
)
from fifthwheel.cli.one_stage import (
    AnyLoadOption,
    ConsiderOption,
    FreeOption,
    HoldOption,
    PriorOption,
    SensorOption,
    one_stage,
)

if TYPE_CHECKING:
    from fifthwheel.identify import Identification, OneStage
    from fifthwheel.identify.outlook import Outlook
    from fifthwheel.logs import Record
    from fifthwheel.observe import States
    from fifthwheel.report import Provenance
    from fifthwheel.report.conclusion import Conclusion


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
        "fifthwheel identify drive.csv -v truck.toml --figures svg",
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
    sensor: SensorOption = None,
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
    figures: FiguresOption = None,
    as_json: JsonOption = False,
) -> None:
    """Tyre cornering stiffnesses, trailer yaw inertia and payload height from logs, then the states.

    Reads the logs, identifies the truck, runs the state estimator, prints every parameter with sigma and verdict, and
    writes identification.json, vehicle.toml (the identified truck), states.parquet and report.html.
    """
    from fifthwheel.errors import SignalError
    from fifthwheel.identify import TwoStage, article
    from fifthwheel.identify import identify as run
    from fifthwheel.identify.sensors import sensors_of
    from fifthwheel.observe import Observer, ObserverSettings
    from fifthwheel.report import drawing, of_run
    from fifthwheel.report.words import conclude

    if figures:
        drawing.checked(figures)
    truck, both = read_vehicle(vehicle), read_records([*logs, *(validate or [])], signals)
    say_loads(truck, both)
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
            sensor=sensor,
            form=form.name,
            check=check,
        )
    else:
        told = {"--free": free, "--prior": prior, "--consider": consider, "--any-load": any_load, "--sensor": sensor}
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
            settings_now, unsure = found.observer_settings(record.name), found.uncertainty(record.name)
            if i > len(records) and unsure is not None:
                with suppress(SignalError):  # what cannot tell its zeros has those of any log
                    sensors, unsure = sensors_of(record, found.vehicle, unsure)
                    settings_now = ObserverSettings(**sensors)
            states.append(Observer(found.vehicle, record.signals, settings_now).batch(record, unsure))
            progress("states", i, len(records) + len(unseen))
    outlook = _outlook(found, records)
    conclusion = conclude(found, [*records, *unseen], outlook, states)
    files = _write(found, conclusion, states, folder)
    files |= _report(
        folder,
        found,
        [*records, *unseen],
        states,
        outlook=outlook,
        provenance=of_run([*logs, *(validate or [])], vehicle, signals, command=sys.argv[1:]),
        figures=figures,
    )
    if as_json:
        print(json.dumps(_as_dict(found, conclusion) | {"files": files}, indent=2))
    else:
        from fifthwheel.report import show_identification

        show_identification(found, told=conclusion)
        say_files(files)


def _only(option: str, value: object, method: str) -> None:
    """Refuse an option that another method has."""
    if value:
        from fifthwheel.errors import FifthwheelError

        raise FifthwheelError(f"{option}: belongs to --method {method}; leave it out, or choose that method")


def _outlook(found: "Identification", records: "list[Record]") -> "Outlook | None":
    """What would help, reckoned at what was found; None where that cannot be reckoned, or everything is known well."""
    from fifthwheel.errors import FifthwheelError
    from fifthwheel.identify import OneStage
    from fifthwheel.identify.outlook import Looking, outlook

    looking = Looking()
    known = [e.verdict == "converged" and e.sigma is not None for e in found.parameters if e.verdict != "held"]
    wide = [(e.sigma or 0.0) > looking.enough * abs(e.value) for e in found.parameters]
    if not isinstance(found.settings, OneStage) or (all(known) and not any(wide)):
        return None
    try:
        return outlook(records, found.vehicle, found.settings, looking)
    except FifthwheelError:
        return None


def _as_dict(found: "Identification", told: "Conclusion") -> dict[str, Any]:
    """The identification with what the report says of it."""
    plain: dict[str, Any] = json.loads(found.to_json())
    return plain | {"conclusion": told.as_dict()}


def _write(found: "Identification", told: "Conclusion", states: "list[States]", folder: Path) -> dict[str, str]:
    from fifthwheel.observe import save
    from fifthwheel.vehicle import save as save_vehicle
    from fifthwheel.whole import whole

    with whole(folder / "identification.json") as part:
        part.write_text(json.dumps(_as_dict(found, told), indent=2) + "\n", encoding="utf-8")
    save_vehicle(found.vehicle, folder / "vehicle.toml")
    save(states, folder / "states.parquet")
    return {n: str(folder / n) for n in ("identification.json", "vehicle.toml", "states.parquet")}


def _report(
    folder: Path,
    found: "Identification",
    records: "list[Record]",
    states: "list[States]",
    *,
    outlook: "Outlook | None",
    provenance: "Provenance",
    figures: str | None,
) -> dict[str, str]:
    from fifthwheel.report import Given, write_report

    uncertain = () if found.covariance is None else found.covariance.names
    drawn = write_report(
        folder / "report.html",
        found,
        records,
        states,
        title=found.vehicle.name,
        outlook=outlook,
        given=Given(uncertain=uncertain),
        provenance=provenance,
        figures=figures,
    )
    return {"report.html": str(folder / "report.html")} | ({"figures": str(folder / "figures")} if drawn else {})
