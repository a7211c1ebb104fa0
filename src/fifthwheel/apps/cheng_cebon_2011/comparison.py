"""The comparison: every published number beside the estimates of each arm, over the seeds.

Errors are in per cent of the true value of the nonlinear truck. Its tyres are not linear, so a cornering stiffness has
a range of true values, the effective stiffness in two steady turns; its error is the distance from this range, 0 within
it. For a state, the comparison is the rms error over the run.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fifthwheel.apps.cheng_cebon_2011.experiments import (
    COG_HEIGHT,
    DRIVE,
    FRONT,
    LANDING_LEG,
    PAYLOAD_HEIGHT,
    RESULTS,
    ROLL_INERTIA,
    TRAILER,
    YAW_INERTIA,
    Experiment,
    Published,
)
from fifthwheel.apps.cheng_cebon_2011.outcomes import Outcome


class ComparedNumber(NamedTuple):
    """How a quantity is written."""

    words: str
    symbol: str  # the article's
    unit: str  # SI


QUANTITIES = {
    FRONT: ComparedNumber("cornering stiffness, front axle", "C_α1f", "N/rad"),
    DRIVE: ComparedNumber("cornering stiffness, drive axle", "C_α1r", "N/rad"),
    TRAILER: ComparedNumber("cornering stiffness, trailer", "C_α2", "N/rad"),
    YAW_INERTIA: ComparedNumber("trailer yaw inertia", "I_2zz", "kg m^2"),
    PAYLOAD_HEIGHT: ComparedNumber("payload height", "h_2p", "m"),
    COG_HEIGHT: ComparedNumber("trailer CoG height", "h_2s", "m"),
    ROLL_INERTIA: ComparedNumber("trailer roll inertia", "I_2sx'x'", "kg m^2"),
    "sideslip.semitrailer": ComparedNumber("rms error, trailer sideslip", "β_2", "rad"),
    "roll.semitrailer": ComparedNumber("rms error, trailer roll", "φ_2", "rad"),
    LANDING_LEG: ComparedNumber("rms error, landing-leg sideslip", "", "rad"),
}
STATES = ("sideslip.semitrailer", "roll.semitrailer", LANDING_LEG)


@dataclass(frozen=True, kw_only=True)
class ArmResult:
    """Estimates of a quantity by one arm, over its seeds; for a state, its rms errors."""

    arm: str
    seeds: int
    mean: float
    deviation: float | None  # standard deviation over the seeds; None for one seed
    error: float | None = None  # error of the mean, per cent; None for a state
    worst: float  # estimate with the largest error
    worst_error: float | None = None
    converged: int | None = None  # number of seeds with this verdict; None for a fixed parameter and for a state
    fixed: bool = False
    factor: float | None = None  # error of the mean divided by the published error
    worse_seeds: int | None = None  # number of seeds with a larger error than published


@dataclass(frozen=True, kw_only=True)
class Row:
    """One quantity of one experiment."""

    experiment: str
    section: str
    quantity: str
    published: Published | None = None
    reference: tuple[float, float] | None = None  # range of true values, SI; None for a state
    arms: tuple[ArmResult, ...] = ()

    @property
    def text(self) -> ComparedNumber:
        """How the quantity is written."""
        return QUANTITIES[self.quantity]


@dataclass(frozen=True, kw_only=True)
class VariantErrors:
    """Errors of one arm in a variant of section 3."""

    name: str
    values: Mapping[str, float]  # error of the mean, per cent of the true value, by quantity
    seeds: int


def compare(experiments: Mapping[str, Experiment], outcomes: Sequence[Outcome]) -> list[Row]:
    """A row for every published number, then for the states, experiment by experiment."""
    rows = []
    for experiment in experiments.values():
        by_arm = _by_arm(experiment, outcomes)
        vehicle = experiment.run.vehicle
        truth = vehicle.parameters() | vehicle.derived()
        section = "4" if experiment.case == "test vehicle" else "3"
        published: dict[str, Published] = {p.quantity: p for p in RESULTS if p.case == experiment.case}
        sections = {quantity: number.place for quantity, number in published.items()}
        if FRONT not in published and section == "4":  # fixed in the article
            sections = {FRONT: "4.2", **sections}
        for quantity, place in sections.items():
            low, high = sorted(experiment.stiffness.get(quantity, (truth[quantity],) * 2))
            number = published.get(quantity) if experiment.published else None
            arms = tuple(_arm_result(arm, selected, quantity, (low, high), number) for arm, selected in by_arm.items())
            keys = {"experiment": experiment.name, "section": place, "quantity": quantity}
            rows.append(Row(**keys, published=number, reference=(low, high), arms=arms))
        for state in STATES:
            arms = tuple(_state_result(arm, [o.rms[state] for o in selected]) for arm, selected in by_arm.items())
            rows.append(Row(experiment=experiment.name, section=f"{section}.4", quantity=state, arms=arms))
    return rows


def compare_variants(variants: Mapping[str, Experiment], outcomes: Sequence[Outcome]) -> list[VariantErrors]:
    """Error of the mean for each variant and arm."""
    errors = []
    for name, experiment in variants.items():
        vehicle = experiment.run.vehicle
        truth = vehicle.parameters() | vehicle.derived()
        for arm, selected in _by_arm(experiment, outcomes).items():
            values = {
                quantity: 100 * (float(np.mean([o.values[quantity] for o in selected])) / truth[quantity] - 1)
                for quantity in selected[0].values
            }
            errors.append(VariantErrors(name=f"{name} ({arm})", values=values, seeds=len(selected)))
    return errors


def percent_error(value: float, reference: tuple[float, float]) -> float:
    """Error against a range, per cent of its nearer end: positive above it, 0 within it."""
    low, high = reference
    nearest = min(max(value, low), high)
    return 100 * (value / nearest - 1)


def _by_arm(experiment: Experiment, outcomes: Sequence[Outcome]) -> dict[str, list[Outcome]]:
    """Outcomes of an experiment by arm, without arms that have none."""
    own = [outcome for outcome in outcomes if outcome.experiment == experiment.name]
    by_arm = {arm.name: [outcome for outcome in own if outcome.arm == arm.name] for arm in experiment.arms}
    return {arm: selected for arm, selected in by_arm.items() if selected}


def _arm_result(
    arm: str, outcomes: Sequence[Outcome], quantity: str, reference: tuple[float, float], published: Published | None
) -> ArmResult:
    values = [outcome.values[quantity] for outcome in outcomes]
    verdicts = [str(outcome.estimates[quantity].verdict) for outcome in outcomes]
    fixed = all(verdict == "fixed" for verdict in verdicts)
    errors = [percent_error(value, reference) for value in values]
    mean, middle = float(np.mean(values)), sum(reference) / 2
    error = percent_error(mean, reference)
    worst = max(values, key=lambda value: (abs(percent_error(value, reference)), abs(value - middle)))
    limit = None if published is None or published.error is None else 100 * abs(published.error)
    return ArmResult(
        arm=arm,
        seeds=len(outcomes),
        mean=mean,
        deviation=float(np.std(values, ddof=1)) if len(values) > 1 else None,
        error=error,
        worst=worst,
        worst_error=percent_error(worst, reference),
        converged=None if fixed else sum(verdict == "converged" for verdict in verdicts),
        fixed=fixed,
        factor=None if limit is None else abs(error) / limit,
        worse_seeds=None if limit is None else sum(abs(e) > limit for e in errors),
    )


def _state_result(arm: str, rms: Sequence[float]) -> ArmResult:
    return ArmResult(
        arm=arm,
        seeds=len(rms),
        mean=float(np.mean(rms)),
        deviation=float(np.std(rms, ddof=1)) if len(rms) > 1 else None,
        worst=max(rms),
    )
