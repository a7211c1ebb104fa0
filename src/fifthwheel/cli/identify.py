"""fifthwheel identify"""

import json
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

if TYPE_CHECKING:
    from fifthwheel.identify import Identification
    from fifthwheel.logs import Record
    from fifthwheel.observe import States


class Preset(StrEnum):
    """Settings by name."""

    default = "default"
    article = "article"


@app.command(
    epilog=example(
        "fifthwheel identify drive.csv --vehicle truck.toml",
        "fifthwheel identify bend.csv ramp.csv -v truck.toml -s signals.toml -o result",
        "fifthwheel identify drive.csv -v truck.toml --hold tractor.front.cornering_stiffness",
        "fifthwheel identify drive.csv -v truck.toml --preset article --json",
    )
)
def identify(
    logs: Logs,
    vehicle: VehicleOption,
    signals: SignalsOption = None,
    out: OutOption = Path("fifthwheel-out"),
    hold: Annotated[
        list[str] | None, typer.Option("--hold", help="A parameter that keeps its value; may be repeated.")
    ] = None,
    validate: Annotated[
        list[Path] | None, typer.Option("--validate", help="A log to predict only; may be repeated.")
    ] = None,
    preset: Annotated[Preset, typer.Option(help="Our settings, or the article's.")] = Preset.default,
    passes: Annotated[int | None, typer.Option(min=1, help="At most so many times through the logs a stage.")] = None,
    check: CheckOption = True,
    as_json: JsonOption = False,
) -> None:
    """Tyre cornering stiffnesses, trailer yaw inertia and payload height from logs, then the states.

    Reads the logs, runs both stages and the state estimator, prints every parameter with sigma and verdict, and writes
    identification.json, vehicle.toml (the identified truck), states.parquet and report.html.
    """
    from dataclasses import replace

    from fifthwheel.identify import Settings, article
    from fifthwheel.identify import identify as run
    from fifthwheel.observe import Observer

    truck, both = read_vehicle(vehicle), read_records([*logs, *(validate or [])], signals)
    records, unseen = both[: len(logs)], both[len(logs) :]
    settings = article() if preset is Preset.article else Settings()
    settings = replace(settings, held=tuple(hold or ()), check=check, passes=passes or settings.passes)
    folder = made_folder(out)
    with progress_bar(quiet=as_json) as progress:
        found = run(records, truck, settings, validate=unseen, progress=progress)
        progress("states", 0, len(records))
        states = []
        for i, record in enumerate((*records, *unseen), 1):
            observer = Observer(found.vehicle, record.signals, found.observer_settings(record.name))
            states.append(observer.batch(record))
            progress("states", i, len(records) + len(unseen))
    files = _write(found, [*records, *unseen], states, folder)
    if as_json:
        print(json.dumps(json.loads(found.to_json()) | {"files": files}, indent=2))
    else:
        from fifthwheel.report import show_identification

        show_identification(found)
        say_files(files)


def _write(found: "Identification", records: "list[Record]", states: "list[States]", folder: Path) -> dict[str, str]:
    from fifthwheel.observe import save
    from fifthwheel.report import write_report
    from fifthwheel.vehicle import save as save_vehicle

    found.save(folder / "identification.json")
    save_vehicle(found.vehicle, folder / "vehicle.toml")
    save(states, folder / "states.parquet")
    write_report(folder / "report.html", found, records, states, title=found.vehicle.name)
    return {n: str(folder / n) for n in ("identification.json", "vehicle.toml", "states.parquet", "report.html")}
