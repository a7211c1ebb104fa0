"""fifthwheel selfcheck"""

from pathlib import Path
from typing import Annotated

import typer

from fifthwheel.apps.cli import options
from fifthwheel.apps.cli.app import command
from fifthwheel.apps.cli.terminal import print_json


@command("fifthwheel selfcheck", "fifthwheel selfcheck /var/lib/fifthwheel", "fifthwheel selfcheck --json")
def selfcheck(
    folder: Annotated[
        Path, typer.Argument(help="Folder that results are written to.", exists=True, file_okay=False)
    ] = Path(),
    as_json: options.JsonOption = False,
) -> None:
    """Check this installation: cache, machine code against stored states, disk and clock.

    `fifthwheel live` does the same when it starts. The exit code is 1 if a check fails.
    """
    from dataclasses import asdict

    from fifthwheel.apps.selfcheck import self_check

    checks = self_check(folder)
    if as_json:
        print_json({"passed": all(check.passed for check in checks), "checks": [asdict(check) for check in checks]})
    else:
        for check in checks:
            typer.echo(f"{'ok    ' if check.passed else 'FAILED'} {check.name}: {check.text}")
    if not all(check.passed for check in checks):
        raise typer.Exit(1)
