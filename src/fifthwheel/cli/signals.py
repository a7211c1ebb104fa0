"""fifthwheel signals"""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fifthwheel.cli.app import command
from fifthwheel.cli.options import JsonOption, SignalsOption
from fifthwheel.cli.terminal import load_records, print_files, print_json, reading_bar

if TYPE_CHECKING:
    from fifthwheel.logs.mapping.propose import MapProposal
    from fifthwheel.logs.mapping.survey import LogSurvey
    from fifthwheel.vehicle import Vehicle


@command(
    "fifthwheel signals run.mf4",
    "fifthwheel signals run.csv --vehicle truck.toml --out signals.toml",
    "fifthwheel signals run.blf --database truck.dbc --database trailer.arxml --out signals.toml",
    "fifthwheel signals run.mf4 --signals signals.toml --save run.parquet",
)
def signals(
    log: Annotated[Path, typer.Argument(help="CSV, Parquet, MF4, MATLAB, MCAP or a CAN trace.", show_default=False)],
    signals: SignalsOption = None,
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
    as_json: JsonOption = False,
) -> None:
    """List the contents of a log and propose a signals.toml.

    Lists every column with unit, sampling rate, range and missing samples. Proposes which column is which signal, from
    names, units and the kinematics of a turning vehicle (signs, degrees, steering ratio). Edit the proposal, then use
    it with --signals: here to see the resulting record, and in the other commands.
    """
    from fifthwheel.errors import FifthwheelError
    from fifthwheel.workflow import read_vehicle

    truck = read_vehicle(vehicle) if vehicle else None
    if signals is not None:
        _show_record(log, signals, truck, save, as_json)
        return
    if save is not None:
        raise FifthwheelError("--save: needs --signals; propose a map with --out first, and check it")
    from fifthwheel.logs.mapping.propose import as_toml, propose_map
    from fifthwheel.logs.mapping.survey import survey_log
    from fifthwheel.logs.readers import open_log

    databases = [_relative_to_map(path, out) for path in database or []]
    units: dict[str, Any] = {}
    if truck is not None:
        units = {"units": [unit.name for unit in truck.units], "wheelbase": truck.wheelbase}
    with reading_bar([log]) as show:

        def progress(fraction: float) -> None:
            show(f"reading {log.name}", round(1000 * fraction), 1000)

        with open_log(log, database or [], progress) as opened:
            survey = survey_log(opened, progress)
            proposal = propose_map(opened, survey, databases=databases, **units)
    text = as_toml(proposal, survey)
    if out is not None:
        from fifthwheel._atomic import atomic_write

        with atomic_write(out) as temporary:
            temporary.write_text(text, encoding="utf-8")
    if as_json:
        print_json({**_survey_as_dict(survey, proposal), "signals_toml": text})
        return
    from fifthwheel.report.terminal.signals import show_survey

    show_survey(survey, proposal)
    typer.echo(f"\nWritten: {out}" if out is not None else f"\n{text}", nl=out is not None)


def _relative_to_map(path: Path, map_file: Path | None) -> Path:
    """The path of a database in a map: relative if it lies in the map's folder or below, else absolute."""
    folder = (map_file.parent if map_file else Path()).resolve()
    full = path.resolve()
    return full.relative_to(folder) if full.is_relative_to(folder) else full


def _show_record(log: Path, signals: Path, truck: "Vehicle | None", save: Path | None, as_json: bool) -> None:
    """Show the record that a map makes of a log."""
    from fifthwheel.logs import write_record
    from fifthwheel.logs.files import record_writer
    from fifthwheel.workflow import check_record

    if save is not None:
        record_writer(save)  # refuses an unknown format before reading
    (record,) = load_records([log], signals)
    findings = check_record(record, truck)
    if save is not None:
        write_record(record, save)
    if as_json:
        names = ("name", "span", "rate")
        contents = {name: getattr(record, name) for name in names}
        contents |= {name: list(getattr(record, name)) for name in ("signals", "reference", "notes")}
        print_json(contents | {"findings": [str(finding) for finding in findings]})
        return
    from fifthwheel.report.terminal.signals import show_record

    show_record(record, findings)
    if save is not None:
        print_files({save.name: save})


def _survey_as_dict(survey: "LogSurvey", proposal: "MapProposal") -> dict[str, Any]:
    def number(value: float) -> float | None:
        return value if math.isfinite(value) else None

    return {
        "name": survey.name,
        "span": [number(survey.start), number(survey.stop)],
        "notes": list(survey.notes),
        "columns": [
            {
                "name": name,
                "unit": content.column.unit,
                "samples": content.samples,
                "missing": content.missing,
                "rate": number(content.rate),
                "low": number(content.low),
                "high": number(content.high),
                "mean": number(content.mean),
                "sigma": number(content.sigma),
                "fault": content.fault,
            }
            for name, content in survey.contents.items()
        ],
        "missing": list(proposal.missing),
        "findings": [str(finding) for finding in proposal.findings],
    }
