"""fifthwheel compare"""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from fifthwheel._atomic import reserved
from fifthwheel.cli import options, terminal
from fifthwheel.cli.app import command


@command(
    "fifthwheel compare monday tuesday",
    "fifthwheel compare empty laden/identification.json --csv compared.csv --html compared.html",
    "fifthwheel compare monday tuesday wednesday --json",
)
def compare(
    runs: Annotated[
        list[Path],
        typer.Argument(
            help="Result folders of `fifthwheel identify`, or their identification.json; at least two. The first is "
            "the reference.",
            show_default=False,
        ),
    ],
    csv: Annotated[Path | None, typer.Option("--csv", help="CSV file for the table, in SI units.")] = None,
    html: Annotated[Path | None, typer.Option("--html", help="HTML file for the table and a plot.")] = None,
    force: options.ForceFileOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Compare the estimates of several identifications, with their differences in units of sigma.

    A difference of more than two sigma is real with a probability of 95 %. Errors of the vehicle file and of the model
    that all runs share cancel in a difference. Runs that share logs are marked: their difference is no test.
    """
    from fifthwheel.report.comparison import comparison_document
    from fifthwheel.workflow import compare_runs, write_comparison

    with reserved(csv, html, force=force):
        comparison = compare_runs(runs)
        files = write_comparison(comparison, csv=csv, html=html)
    terminal.print_result(comparison.as_dict(), partial(comparison_document, comparison), files, as_json=as_json)
