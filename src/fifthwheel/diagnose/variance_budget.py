"""Variance budget: the fraction of a variance that comes from each parameter that the logs do not determine."""

from dataclasses import dataclass

from fifthwheel.diagnose.thresholds import DOMINANT_FRACTION, NOTABLE_SIGMA
from fifthwheel.identify import Identification, Verdict


@dataclass(frozen=True, kw_only=True)
class VarianceTerm:
    """A contribution to the variance of a parameter."""

    parameter: str
    source: str  # the considered or not identified parameter whose uncertainty it comes from
    fraction: float  # of the parameter's variance


def variance_budget(identification: Identification, name: str) -> list[VarianceTerm]:
    """The terms of a parameter's variance, the largest first; empty for a method that does not compute them."""
    terms = identification.variance_budget.get(name, {}).items()
    return [VarianceTerm(parameter=name, source=source, fraction=fraction) for source, fraction in terms]


def dominant_terms(identification: Identification) -> list[VarianceTerm]:
    """Of each converged parameter with a notable sigma, the uncertain parameter that causes most of its variance."""
    terms = []
    for estimate in identification.parameters:
        if estimate.verdict is not Verdict.CONVERGED or not estimate.sigma:
            continue
        if estimate.sigma >= NOTABLE_SIGMA * abs(estimate.value):
            terms += variance_budget(identification, estimate.name)[:1]
    return [term for term in terms if term.fraction > DOMINANT_FRACTION]
