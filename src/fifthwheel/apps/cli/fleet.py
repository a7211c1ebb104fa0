"""fifthwheel fleet"""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fifthwheel.apps.cli import options, terminal
from fifthwheel.apps.cli.app import Only, command, fleet_app
from fifthwheel.base.atomic import reserved
from fifthwheel.base.options import FleetSettings, IdentifyOptions

if TYPE_CHECKING:
    from fifthwheel.apps.fleet import FleetRun


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
        typer.Option(help="Address of your own Dask scheduler, such as tcp://10.0.0.5:8786. Default: a local cluster."),
    ] = None,
    jobs: Annotated[
        int | None,
        typer.Option(min=1, help="Processes of the local cluster. Default: one per core. 1: this process only."),
    ] = None,
    retry: Annotated[
        bool, typer.Option("--retry", help="Try failed trips again, also if nothing that they depend on has changed.")
    ] = False,
    *,
    chosen: FleetSettings,
    identification: Annotated[IdentifyOptions, Only(("statements", "tyres", "check"))],
    as_json: options.JsonOption = False,
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

    with terminal.progress_bar(quiet=as_json) as progress:
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
        terminal.print_json(result.as_dict())
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
    force: options.ForceFileOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Write one HTML page: what needs attention, the fleet's tables, and the history of every truck."""
    from fifthwheel.apps.fleet import report as write_report

    with reserved(out, force=force):
        attention = write_report(dataset, out)
    if as_json:
        rows = [vars(a) | {"date": a.date.isoformat() if a.date else None} for a in attention]
        terminal.print_json({"file": str(out), "attention": rows})
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
