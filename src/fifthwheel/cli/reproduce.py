"""fifthwheel reproduce"""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from fifthwheel.cli.app import JsonOption, OutOption, app, example, progress_bar, say_files


@app.command(epilog=example("fifthwheel reproduce", "fifthwheel reproduce --quick --out look"))
def reproduce(
    out: OutOption = Path("fifthwheel-reproduction"),
    quick: Annotated[
        bool, typer.Option("--quick", help="Fewer seeds and lane changes, without the study of settings.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """The article's sections 3 and 4 on the nonlinear truck: Figures 4 to 9, and every published number beside ours.

    Needs 'fifthwheel[paper]'. Some minutes on two cores; --quick well under one.
    """
    from fifthwheel.paper import reproduce as run
    from fifthwheel.paper import table

    with progress_bar(quiet=as_json) as progress:
        found = run(out, quick=quick, progress=progress)
    files = {path.name: str(path) for path in found.files}
    if as_json:
        print(json.dumps({"rows": [asdict(row) for row in found.rows], "files": files}, indent=2))
    else:
        table.show(found.rows)
        say_files(files)
