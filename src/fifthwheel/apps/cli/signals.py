"""fifthwheel signals"""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fifthwheel.apps.cli import terminal
from fifthwheel.apps.cli.app import command
from fifthwheel.apps.cli.options import AllowOutsideOption, ForceFileOption, JsonOption, SignalsOption
from fifthwheel.base.atomic import reserved

if TYPE_CHECKING:
    from fifthwheel.truck import Vehicle


@command(
    "fifthwheel signals run.mf4",
    "fifthwheel signals run.csv --vehicle truck.toml --out signals.toml",
    "fifthwheel signals run.blf --database truck.dbc --database trailer.arxml --out signals.toml",
    "fifthwheel signals run.mf4 --signals signals.toml --save run.parquet",
)
def signals(
    log: Annotated[Path, typer.Argument(help="CSV, Parquet, MF4, MATLAB, MCAP or a CAN trace.", show_default=False)],
    signals: SignalsOption = None,
    allow_outside: AllowOutsideOption = False,
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
    force: ForceFileOption = False,
    as_json: JsonOption = False,
) -> None:
    """List the contents of a log and propose a signals.toml.

    Lists every column with unit, sampling rate, range and missing samples. Proposes which column is which signal, from
    names, units and the kinematics of a turning vehicle (signs, degrees, steering ratio). Of a text table, MDF or
    Parquet file above 100 MB, a sample is read, unless --whole is given. Edit the proposal, then use it with --signals:
    here to see the resulting record, and in the other commands.
    """
    from fifthwheel.apps.workflow.inputs import read_vehicle, survey_file
    from fifthwheel.base.errors import FifthwheelError

    truck = read_vehicle(vehicle) if vehicle else None
    if signals is not None:
        with reserved(save, force=force):
            _show_record(log, signals, truck, save, as_json, allow_outside=allow_outside)
        return
    if save is not None:
        raise FifthwheelError("--save: needs --signals; propose a map with --out first, and check it")
    from fifthwheel.base.pages.terminal import show
    from fifthwheel.results.report.log_contents import survey_document

    with reserved(out, force=force), terminal.reading_bar([log]) as progress:
        contents = survey_file(log, truck, databases=database or [], map_file=out, whole=whole, progress=progress)
    if as_json:
        terminal.print_json(contents.as_dict())
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
    (record,) = terminal.load_records([log], signals, allow_outside=allow_outside)
    findings = check_signals(record, truck)
    if save is not None:
        write_record(record, save)
    if as_json:
        contents = {"name": record.name, "span": record.span, "rate": record.rate}
        contents |= {name: list(getattr(record, name)) for name in ("signals", "reference", "notes")}
        terminal.print_json(contents | {"findings": [str(finding) for finding in findings]})
        return
    from fifthwheel.base.pages.terminal import show
    from fifthwheel.results.report.log_contents import record_document

    show(record_document(record, findings))
    if save is not None:
        terminal.print_files({save.name: save})
