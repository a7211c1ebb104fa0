"""What is compared: every published number beside what each arm found, over the seeds.

Errors are in per cent of what the plant truly has. Its tyres are not linear, so that a cornering stiffness has a range,
the effective one between 0.1 and 1 degree of steer: its error is how far it lies outside, 0 within. A state's row has
the rms of its error over the drive, and no other reference.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from fifthwheel.paper.experiments import LANDING_LEG, Experiment
from fifthwheel.paper.published import (
    COG_HEIGHT,
    DRIVE,
    FRONT,
    PAYLOAD_HEIGHT,
    RESULTS,
    ROLL_INERTIA,
    TRAILER,
    YAW_INERTIA,
    Published,
)
from fifthwheel.paper.runs import Outcome


class Quantity(NamedTuple):
    """How a quantity is written."""

    words: str
    symbol: str  # the article's
    unit: str  # SI


QUANTITIES = {
    FRONT: Quantity("cornering stiffness, front axle", "C_α1f", "N/rad"),
    DRIVE: Quantity("cornering stiffness, drive axle", "C_α1r", "N/rad"),
    TRAILER: Quantity("cornering stiffness, trailer", "C_α2", "N/rad"),
    YAW_INERTIA: Quantity("trailer yaw inertia", "I_2zz", "kg m^2"),
    PAYLOAD_HEIGHT: Quantity("payload height", "h_2p", "m"),
    COG_HEIGHT: Quantity("height of trailer CoG", "h_2s", "m"),
    ROLL_INERTIA: Quantity("trailer roll inertia", "I_2sx'x'", "kg m^2"),
    "sideslip.semitrailer": Quantity("rms error, trailer sideslip", "β_2", "rad"),
    "roll.semitrailer": Quantity("rms error, trailer roll", "φ_2", "rad"),
    LANDING_LEG: Quantity("rms error, landing-leg sideslip", "", "rad"),
}
CASES = {
    "simulation": "Simulated truck, uniform payload (section 3)",
    "point payload": "Simulated truck, point payload (section 3.3)",
    "test vehicle": "Truck close to the test vehicle (section 4)",
    "test vehicle, flawed": "The same with the flaws that the article suspects (section 4)",
}
"""Experiment -> heading, in this order."""


@dataclass(frozen=True, kw_only=True)
class Found:
    """What one arm found of a quantity, over its seeds."""

    arm: str
    seeds: int
    mean: float
    deviation: float | None  # standard deviation over the seeds; None for one seed
    error: float | None  # of the mean, per cent
    worst: float  # the seed that is farthest off
    worst_error: float | None
    converged: int | None  # seeds with that verdict; None if the arm held it, or for a state
    held: bool = False
    factor: float | None = None  # error of the mean by the published one
    worse_seeds: int | None = None  # seeds that are farther off than the published run


@dataclass(frozen=True, kw_only=True)
class Row:
    """One quantity of one experiment."""

    experiment: str
    section: str
    quantity: str
    published: Published | None = None
    reference: tuple[float, float] | None = None  # the plant's, SI; two equal numbers unless it is a range
    arms: tuple[Found, ...] = ()

    @property
    def text(self) -> Quantity:
        return QUANTITIES[self.quantity]


def rows(experiments: Mapping[str, Experiment], outcomes: Sequence[Outcome]) -> list[Row]:
    """Every published number with what each arm found, then the states' errors, experiment by experiment."""
    made = []
    for name in sorted(experiments, key=[*CASES, *experiments].index):
        experiment = experiments[name]
        own = [outcome for outcome in outcomes if outcome.experiment == name]
        vehicle = experiment.drive.vehicle
        truth = vehicle.parameters() | vehicle.derived()
        numbers = {p.quantity: p for p in RESULTS if p.case == name.partition(",")[0]}
        section = "4" if name.startswith("test vehicle") else "3"
        blank = [Row(experiment=name, section=p.place, quantity=q, published=p) for q, p in numbers.items()]
        if section == "4" and FRONT not in numbers:  # the article holds it
            blank.insert(0, Row(experiment=name, section="4.2", quantity=FRONT))
        for row in blank:
            low, high = sorted(experiment.stiffness.get(row.quantity, (truth[row.quantity],) * 2))
            arms = tuple(_found(row, arm.name, own, (low, high)) for arm in experiment.arms if _of(arm.name, own))
            made.append(replace(row, reference=(low, high), arms=arms))
        for state in ("sideslip.semitrailer", "roll.semitrailer", LANDING_LEG):
            row = Row(experiment=name, section=f"{section}.4", quantity=state)
            arms = tuple(_rms(state, arm.name, own) for arm in experiment.arms if _of(arm.name, own))
            made.append(replace(row, arms=arms))
    return made


def _of(arm: str, outcomes: Sequence[Outcome]) -> list[Outcome]:
    return [outcome for outcome in outcomes if outcome.arm == arm]


def off(value: float, reference: tuple[float, float]) -> float:
    """Per cent by which a value misses a reference, or lies outside a range: above it positive, 0 within."""
    low, high = reference
    nearest = min(max(value, low), high)
    return 100 * (value / nearest - 1)


def _found(row: Row, arm: str, outcomes: Sequence[Outcome], reference: tuple[float, float]) -> Found:
    own = _of(arm, outcomes)
    values = [outcome.values[row.quantity] for outcome in own]
    verdicts = [outcome.verdicts[row.quantity] for outcome in own]
    mean = float(np.mean(values))
    middle = sum(reference) / 2
    worst = max(values, key=lambda value: (abs(off(value, reference)), abs(value - middle)))
    published = None if row.published is None or row.published.error is None else 100 * abs(row.published.error)
    held = all(verdict == "held" for verdict in verdicts)
    return Found(
        arm=arm,
        seeds=len(own),
        mean=mean,
        deviation=float(np.std(values, ddof=1)) if len(own) > 1 else None,
        error=off(mean, reference),
        worst=worst,
        worst_error=off(worst, reference),
        converged=None if held else sum(verdict == "converged" for verdict in verdicts),
        held=held,
        factor=None if published is None else abs(off(mean, reference)) / published,
        worse_seeds=None if published is None else sum(abs(off(value, reference)) > published for value in values),
    )


def _rms(state: str, arm: str, outcomes: Sequence[Outcome]) -> Found:
    values = [outcome.rms[state] for outcome in _of(arm, outcomes)]
    deviation = float(np.std(values, ddof=1)) if len(values) > 1 else None
    mean, worst = float(np.mean(values)), max(values)
    return Found(
        arm=arm,
        seeds=len(values),
        mean=mean,
        deviation=deviation,
        error=None,
        worst=worst,
        worst_error=None,
        converged=None,
    )
