"""fifthwheel vehicle catalogue and show"""

from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from fifthwheel.apps.cli import terminal
from fifthwheel.apps.cli.app import command, vehicle_app
from fifthwheel.apps.cli.options import ForceFileOption, JsonOption
from fifthwheel.base.atomic import reserved


@vehicle_app.callback(invoke_without_command=True)
def _list(context: typer.Context, as_json: JsonOption = False) -> None:
    if context.invoked_subcommand is None:
        catalogue(None, as_json=as_json)


@command(
    "fifthwheel vehicle",
    "fifthwheel vehicle cheng_cebon_2011 > truck.toml",
    "fifthwheel vehicle --json",
    of=vehicle_app,
)
def catalogue(
    name: Annotated[str | None, typer.Argument(help="A vehicle of the catalogue. Default: list them.")] = None,
    as_json: JsonOption = False,
) -> None:
    """List the catalogue of published vehicles, or print one as a vehicle file. The word `catalogue` may be left out.

    With --json, a vehicle is printed as its parameters in SI by their paths.
    """
    from fifthwheel.truck import catalogue

    if name is None:
        sources = {entry: catalogue.get(entry).source for entry in catalogue.names()}
        if as_json:
            terminal.print_json({"vehicles": [{"name": entry, "source": source} for entry, source in sources.items()]})
        else:
            typer.echo("\n".join(f"{entry:24s} {source}" for entry, source in sources.items()))
    elif as_json:
        truck = catalogue.get(name)
        terminal.print_json({"name": name, "source": truck.source, "parameters": truck.parameters()})
    else:
        typer.echo(catalogue.text(name), nl=False)


@command(
    "fifthwheel vehicle show truck.toml",
    "fifthwheel vehicle show truck.toml --plot truck.svg",
    "fifthwheel vehicle show cheng_cebon_2011 --speed 60 --json",
    of=vehicle_app,
)
def show(
    vehicle: Annotated[str, typer.Argument(help="A vehicle file, or a name of the catalogue.", show_default=False)],
    speed: Annotated[
        float, typer.Option(min=5.0, max=140.0, help="Of the oscillations and the lane change, km/h.")
    ] = 80,
    plot: Annotated[
        Path | None, typer.Option(help="File for a drawing to scale: .html, or .svg, .png, .pdf with matplotlib.")
    ] = None,
    force: ForceFileOption = False,
    as_json: JsonOption = False,
) -> None:
    """Show axle loads, handling and oscillations of a vehicle, and the numbers that are assumed.

    The effect of an assumed number is the largest change of a yaw rate or roll rate in a lane change, if the number
    changes by one standard deviation.
    """
    from fifthwheel.apps.workflow.inputs import read_vehicle
    from fifthwheel.model.dynamics.summary import summarize
    from fifthwheel.results.diagnose.assumptions import assumed_numbers
    from fifthwheel.results.report.vehicle import vehicle_document

    truck = read_vehicle(vehicle)
    with reserved(plot, force=force):
        terminal.warn_of_masses(truck)
        summary, numbers = summarize(truck, speed / 3.6), assumed_numbers(truck, speed / 3.6)
        if plot is not None:
            truck.plot().save(plot)
    files = {} if plot is None else {plot.name: plot}
    contents = {"summary": asdict(summary), "assumed": [asdict(number) for number in numbers]}
    terminal.print_result(contents, partial(vehicle_document, truck, summary, numbers), files, as_json=as_json)
