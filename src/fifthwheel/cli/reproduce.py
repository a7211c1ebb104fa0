"""fifthwheel reproduce"""

from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from fifthwheel._atomic import result_folder
from fifthwheel.cli import terminal
from fifthwheel.cli.app import command
from fifthwheel.cli.options import ForceOption, JsonOption, OutOption


@command(
    "fifthwheel reproduce",
    "fifthwheel reproduce --quick --out quick",
    "fifthwheel reproduce --quick --seeds 10 --arms default --vehicle truck.toml",
)
def reproduce(
    out: OutOption = Path("fifthwheel-reproduction"),
    quick: Annotated[
        bool, typer.Option("--quick", help="Fewer seeds and lane changes, and no study of settings.")
    ] = False,
    seeds: Annotated[
        int | None, typer.Option(min=1, max=10_000, help="Seeds of every experiment. Default: 20, with --quick 3.")
    ] = None,
    arms: Annotated[
        list[str] | None,
        typer.Option(help="article, default, or 'default, front fixed'; may be repeated. Default: all."),
    ] = None,
    vehicle: Annotated[
        str | None,
        typer.Option(
            "--vehicle",
            "-v",
            help="A tractor and semitrailer in place of the truck of section 3, without section 4 and the study of "
            "settings.",
        ),
    ] = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Reproduce sections 3 and 4 of Cheng and Cebon (2011) with the nonlinear vehicle.

    Writes Figures 4 to 9, a table with published and reproduced values, the estimates of
    every seed (parameters.parquet) and time histories of seed 0 (histories.parquet). Needs
    `pip install 'fifthwheel[studies]'`. Takes a few minutes on two cores; with --quick
    less than one minute.
    """
    from fifthwheel.cheng_cebon_2011 import table
    from fifthwheel.cheng_cebon_2011.reproduce import FILES
    from fifthwheel.cheng_cebon_2011.reproduce import reproduce as run
    from fifthwheel.workflow import read_vehicle

    truck = None if vehicle is None else read_vehicle(vehicle)
    with (
        result_folder(out, "reproduce", FILES, inputs=[Path(vehicle)] if vehicle else (), force=force) as folder,
        terminal.progress_bar(quiet=as_json) as progress,
    ):
        result = run(folder, quick=quick, seeds=seeds, arms=arms or (), vehicle=truck, progress=progress)
    files = terminal.in_folder(out, [path.name for path in result.files])
    contents = {"rows": [asdict(row) for row in result.rows]}
    terminal.print_result(contents, partial(table.document, result.rows), files, as_json=as_json)
