"""fifthwheel knowledge and fleet: many logs of a truck, and many trucks"""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fifthwheel.apps.cli import common
from fifthwheel.apps.cli.app import Only, command, fleet_app, knowledge_app
from fifthwheel.base.atomic import one_run, replaced_result, reserved
from fifthwheel.base.options import FleetSettings, IdentifyOptions

if TYPE_CHECKING:
    from collections.abc import Callable

    from fifthwheel.apps.fleet import FleetRun
    from fifthwheel.base.pages import Document
    from fifthwheel.estimate.identify.knowledge.knowledge import Knowledge


Result = Annotated[
    Path,
    typer.Argument(
        metavar="RESULT", help="Result folder of `fifthwheel identify`, or a knowledge.json.", show_default=False
    ),
]


@command(
    "fifthwheel knowledge show result",
    "fifthwheel knowledge show result --all",
    "fifthwheel knowledge show merged.json --json",
    of=knowledge_app,
)
def show(
    result: Result,
    everything: Annotated[
        bool, typer.Option("--all", help="Also uncertain numbers of the vehicle file and errors of sensors.")
    ] = False,
    as_json: common.JsonOption = False,
) -> None:
    """Print the estimates from all logs of a truck: value, sigma, and the truck, trailer or load that each belongs to.

    These are what the next identification begins with. A unit "prior sigma" stands for standard deviations of the
    prior, of an unknown that moves several numbers of the vehicle file.
    """
    contents, document = _estimates(_read(result), everything=everything)
    common.print_result(contents, document, {}, as_json=as_json)


@command(
    "fifthwheel knowledge history result",
    "fifthwheel knowledge history result --json",
    of=knowledge_app,
)
def history(result: Result, as_json: common.JsonOption = False) -> None:
    """Print the logs in the order of their dates: the sigma of each parameter before and after each log.

    A remark says what changed before a log, such as its tyres; why a log is not used; and the doubts about it.
    """
    from fifthwheel.estimate.identify.knowledge.history import history as entries_of
    from fifthwheel.results.report.vehicle import history_document

    entries = entries_of(_read(result))
    contents = {"logs": [entry.as_dict() for entry in entries]}
    common.print_result(contents, partial(history_document, entries), {}, as_json=as_json)


@command(
    "fifthwheel knowledge forget result 'run 3'",
    "fifthwheel knowledge forget result bend -o without_bend.json",
    of=knowledge_app,
)
def forget(
    result: Result,
    log: Annotated[str, typer.Argument(help="Name of the log, or the beginning of its digest.", show_default=False)],
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="File or folder to write to. Default: in place.")
    ] = None,
    force: common.ForceFileOption = False,
    as_json: common.JsonOption = False,
) -> None:
    """Remove a log from the knowledge; the other logs are not identified again.

    Logs that were set aside because they contradict the removed one are used again. Of a result folder only
    knowledge.json changes; the other files are those of the last `fifthwheel identify` until it runs again.
    """
    from fifthwheel.base.errors import printable
    from fifthwheel.estimate.identify.knowledge.storage import knowledge_file

    source = knowledge_file(result)
    target = source if out is None else _target(out)
    if target == source:
        with replaced_result(target) as temporary:  # no other command writes to the folder meanwhile
            knowledge = _read(result)
            left = knowledge.without(log)
            left.save(temporary)
    else:
        knowledge = _read(result)
        left = knowledge.without(log)
        _write(left, target, force=force)
    aside = {other.digest for other in knowledge.logs if other.set_aside}
    again = [other.name for other in left.used if other.digest in aside]
    contents, document = _estimates(left)
    common.print_result({**contents, "used_again": again}, document, {target.name: target}, as_json=as_json)
    if again and not as_json:
        typer.echo(f"Used again: {printable(', '.join(again))}")
    if target.with_name("identification.json").exists() and not as_json:
        typer.echo("identification.json, vehicle.toml and report.html are those of the last identify: run it again.")


@command(
    "fifthwheel knowledge merge monday tuesday -o merged.json",
    "fifthwheel knowledge merge monday tuesday other.json -o truck",
    "fifthwheel knowledge merge result learned.json -o truck",
    of=knowledge_app,
)
def merge(
    results: Annotated[
        list[Path],
        typer.Argument(
            metavar="RESULT...",
            help="Result folders of one truck, knowledge.json of them, or files of `fifthwheel live --learn`.",
            show_default=False,
        ),
    ],
    out: Annotated[
        Path,
        typer.Option(
            "--out", "-o", help="File that ends with .json, or folder for knowledge.json.", show_default=False
        ),
    ],
    force: common.ForceFileOption = False,
    as_json: common.JsonOption = False,
) -> None:
    """Join the logs of several results of one truck; a log that several contain counts once.

    Begin with it by `fifthwheel identify run.csv --vehicle truck.toml --knowledge merged.json`.
    """
    from fifthwheel.estimate.identify.knowledge.knowledge import Knowledge

    merged = Knowledge()
    for result in results:
        merged = merged.merged(_read(result))
    contents, document = _estimates(merged)
    target = _target(out)
    _write(merged, target, force=force)
    contents["logs"] = [log.name for log in merged.logs]
    common.print_result(contents, document, {target.name: target}, as_json=as_json)


def _read(result: Path) -> "Knowledge":
    from fifthwheel.apps.workflow.inputs import read_knowledge
    from fifthwheel.base.errors import SignalError
    from fifthwheel.estimate.identify.knowledge.storage import knowledge_file

    with one_run(knowledge_file(result)):
        knowledge = read_knowledge(result)
    if not knowledge.used:
        raise SignalError(f"{result}: has no log that is used; give another result")
    return knowledge


def _estimates(knowledge: "Knowledge", *, everything: bool = False) -> "tuple[dict[str, Any], Callable[[], Document]]":
    """The logs that are used and the estimates from them, and the same for people."""
    from fifthwheel.estimate.identify.knowledge.history import shared_estimates
    from fifthwheel.results.report.vehicle import knowledge_document

    estimates = shared_estimates(knowledge)
    shown = [estimate.as_dict() for estimate in estimates if everything or estimate.estimated]
    contents = {"logs": [log.name for log in knowledge.used], "estimates": shown}
    return contents, partial(knowledge_document, estimates, len(knowledge.used), everything=everything)


def _target(out: Path) -> Path:
    """The file to write: `out`, or knowledge.json in it."""
    from fifthwheel.estimate.identify.knowledge.storage import KNOWLEDGE

    return out if out.suffix == ".json" and not out.is_dir() else out / KNOWLEDGE


def _write(knowledge: "Knowledge", path: Path, *, force: bool) -> None:
    """Write the file; that of a result folder with its digest in run.json."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with reserved(path, force=force), replaced_result(path) as temporary:
        knowledge.save(temporary)


@command(
    "fifthwheel fleet run manifest.csv --out fleet",
    "fifthwheel fleet run manifest.csv --out fleet --jobs 1",
    "fifthwheel fleet run s3://depot/manifest.parquet --out s3://depot/fleet --scheduler tcp://10.0.0.5:8786",
    "fifthwheel fleet run manifest.csv --set payload.height=exact --set 'steer.*.delay=+- 5 ms' --height-limit 2.4m",
    of=fleet_app,
)
def run(
    manifest: Annotated[
        str,
        typer.Argument(
            help="CSV or Parquet with a row for each trip: log, truck, trailer, vehicle, signals, load, date. A path, "
            "also in an object store such as s3://.",
            show_default=False,
        ),
    ],
    out: Annotated[
        str, typer.Option("--out", "-o", help="Data set: a folder, or a prefix of an object store. Trips are added.")
    ] = "fifthwheel-fleet",
    scheduler: Annotated[
        str | None,
        typer.Option(help="Address of your own Dask scheduler, such as tcp://10.0.0.5:8786. Default: this computer."),
    ] = None,
    jobs: Annotated[
        int | None,
        typer.Option(min=1, help="Processes of this computer. Default: one per core. 1: this process only."),
    ] = None,
    retry: Annotated[
        bool, typer.Option("--retry", help="Try failed trips again, also if nothing that they depend on has changed.")
    ] = False,
    *,
    chosen: FleetSettings,
    identification: Annotated[IdentifyOptions, Only(("statements", "tyres", "check"))],
    as_json: common.JsonOption = False,
) -> None:
    """Identify every trip of a fleet that the data set does not have yet, and combine all trips of each truck.

    A damaged trip is recorded with its error and does not stop the run. Finished trips are kept when the run is
    interrupted or killed; run it again to continue. The data set has the tables trips/, trucks.parquet,
    trailers.parquet, history.parquet and changes.parquet, in SI. Several processes need
    `pip install 'fifthwheel[fleet]'`.
    """
    from fifthwheel.apps.fleet import run as run_fleet
    from fifthwheel.apps.workflow.start import stated_in
    from fifthwheel.estimate.identify import OneStage

    with common.progress_bar(quiet=as_json) as progress:
        result = run_fleet(
            manifest,
            out,
            settings=OneStage(
                check=identification.check,
                tyres=identification.tyres,
                given=stated_in(identification.statements),
            ),
            fleet=chosen,
            scheduler=scheduler,
            jobs=jobs,
            retry=retry,
            progress=progress,
        )
    if as_json:
        common.print_json(result.as_dict())
    else:
        _print(result)


@command(
    "fifthwheel fleet report fleet",
    "fifthwheel fleet report s3://depot/fleet --out fleet.html --json",
    of=fleet_app,
)
def report(
    dataset: Annotated[str, typer.Argument(help="What `fifthwheel fleet run --out` wrote.", show_default=False)],
    out: Annotated[Path, typer.Option("--out", "-o", help="File to write.")] = Path("fleet.html"),
    force: common.ForceFileOption = False,
    as_json: common.JsonOption = False,
) -> None:
    """Write one HTML page: what needs attention, the fleet's tables, and the history of every truck."""
    from fifthwheel.apps.fleet import report as write_report

    with reserved(out, force=force):
        attention = write_report(dataset, out)
    if as_json:
        rows = [vars(a) | {"date": a.date.isoformat() if a.date else None} for a in attention]
        common.print_json({"file": str(out), "attention": rows})
        return
    from fifthwheel.base.errors import printable

    for finding in attention:
        typer.echo(printable(f"{finding.truck}: {finding.kind}: {finding.text}"))
    nothing = "" if attention else "; nothing needs attention"
    typer.echo(f"Written: {out}{nothing}")


def _print(result: "FleetRun") -> None:
    """What a run did, in words."""
    from fifthwheel.base.errors import printable

    counts = {"new": result.new, "unchanged": result.unchanged, "failed": result.failed, "lost": result.lost}
    words = ", ".join(f"{count} {name}" for name, count in counts.items() if count)
    typer.echo(f"{result.trips} trips: {words}")
    if result.seconds:
        typer.echo(f"{result.hours:.3g} h of logs in {result.seconds:.1f} s of CPU time")
    for subject, message in result.errors:
        typer.echo(printable(f"{subject}: {message}"), err=True)
    typer.echo(f"{result.changes} changes. Written: {result.path}; next: fifthwheel fleet report {result.path}")
