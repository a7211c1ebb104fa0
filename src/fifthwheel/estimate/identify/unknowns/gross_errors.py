"""Gross errors: those beyond the prior, and how far from it a truck or a sensor can be at all."""

import math
from typing import NamedTuple

from fifthwheel.data.channels import SensorErrorName
from fifthwheel.estimate.identify.unknowns.unknown import Unknown
from fifthwheel.truck.quantities import quantity_of

RATE = 0.003
"""Of gross errors of a number of weight 1: a log has 80 numbers, and one in four logs an error."""
RANGE = 3.0
"""A gross error is at most so many of its standard deviations."""


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
