"""A vehicle on a terminal: loads, handling, oscillations, and the numbers that are assumed."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from fifthwheel.dynamics.summary import VehicleSummary
from fifthwheel.formatting import enumerated, percent, with_sigma
from fifthwheel.report.terminal.page import TerminalPage
from fifthwheel.vehicle import Vehicle, unit_of

if TYPE_CHECKING:
    from rich.console import Console

    from fifthwheel.diagnose.assumptions import AssumedNumber


def show_vehicle(
    vehicle: Vehicle,
    summary: VehicleSummary,
    assumed: "Sequence[AssumedNumber]",
    console: "Console | None" = None,
) -> None:
    """Print the summary of a vehicle, and its assumed numbers with their source and effect."""
    page = TerminalPage(console)
    page.headline(f"{vehicle.name}: {' + '.join(unit.name for unit in vehicle.units)}, {summary.at_speed}")
    page.table(("Quantity", "Value>"), summary.rows())
    if not assumed:
        page.line("\nNo number is assumed from a vehicle class.")
        return
    page.table(
        ("Assumed", "Value>", "Yaw>", "Roll>"),
        [(n.path, with_sigma(n.value, n.sigma, unit_of(n.path)), _effect(n.yaw), _effect(n.roll)) for n in assumed],
    )
    sources: dict[str, list[str]] = {}
    for number in assumed:
        sources.setdefault(number.source, []).append(number.path)
    page.lists(
        ("Sources", [f"{enumerated(paths)}: {source}" for source, paths in sources.items()]),
        (
            "Notes",
            [
                "Yaw, Roll: largest change of a yaw rate and of a roll rate in a lane change by one sigma of the "
                "number, as a fraction of the rms value.",
                "Measure the numbers with the largest effects, and write them into the vehicle file. Cornering "
                "stiffness, the trailers' yaw inertia and payload heights are estimated from logs.",
            ],
        ),
    )


def _effect(fraction: float | None) -> str:
    return "–" if fraction is None else percent(fraction)
