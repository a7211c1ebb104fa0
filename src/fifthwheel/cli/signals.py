"""fifthwheel signals"""

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fifthwheel.cli.app import JsonOption, SignalsOption, app, example, expected, read_vehicle, reading

if TYPE_CHECKING:
    from fifthwheel.logs.propose import Proposal
    from fifthwheel.logs.survey import Survey
    from fifthwheel.vehicle import Vehicle


@app.command(
    epilog=example(
        "fifthwheel signals drive.mf4",
        "fifthwheel signals drive.csv --vehicle truck.toml --out signals.toml",
        "fifthwheel signals drive.blf --database truck.dbc --database trailer.arxml --out signals.toml",
        "fifthwheel signals drive.mf4 --signals signals.toml --save drive.parquet",
    )
)
def signals(
    log: Annotated[Path, typer.Argument(help="CSV, Parquet, MF4, MATLAB, MCAP or a CAN trace.", show_default=False)],
    signals: SignalsOption = None,
    database: Annotated[
        list[Path] | None,
        typer.Option("--database", "-d", help="DBC or ARXML for the frames of a CAN bus; may be repeated."),
    ] = None,
    vehicle: Annotated[
        str | None,
        typer.Option("--vehicle", "-v", help="The truck: names its units, and its wheelbase tells the steering ratio."),
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Write the proposed map here.")] = None,
    save: Annotated[
        Path | None, typer.Option("--save", help="With --signals: write the record as .csv or .parquet.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """What a log holds, and a signals.toml for it.

    Lists every column with unit, rate, range and what is missing, and proposes which is which signal: by names and
    units, and with the signs, units and steering ratio that a turning truck must show. Edit the proposal, then give it
    with --signals, here to see what it makes of the log, and to the other commands.
    """
    truck = read_vehicle(vehicle) if vehicle else None
    if signals is not None:
        _show_record(log, signals, truck, save, as_json)
        return
    from fifthwheel.errors import FifthwheelError
    from fifthwheel.logs.draft import as_toml
    from fifthwheel.logs.propose import propose
    from fifthwheel.logs.readers import open_log
    from fifthwheel.logs.survey import survey

    if save is not None:
        raise FifthwheelError("--save: needs --signals; propose a map with --out first, and look at it")
    databases = [_beside(path, out) for path in database or []]
    units: dict[str, Any] = {}
    if truck is not None:
        units = {"units": [unit.name for unit in truck.units], "wheelbase": truck.wheelbase}
    with reading([log]) as progress, open_log(log, database or [], progress(log)) as opened:
        found = survey(opened, progress(log))
        proposal = propose(opened, found, databases=databases, **units)
    text = as_toml(proposal, found)
    if out is not None:
        from fifthwheel.whole import whole

        with whole(out) as part:
            part.write_text(text, encoding="utf-8")
    if as_json:
        print(json.dumps({**_told(found, proposal), "signals_toml": text}, indent=2))
        return
    from fifthwheel.report.signals import show_survey

    show_survey(found, proposal)
    typer.echo(f"\nWritten: {out}" if out is not None else f"\n{text}", nl=out is not None)


def _beside(path: Path, map_file: Path | None) -> Path:
    """How a map calls a database: from its own folder where it lies there, else in full."""
    folder = (map_file.parent if map_file else Path()).resolve()
    full = path.resolve()
    return full.relative_to(folder) if full.is_relative_to(folder) else full


def _show_record(log: Path, signals: Path, truck: "Vehicle | None", save: Path | None, as_json: bool) -> None:
    """What a map makes of a log."""
    from fifthwheel.logs import SignalMap, check, read, write
    from fifthwheel.logs.files import writer

    if save is not None:
        writer(save)
    with reading([log]) as progress:
        record = read(log, SignalMap.load(signals), progress=progress(log))
    findings = check(record, **(expected(truck) if truck else {}))
    if save is not None:
        write(record, save)
    if as_json:
        told = {
            "name": record.name,
            "span": record.span,
            "rate": record.rate,
            "signals": list(record.signals),
            "reference": list(record.reference),
            "notes": list(record.notes),
            "findings": [str(finding) for finding in findings],
        }
        print(json.dumps(told, indent=2))
        return
    from fifthwheel.report.signals import show_record

    show_record(record, findings)
    if save is not None:
        typer.echo(f"Written: {save}")


def _told(found: "Survey", proposal: "Proposal") -> dict[str, Any]:
    def number(value: float) -> float | None:
        return value if math.isfinite(value) else None

    return {
        "name": found.name,
        "span": [number(found.start), number(found.stop)],
        "notes": list(found.notes),
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
            for name, content in found.contents.items()
        ],
        "missing": list(proposal.missing),
        "findings": [str(finding) for finding in proposal.findings],
    }
