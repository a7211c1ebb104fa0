"""One unknown of an identification, with its prior and bounds, and gross errors of it: those beyond the prior."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from fifthwheel.base.errors import VehicleError
from fifthwheel.base.formatting import percent
from fifthwheel.base.names import ParameterPath
from fifthwheel.data.channels import SensorErrorName, is_sensor_error
from fifthwheel.estimate.filters.scaling import Scaling
from fifthwheel.truck.quantities import quantity_of

GUESS_TAIL = 3.0
"""Beyond about this number of standard deviations the prior of a guess falls only exponentially: it may be far off."""
BOUND_FACTOR = 8.0
"""A stiffness or inertia stays between its prior mean divided by this factor and multiplied by it."""
BOUND_SIGMAS = 8.0
"""Any other unknown stays within this number of prior standard deviations of its mean."""
RATE = 0.003
"""Of gross errors of a number of weight 1: a log has 80 numbers, and one in four logs an error."""
RANGE = 3.0
"""A gross error is at most so many of its standard deviations."""


@dataclass(frozen=True, kw_only=True)
class Unknown:
    """One unknown: p = centre exp(scale z) or p = centre + scale z with the prior z ~ N(0, 1), within bounds.

    A guess has the hyperbolic prior density exp(-c^2 (sqrt(1 + (z / c)^2) - 1)) with the tail c, a scale mixture of
    normal densities (Barndorff-Nielsen 1977), which allows large errors.
    """

    name: str
    centre: float  # prior mean (median if logarithmic), SI
    scale: float  # prior standard deviation: of ln p if logarithmic, else of p
    lower: float  # bounds of p
    upper: float
    possible: tuple[float, float] = (-math.inf, math.inf)  # range of p in any vehicle
    logarithmic: bool = False
    per_log: bool = False  # each log has its own
    reported: bool = False  # listed first in the result, with a verdict
    estimated: bool = True  # the logs change it; else it keeps its prior mean: a learner has its effect in every sigma
    tail: float = math.inf  # where the exponential tail of its prior begins, in z; infinite: normal
    moves: Mapping[str, float] = field(default_factory=dict)  # model parameters and their slopes, SI per unit of p
    given: Mapping[str, float] = field(default_factory=dict)  # values of those that are above 0, SI

    @property
    def path(self) -> ParameterPath:
        """Its parsed name."""
        return ParameterPath.of(self.name)

    @property
    def is_sensor_error(self) -> bool:
        """Whether it is an error of a sensor or of a time base."""
        return is_sensor_error(self.name)

    @property
    def is_uncertain(self) -> bool:
        """Whether it is an uncertain number that is not reported: of the truck, its model, or a sensor by its row."""
        error = SensorErrorName.of(self.name)
        return not self.reported and (error is None or (error.row is not None and error.row.uncertain))

    @property
    def is_of_truck(self) -> bool:
        """Whether it is a number of truck or road that all logs share."""
        return not (self.is_sensor_error or self.per_log)

    @property
    def prior_sigma(self) -> float:
        """Prior standard deviation of p, SI."""
        return self.scale * (self.centre if self.logarithmic else 1.0)

    @property
    def slopes(self) -> Mapping[str, float]:
        """The model parameters that it changes, each with its derivative with respect to p; by default its own."""
        return self.moves or {self.name: 1.0}

    def sigma(self, value: float, sigma_z: float) -> float:
        """Standard deviation of p, SI, at a value of p: sigma_z dp/dz."""
        return sigma_z * self.slope(value)

    def change(self, deviation: float) -> float:
        """Change of p, SI, from its prior mean by so many prior standard deviations."""
        return self.centre * math.expm1(self.scale * deviation) if self.logarithmic else self.scale * deviation

    def within(self, low: float, high: float) -> "Unknown":
        """The unknown with bounds within the range that it can have, widened to its centre."""
        possible = min(low, self.centre), max(high, self.centre)
        lower, upper = max(self.lower, possible[0]), min(self.upper, possible[1])
        return replace(self, lower=lower, upper=upper, possible=possible)

    def reaching(self, largest: float) -> "Unknown":
        """The unknown with bounds so many prior standard deviations away, within the range that it can have."""
        lower, upper = (self.centre + self.change(z) for z in (-largest, largest))
        return replace(self, lower=lower, upper=upper).within(*self.possible)

    def slope(self, value: float) -> float:
        """dp/dz at a value of p."""
        return value * self.scale if self.logarithmic else self.scale


def scaling(unknowns: Sequence[Unknown]) -> Scaling:
    """The transformation between z and p for several unknowns."""
    return Scaling(
        logarithmic=tuple(u.logarithmic for u in unknowns),
        **{field: np.array([getattr(u, field) for u in unknowns]) for field in ("centre", "scale", "lower", "upper")},
    )


def logarithmic_unknown(
    name: str, value: float, sigma: float, *, reported: bool = False, tail: float = math.inf
) -> Unknown:
    """A parameter above 0, with sigma as a fraction of its value; a VehicleError if the value is not above 0, or sigma
    not below it."""
    if value <= 0:
        raise VehicleError(
            f"{name}: expected above 0 to be estimated, got {value:g}; fix it, or give it a value above 0"
        )
    if sigma >= 1:
        raise VehicleError(
            f"{name}: expected a standard deviation below 100 % of the value, got {percent(sigma)}; give a smaller one"
        )
    lower, upper = value / BOUND_FACTOR, value * BOUND_FACTOR
    return Unknown(
        name=name, centre=value, scale=sigma, lower=lower, upper=upper, logarithmic=True, reported=reported, tail=tail
    )


def linear_unknown(
    name: str,
    mean: float,
    sigma: float,
    *,
    reported: bool = False,
    moves: Mapping[str, float] | None = None,
    per_log: bool = False,
) -> Unknown:
    """An unknown with a normal prior, SI, within the bounds of its row: it may be 0 or negative.

    An estimated position stays within two standard deviations: further away, an axle or a coupling would not support
    its unit.
    """
    row = quantity_of(name)
    reach = (2 if reported and row.is_position else BOUND_SIGMAS) * sigma
    lower, upper = row.bounds or (mean - reach, mean + reach)
    own = per_log or row.scope == "log"
    return Unknown(
        name=name, centre=mean, scale=sigma, lower=lower, upper=upper, reported=reported, moves=moves or {}, per_log=own
    )


def limited_unknown(name: str, mean: float, sigma: float, largest: float = 1.0) -> Unknown:
    """An uncertain number from 0 to the largest one, such as a fraction."""
    return replace(linear_unknown(name, mean, sigma), lower=0.0, upper=largest).within(0.0, largest)


class GrossError(NamedTuple):
    """A gross error of an unknown."""

    size: float  # its standard deviation, in units of the prior
    weight: float  # how common it is, relative to others

    @property
    def prior_odds(self) -> float:
        """Logarithm of the odds before any log."""
        return math.log(RATE * self.weight)


def gross_error(unknown: Unknown) -> GrossError | None:
    """The gross error of an unknown; None if it is not larger than the prior."""
    error = SensorErrorName.of(unknown.name)
    row = (error.row if error else None) or quantity_of(unknown.name)
    size = row.gross / unknown.scale
    return GrossError(size, row.weight) if size > 1 else None


def is_possible(unknown: Unknown, deviation: float) -> bool:
    """Whether a truck can have an unknown so many prior standard deviations from its prior mean."""
    return abs(deviation) <= largest_possible(unknown)


def largest_possible(unknown: Unknown) -> float:
    """Prior standard deviations from its prior mean that a truck can have an unknown."""
    error = gross_error(unknown)
    reach = RANGE * (error.size if error else max(1.0, unknown.tail))
    if unknown.logarithmic:
        return reach
    return min(reach, max(abs(end - unknown.centre) for end in unknown.possible) / unknown.scale)
