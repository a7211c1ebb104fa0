"""Runs of the nonlinear truck for `trust.py`, and the true values of its parameters."""

from collections.abc import Iterable, Sequence
from functools import cache

import numpy as np

from fifthwheel.apps.cheng_cebon_2011.experiments import SPEED
from fifthwheel.apps.studies.scenarios import effective_stiffness
from fifthwheel.estimate.identify import CommonSettings
from fifthwheel.estimate.identify.unknowns.parameters import prior_of_sensor_error
from fifthwheel.model.manoeuvres import Course, lane_changes
from fifthwheel.model.manoeuvres.catalogue import course
from fifthwheel.model.manoeuvres.open_loops import single_sine
from fifthwheel.model.plant import Plant, PlantRun, Properties
from fifthwheel.model.plant.properties import with_changes
from fifthwheel.truck import get

TRUCK = get("cheng_cebon_2011")
RUNS = {"one": "One lane change", "five": "Five lane changes", "everyday": "Everyday driving"}
SINE = "sine "
"""First word of a single sine of the steer angle; then the lateral acceleration of the front axle, m/s^2."""
Changes = tuple[tuple[str, float], ...]
"""Names and values of properties of the nonlinear truck."""
Range = tuple[float, float]
"""Lowest and highest value, SI."""


def sensor_sigma(name: str, settings: CommonSettings) -> float:
    """Prior standard deviation of a sensor error of the truck, SI."""
    prior = prior_of_sensor_error(TRUCK, name, settings)
    return prior[1] if prior else 0.0


def driven(run: str, seed: int, duration: float, changes: Changes = ()) -> PlantRun:
    """A run of the nonlinear truck; only everyday driving depends on the seed and on the duration in s."""
    return _driven(run, *((seed, duration) if run == "everyday" else (0, 0.0)), changes)


@cache
def _driven(run: str, seed: int, duration: float, changes: Changes) -> PlantRun:
    return Plant(TRUCK, with_changes(Properties(), dict(changes))).drive(_course(run, seed, duration))


def _course(run: str, seed: int, duration: float) -> Course:
    if run.startswith(SINE):
        return single_sine(TRUCK, acceleration=float(run.removeprefix(SINE)))
    if run == "everyday":
        return course("everyday", TRUCK, duration=duration, seed=seed)
    return lane_changes(count={"one": 1, "five": 5}[run])


@cache
def stiffness(changes: Changes) -> dict[str, Range]:
    """Range of the nominal stiffness and of the effective stiffness in two steady turns, of each axle group, N/rad."""
    properties = with_changes(Properties(), {name: value for name, value in changes if name != "bank"})
    nominal = TRUCK.parameters()
    return {
        name: (min(*turns, properties.stiffness * nominal[name]), max(*turns, properties.stiffness * nominal[name]))
        for name, turns in effective_stiffness(TRUCK, properties, SPEED).items()
    }


def exact_values() -> dict[str, Range]:
    """Parameters and derived quantities of the truck, as ranges."""
    return {name: (value, value) for name, value in (TRUCK.parameters() | TRUCK.derived()).items()}


def peak_friction(changes: Changes) -> Range:
    """Lowest and highest peak friction of the tyres of the axle groups at their static loads."""
    properties = with_changes(Properties(), {name: value for name, value in changes if name != "bank"})
    tyre, slips = properties.tyre, np.linspace(0.01, 1.0, 200)
    plant_tyres = {"tractor.front": 2, "tractor.drive": 4, "semitrailer": 6}
    peaks = []
    for path, load in TRUCK.axle_loads().items():
        of_tyre = load / plant_tyres[path]
        forces = [float(tyre.side_force(slip, of_tyre, friction=properties.friction)) for slip in slips]
        peaks.append(max(forces) / of_tyre)
    return min(peaks), max(peaks)


def true_ranges(runs: Sequence[Changes]) -> dict[str, Range]:
    """Range of the true value of each parameter and derived quantity in all runs."""
    ranges = [stiffness(changes) for changes in runs]
    return exact_values() | {
        name: (min(r[name][0] for r in ranges), max(r[name][1] for r in ranges)) for name in ranges[0]
    }


def table(heads: Sequence[str], rows: Iterable[Sequence[object]]) -> list[str]:
    """A table as lines of Markdown."""
    lines = [list(heads), ["---"] * len(heads), *[list(map(str, row)) for row in rows]]
    return ["| " + " | ".join(cell.replace("|", r"\|").replace("\n", " ") for cell in line) + " |" for line in lines]
