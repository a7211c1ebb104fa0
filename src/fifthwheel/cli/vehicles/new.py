"""fifthwheel vehicle new"""

import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fifthwheel._atomic import atomic_write, reserved
from fifthwheel.cli import terminal
from fifthwheel.cli.app import command, vehicle_app
from fifthwheel.cli.options import ForceFileOption
from fifthwheel.options import TruckOptions

if TYPE_CHECKING:
    from fifthwheel.workflow.vehicle_questions import Question


@command(
    "fifthwheel vehicle new",
    "fifthwheel vehicle new --tractor tractor_4x2 --trailer semitrailer_3 --wheelbase 3.7m --trailer-wheelbase 7.7m "
    "--laden '6850 10500 22500' --solo '5200 2000' --empty '5400 3900 5700' --load-height '1.3 m +- 0.1 m'",
    "fifthwheel vehicle new --tractor tractor_6x4 --trailer semitrailer_2 --wheelbase 4.6m --fifth-wheel 5.2m "
    "--trailer-wheelbase 12.2m --tractor-tare 9.1t --trailer-tare 6.2t --load-mass 17t --out depot_12.toml",
    "fifthwheel vehicle new --like a_double --out depot_13.toml",
    of=vehicle_app,
)
def new(
    *,
    chosen: TruckOptions,
    slip: Annotated[Path | None, typer.Option(help="File with these loads, instead of the three options.")] = None,
    accuracy: Annotated[
        str | None, typer.Option(help="Standard deviation of each load of the slips. Default: 1%.")
    ] = None,
    like: Annotated[
        str | None,
        typer.Option(help="A long combination of the catalogue to start from, such as a_double."),
    ] = None,
    out: Annotated[Path, typer.Option("--out", "-o", help="Vehicle file to write.")] = Path("truck.toml"),
    force: ForceFileOption = False,
) -> None:
    """Write the vehicle file of a tractor-semitrailer from a brochure, a tape measure and weighbridge slips.

    Asks for what the options do not give, if one of --tractor, --trailer, --wheelbase and --trailer-wheelbase is
    missing. Numbers have a unit, and may have a standard deviation: '7.7 m +- 2 cm'. Vehicle classes give what nobody
    knows, with its uncertainty. For a vehicle with more units, --like writes a file to edit.
    """
    from fifthwheel.errors import VehicleError
    from fifthwheel.vehicle.classes.template import template
    from fifthwheel.workflow.new_vehicle import new_vehicle
    from fifthwheel.workflow.vehicle_questions import QUESTIONS, describe

    answers = {key: text for key, text in vars(chosen).items() if text is not None}
    if like and (answers or slip):
        raise VehicleError("like: expected alone, got other options too; edit the file that it writes")
    with reserved(out, force=force):
        if like:
            with atomic_write(out) as temporary:
                temporary.write_text(template(like), encoding="utf-8")
            terminal.print_files({"vehicle": out})
            return
        if sys.stdin.isatty() and any(q.required and q.key not in answers for q in QUESTIONS):
            answers = ask([q for q in QUESTIONS if not (slip and q.is_slip)], answers)
        text = new_vehicle(describe(answers, slip=slip, accuracy=accuracy))
        with atomic_write(out) as temporary:
            temporary.write_text(text, encoding="utf-8")
    terminal.print_files({"vehicle": out})


def ask(questions: "Iterable[Question]", known: Mapping[str, str]) -> dict[str, str]:
    """All answers by their keys, the known ones included.

    Each question that is not known and applies is asked on the terminal until its answer is valid; an empty answer
    stands for a number that is not known.
    """
    from fifthwheel.errors import VehicleError

    typer.echo("Give each number with its unit, and how well you know it, such as 7.7 m +- 2 cm. Empty: not known.")
    answers = dict(known)
    for question in questions:
        if question.key in answers or not question.applies(answers):
            continue
        choices = f" ({', '.join(question.choices)})" if question.choices else ""
        while True:
            answer = typer.prompt(question.text + choices, default="", show_default=False).strip()
            if not answer and not question.required:
                break
            try:
                question.parse(answer)
            except VehicleError as error:
                typer.secho(str(error), fg="red", err=True)
                continue
            answers[question.key] = answer
            break
    return answers
