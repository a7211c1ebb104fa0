"""fifthwheel vehicle new"""

import shlex
import signal
import sys
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fifthwheel.apps.cli import terminal
from fifthwheel.apps.cli.app import command, vehicle_app
from fifthwheel.apps.cli.options import ForceFileOption
from fifthwheel.base.atomic import reserved, write_text
from fifthwheel.base.options import TruckOptions
from fifthwheel.base.settings import options_of

if TYPE_CHECKING:
    from fifthwheel.apps.workflow.vehicle_questions import Question


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
    asking: Annotated[bool, typer.Option("--ask", help="Ask for all that the options do not give.")] = False,
    out: Annotated[Path, typer.Option("--out", "-o", help="Vehicle file to write.")] = Path("truck.toml"),
    force: ForceFileOption = False,
) -> None:
    """Write the vehicle file of a tractor-semitrailer from a brochure, a tape measure and weighbridge slips.

    Asks for what the options do not give, if one of --tractor, --trailer, --wheelbase and --trailer-wheelbase is
    missing, or with --ask. Ctrl-C or Ctrl-D end the questions and print the command that continues them. Numbers have
    a unit, and may have a standard deviation: '7.7 m +- 2 cm'. Vehicle classes give what nobody knows, with its
    uncertainty. For a vehicle with more units, --like writes a file to edit.
    """
    from fifthwheel.apps.workflow.new_vehicle import new_vehicle
    from fifthwheel.apps.workflow.vehicle_questions import QUESTIONS, conditions, describe
    from fifthwheel.base.errors import VehicleError
    from fifthwheel.truck import Vehicle
    from fifthwheel.truck.catalogue import template

    given = {key: text for key, text in vars(chosen).items() if text is not None}
    if like and (given or slip or accuracy or asking):
        raise VehicleError("like: expected alone, got other options too; edit the file that it writes")
    with reserved(out, force=force):
        if like:
            write_text(out, template(like))
            terminal.print_files({"vehicle": out})
            return
        answers = dict(given)
        try:
            if asking or (sys.stdin.isatty() and any(q.required and q.key not in answers for q in QUESTIONS)):
                ask(QUESTIONS, answers, weighed=conditions(slip))
            text = new_vehicle(describe(answers, slip=slip, accuracy=accuracy))
        except (VehicleError, typer.Abort) as error:
            if answers != given:
                _print_answers({key: text for key, text in answers.items() if key not in given}, asking=asking)
            if isinstance(error, typer.Abort):
                raise typer.Exit(128 + signal.SIGINT) from None
            raise
        write_text(out, text)
    terminal.warn_of_masses(Vehicle.loads(text))
    terminal.print_files({"vehicle": out})


def ask(questions: "Iterable[Question]", answers: dict[str, str], *, weighed: Collection[str] = ()) -> None:
    """Add all answers to the known ones, by their keys; `weighed` are the conditions whose loads are in a file.

    Each question that is not answered and has a use is asked on the terminal until its answer is valid; an empty answer
    stands for a number that is not known.

    Raises:
        typer.Abort: the user ends the questions by Ctrl-C or Ctrl-D.
    """
    from fifthwheel.base.errors import VehicleError

    typer.echo("Give each number with its unit, and how well you know it, such as 7.7 m +- 2 cm. Empty: not known.")
    with _interruptible():
        for question in questions:
            known = answers | dict.fromkeys(weighed, "")
            if question.key in known or (question.is_slip and weighed) or question.unused(known):
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


@contextmanager
def _interruptible() -> Iterator[None]:
    """Ctrl-C ends a question instead of the process."""
    previous = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, previous)


def _print_answers(answers: Mapping[str, str], *, asking: bool) -> None:
    """Print the command that has the answers as options, and asks for the others."""
    known = options_of(TruckOptions)
    words = [word for key, text in answers.items() for word in (known[key].flags_of(key)[0], text)]
    words = ["fifthwheel", *sys.argv[1:], *([] if asking else ["--ask"]), *words]
    typer.echo(f"\nNo file is written. To continue with the answers:\n{shlex.join(words)}", err=True)
