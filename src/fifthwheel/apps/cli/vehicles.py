"""fifthwheel vehicle, weigh, mass and roll-test: show and write vehicle files"""

import shlex
import signal
import sys
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fifthwheel.apps.cli import common
from fifthwheel.apps.cli.app import command, vehicle_app
from fifthwheel.base.atomic import reserved, write_text
from fifthwheel.base.options import TruckOptions
from fifthwheel.base.settings import options_of

if TYPE_CHECKING:
    from fifthwheel.apps.workflow.new_vehicle import Question
    from fifthwheel.truck import Measured


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
        str | None, typer.Option(help="Standard deviation of each load of the slips, such as 20kg. Default: 1%.")
    ] = None,
    like: Annotated[
        str | None,
        typer.Option(help="A long combination of the catalogue to start from, such as a_double."),
    ] = None,
    asking: Annotated[bool, typer.Option("--ask", help="Ask for all that the options do not give.")] = False,
    out: Annotated[Path, typer.Option("--out", "-o", help="Vehicle file to write.")] = Path("truck.toml"),
    force: common.ForceFileOption = False,
) -> None:
    """Write the vehicle file of a tractor-semitrailer from a brochure, a tape measure and weighbridge slips.

    Asks for what the options do not give, if one of --tractor, --trailer, --wheelbase and --trailer-wheelbase is
    missing, or with --ask. Ctrl-C or Ctrl-D end the questions and print the command that continues them. Numbers have
    a unit, and may have a standard deviation: '7.7 m +- 2 cm'. Vehicle classes give what nobody knows, with its
    uncertainty. For a vehicle with more units, --like writes a file to edit.
    """
    from fifthwheel.apps.workflow.new_vehicle import QUESTIONS, conditions, new_vehicle
    from fifthwheel.base.errors import VehicleError
    from fifthwheel.truck import Vehicle
    from fifthwheel.truck.catalogue import template

    given = {key: text for key, text in vars(chosen).items() if text is not None}
    if like and (given or slip or accuracy or asking):
        raise VehicleError("like: expected alone, got other options too; edit the file that it writes")
    with reserved(out, force=force):
        if like:
            write_text(out, template(like))
            common.print_files({"vehicle": out})
            return
        answers = dict(given)
        try:
            if asking or (sys.stdin.isatty() and any(q.required and q.key not in answers for q in QUESTIONS)):
                ask(QUESTIONS, answers, weighed=conditions(slip))
            text = new_vehicle(answers, slip=slip, accuracy=accuracy)
        except (VehicleError, typer.Abort) as error:
            if answers != given:
                _print_answers({key: text for key, text in answers.items() if key not in given}, asking=asking)
            if isinstance(error, typer.Abort):
                raise typer.Exit(128 + signal.SIGINT) from None
            raise
        write_text(out, text)
    common.warn_of_masses(Vehicle.loads(text))
    common.print_files({"vehicle": out})


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


@vehicle_app.callback(invoke_without_command=True)
def _list(context: typer.Context, as_json: common.JsonOption = False) -> None:
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
    as_json: common.JsonOption = False,
) -> None:
    """List the catalogue of published vehicles, or print one as a vehicle file. The word `catalogue` may be left out.

    With --json, a vehicle is printed as its parameters in SI by their paths.
    """
    from fifthwheel.truck import catalogue

    if name is None:
        sources = {entry: catalogue.get(entry).source for entry in catalogue.names()}
        if as_json:
            common.print_json({"vehicles": [{"name": entry, "source": source} for entry, source in sources.items()]})
        else:
            typer.echo("\n".join(f"{entry:24s} {source}" for entry, source in sources.items()))
    elif as_json:
        truck = catalogue.get(name)
        common.print_json({"name": name, "source": truck.source, "parameters": truck.parameters()})
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
        Path | None,
        typer.Option(help="File for a drawing to scale: .html; .svg, .png and .pdf need fifthwheel[figures]."),
    ] = None,
    force: common.ForceFileOption = False,
    as_json: common.JsonOption = False,
) -> None:
    """Show axle loads, handling and oscillations of a vehicle, and the numbers that are assumed.

    The effect of an assumed number is the largest change of a yaw rate or roll rate in a lane change, if the number
    changes by one standard deviation.
    """
    from fifthwheel.apps.workflow.inputs import read_vehicle
    from fifthwheel.model.dynamics.summary import summarize
    from fifthwheel.results.diagnose.predictions import assumed_numbers
    from fifthwheel.results.report.vehicle import vehicle_document

    truck = read_vehicle(vehicle)
    with reserved(plot, force=force):
        common.warn_of_masses(truck)
        summary, numbers = summarize(truck, speed / 3.6), assumed_numbers(truck, speed / 3.6)
        if plot is not None:
            truck.plot().save(plot)
    files = {} if plot is None else {plot.name: plot}
    contents = {"summary": asdict(summary), "assumed": [asdict(number) for number in numbers]}
    common.print_result(contents, partial(vehicle_document, truck, summary, numbers), files, as_json=as_json)


@command(
    "fifthwheel weigh run.mf4 --vehicle truck.toml --signals signals.toml --out weighed.toml",
    "fifthwheel weigh parked.csv -v truck.toml -o weighed.toml --tolerance 0.05",
    "fifthwheel weigh --slip slip.toml -v truck.toml -o weighed.toml",
)
def weigh(
    vehicle: common.VehicleOption,
    log: Annotated[
        Path | None, typer.Argument(help="A log with axle loads: axle_load.tractor.drive, ...", show_default=False)
    ] = None,
    slip: Annotated[
        Path | None, typer.Option(help="A file with the loads of a weighbridge, instead of a log.", show_default=False)
    ] = None,
    signals: common.SignalsOption = None,
    allow_outside: common.AllowOutsideOption = False,
    out: Annotated[Path, typer.Option("--out", "-o", help="Vehicle file to write.")] = Path("weighed.toml"),
    tolerance: Annotated[
        float,
        typer.Option(
            min=0.0,
            help="Permitted difference between the measured front axle load and the one predicted from the other "
            "axles, as a fraction of the tractor's axle loads.",
        ),
    ] = 0.02,
    force: common.ForceFileOption = False,
    as_json: common.JsonOption = False,
) -> None:
    """Set masses and CoG positions of a vehicle file from the axle loads in a log, or from weighbridge slips.

    Axle loads come from on-board weighing: J1939 vehicle weight, the trailer's axle load sum, or the pressure of air
    springs with a calibration (points in signals.toml). Samples at rest are used, or straight running if there are
    none. The load of the front axle may be missing. Yaw and roll inertias stay as they are. Weights of units and of the
    vehicle are named and not used: `fifthwheel mass` uses them.

    A slip file has the loads as masses in tables `[laden]`, `[solo]` (the tractor alone) and `[empty]`, such as
    `tractor.drive = "10500 kg"`, and their standard deviation, `accuracy = "1 %"` or `"20 kg"`. The file then states
    how well masses and CoG positions are known.
    """
    from fifthwheel.apps.workflow.inputs import read_vehicle, vehicle_text
    from fifthwheel.apps.workflow.measured_vehicle import weigh_by_slip, weigh_vehicle
    from fifthwheel.base.errors import FifthwheelError
    from fifthwheel.results.report.vehicle import weighed_document
    from fifthwheel.truck.slip import Slip

    truck, text = read_vehicle(vehicle), vehicle_text(vehicle)
    if (log is None) == (slip is None):
        raise FifthwheelError(f"--slip: expected either a log or a slip, got {'both' if log else 'none'}; give one")
    with reserved(out, force=force):
        if log is not None:
            (record,) = common.load_records([log], signals, allow_outside=allow_outside)
            weighed = weigh_vehicle(record, text, tolerance=tolerance)
        elif slip is not None:
            weighed = weigh_by_slip(Slip.load(slip), text, name=slip.name)
        write_text(out, weighed.text)
    document = partial(weighed_document, weighed.loads, truck, weighed.vehicle, weighed.unused)
    common.print_result(weighed.as_dict(), document, {"vehicle": out}, as_json=as_json)


@command(
    "fifthwheel mass drive.csv --vehicle truck.toml --out driven.toml",
    "fifthwheel mass morning.mf4 noon.mf4 -v truck.toml -s signals.toml -o driven.toml",
)
def mass(
    logs: common.Logs,
    vehicle: common.VehicleOption,
    signals: common.SignalsOption = None,
    allow_outside: common.AllowOutsideOption = False,
    exclude: common.ExcludeOption = None,
    out: Annotated[Path, typer.Option("--out", "-o", help="Vehicle file to write.")] = Path("driven.toml"),
    force: common.ForceFileOption = False,
    as_json: common.JsonOption = False,
) -> None:
    """Set the payload of a vehicle file from logs of ordinary driving with one load, and from axle loads in them.

    The mass follows from the force of the engine and the acceleration, on roads of unknown grade. The logs have speed,
    braking.<unit>, engine_speed and engine_torque, or drive_force in place of the engine; and if possible
    driveline_engaged, friction_torque and grade. `[driveline]` of the vehicle file states losses, scales and rotating
    masses. Axle loads and weights (axle_load.<axle group>, weight.<unit>, gross_weight) add to that or replace it; with
    axle loads the CoG of the laden unit follows, too. The new file states how well mass and CoG are known. Unladen
    masses stay; yaw inertia, stiffness and relaxation length of the tyres follow the load. If only the mass was wrong
    in the file, copy the masses from the new file.
    """
    from fifthwheel.apps.workflow.inputs import read_vehicle, vehicle_text
    from fifthwheel.apps.workflow.measured_vehicle import drive_vehicle
    from fifthwheel.results.report.vehicle import mass_document

    truck, text = read_vehicle(vehicle), vehicle_text(vehicle)
    with reserved(out, force=force):
        records = common.load_records(logs, signals, allow_outside=allow_outside, exclude=exclude)
        common.warn_of_masses(truck)
        driven = drive_vehicle(records, text)
        write_text(out, driven.text)
    document = partial(mass_document, driven.result, driven.before, driven.changed)
    common.print_result(driven.as_dict(), document, {"vehicle": out}, as_json=as_json)


@command(
    'fifthwheel roll-test -v truck.toml --load "2 t +- 10 kg" --shift "0.9 m +- 5 mm" --roll "0.42 deg +- 0.01 deg"',
    'fifthwheel roll-test -v truck.toml --load "2 t +- 1 %" --shift "0.9 m +- 1 %" --roll "0.42 deg +- 2 %" '
    '--displacement "0.7 mm +- 0.1 mm" --height "0.9 m +- 5 mm"',
)
def roll_test(
    vehicle: common.VehicleOption,
    load: Annotated[str, typer.Option(help="Mass of the load that is moved sideways.")],
    shift: Annotated[str, typer.Option(help="Distance by which it is moved.")],
    roll: Annotated[str, typer.Option(help="Change of the roll angle of the body.")],
    displacement: Annotated[
        str | None, typer.Option(help="Displacement of a point of the body to the side to which it leans.")
    ] = None,
    height: Annotated[str | None, typer.Option(help="Height of that point above the ground.")] = None,
    unit: Annotated[str | None, typer.Option(help="Unit with the load. Default: the last one.")] = None,
    out: Annotated[Path, typer.Option("--out", "-o", help="Vehicle file to write.")] = Path("tested.toml"),
    force: common.ForceFileOption = False,
    as_json: common.JsonOption = False,
) -> None:
    """Set roll stiffness and roll axis height of a vehicle file from a static test.

    A known load on the parked truck is moved sideways; an inclinometer measures how far the body rolls. A dial gauge
    near the height of the roll axis, if there is one, measures how far the body moves to the side there. State the
    standard deviation of each reading after +-. The vehicle file describes the truck with the load.
    """
    from fifthwheel.apps.workflow.inputs import read_vehicle
    from fifthwheel.apps.workflow.measured_vehicle import changed_numbers, roll_tested_vehicle
    from fifthwheel.results.report.vehicle import roll_test_document
    from fifthwheel.truck import RollTest

    truck = read_vehicle(vehicle)
    test = RollTest(
        unit=unit or truck.units[-1].name,
        load=_measured("--load", load, "kg"),
        shift=_measured("--shift", shift, "m"),
        roll=_measured("--roll", roll, "rad"),
        displacement=_measured("--displacement", displacement, "m") if displacement else None,
        height=_measured("--height", height, "m") if height else None,
    )
    with reserved(out, force=force):
        tested = roll_tested_vehicle(truck, test)
        tested.save(out)
    changed = changed_numbers(truck, tested)
    document = partial(roll_test_document, tested, changed)
    common.print_result({"parameters": changed}, document, {"vehicle": out}, as_json=as_json)


def _measured(option: str, text: str, si: str) -> "Measured":
    """A reading with its standard deviation; a FifthwheelError if the text is none."""
    from fifthwheel.base.errors import FifthwheelError
    from fifthwheel.base.units import uncertain_quantity
    from fifthwheel.truck import Measured

    try:
        value, sigma = uncertain_quantity(text, si)
    except FifthwheelError as error:
        raise FifthwheelError(f"{option}: {error}") from None
    if sigma is None:
        raise FifthwheelError(f"{option}: expected a standard deviation after '+-', got {text}; write '{text} +- 1 %'")
    return Measured(value, sigma)
