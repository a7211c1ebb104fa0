"""fifthwheel reproduce"""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from fifthwheel._atomic import result_folder
from fifthwheel.cli import terminal
from fifthwheel.cli.app import command
from fifthwheel.cli.options import ForceOption, JsonOption, OutOption


@command("fifthwheel reproduce", "fifthwheel reproduce --quick --out quick")
def reproduce(
    out: OutOption = Path("fifthwheel-reproduction"),
    quick: Annotated[
        bool, typer.Option("--quick", help="Fewer seeds and lane changes, and no study of settings.")
    ] = False,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Reproduce sections 3 and 4 of Cheng and Cebon (2011) with the nonlinear vehicle.

    Writes Figures 4 to 9 and a table with published and reproduced values. Needs
    `pip install 'fifthwheel[studies]'`. Takes a few minutes on two cores; with --quick
    less than one minute.
    """
    from fifthwheel.studies.cheng_cebon_2011 import table
    from fifthwheel.studies.cheng_cebon_2011.reproduce import FILES
    from fifthwheel.studies.cheng_cebon_2011.reproduce import reproduce as run

    with (
        result_folder(out, "reproduce", FILES, inputs=(), force=force) as folder,
        terminal.progress_bar(quiet=as_json) as progress,
    ):
        result = run(folder, quick=quick, progress=progress)
    files = terminal.in_folder(out, [path.name for path in result.files])
    if as_json:
        terminal.print_json({"rows": [asdict(row) for row in result.rows], "files": terminal.as_text(files)})
    else:
        table.show(result.rows)
        terminal.print_files(files)
