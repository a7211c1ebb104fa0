"""fifthwheel roll-test"""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fifthwheel._atomic import reserved
from fifthwheel.cli import terminal
from fifthwheel.cli.app import command
from fifthwheel.cli.options import ForceFileOption, JsonOption, VehicleOption

if TYPE_CHECKING:
    from fifthwheel.vehicle import Measured


@command(
    'fifthwheel roll-test -v truck.toml --load "2 t +- 10 kg" --shift "0.9 m +- 5 mm" --roll "0.42 deg +- 0.01 deg"',
    'fifthwheel roll-test -v truck.toml --load "2 t +- 1 %" --shift "0.9 m +- 1 %" --roll "0.42 deg +- 2 %" '
    '--displacement "0.7 mm +- 0.1 mm" --height "0.9 m +- 5 mm"',
)
def roll_test(
    vehicle: VehicleOption,
    load: Annotated[str, typer.Option(help="Mass of the load that is moved sideways.")],
    shift: Annotated[str, typer.Option(help="Distance by which it is moved.")],
    roll: Annotated[str, typer.Option(help="Change of the roll angle of the body.")],
    displacement: Annotated[
        str | None, typer.Option(help="Displacement of a point of the body to the side to which it leans.")
    ] = None,
    height: Annotated[str | None, typer.Option(help="Height of that point above the ground.")] = None,
    unit: Annotated[str | None, typer.Option(help="Unit with the load. Default: the last one.")] = None,
    out: Annotated[Path, typer.Option("--out", "-o", help="Vehicle file to write.")] = Path("tested.toml"),
    force: ForceFileOption = False,
    as_json: JsonOption = False,
) -> None:
    """Set roll stiffness and roll axis height of a vehicle file from a static test.

    A known load on the parked truck is moved sideways; an inclinometer measures how far the body rolls. A dial gauge
    near the height of the roll axis, if there is one, measures how far the body moves to the side there. State the
    standard deviation of each reading after +-. The vehicle file describes the truck with the load.
    """
    from fifthwheel.report.vehicle import roll_test_document
    from fifthwheel.vehicle import RollTest
    from fifthwheel.workflow import read_vehicle, roll_tested_vehicle, tested_numbers

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
    contents = {"parameters": tested_numbers(truck, tested)}
    document = partial(roll_test_document, truck, tested)
    terminal.print_result(contents, document, {"vehicle": out}, as_json=as_json)


def _measured(option: str, text: str, si: str) -> "Measured":
    """A reading with its standard deviation.

    Raises:
        FifthwheelError: the text is no quantity with a standard deviation.
    """
    from fifthwheel.errors import FifthwheelError
    from fifthwheel.units import uncertain_quantity
    from fifthwheel.vehicle import Measured

    try:
        value, sigma = uncertain_quantity(text, si)
    except FifthwheelError as error:
        raise FifthwheelError(f"{option}: {error}") from None
    if sigma is None:
        raise FifthwheelError(f"{option}: expected a standard deviation after '+-', got {text}; write '{text} +- 1 %'")
    return Measured(value, sigma)
