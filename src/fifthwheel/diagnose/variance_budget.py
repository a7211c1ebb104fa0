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
    """The terms of a parameter's variance, the largest first; empty for a parameter without a covariance.

    The fraction of a source j in the variance of i is the squared correlation P_ij² / (P_ii P_jj): considered
    parameters keep their prior, and the estimate depends on them linearly.
    """
    covariance = identification.covariance
    if covariance is None or name not in covariance.names:
        return []
    i, P = covariance.names.index(name), covariance.covariance
    considered = [e for e in identification.uncertain if e.verdict is Verdict.FIXED]
    considered += [e for e in identification.parameters if e.verdict in (Verdict.NOT_EXCITED, Verdict.NOT_IDENTIFIABLE)]
    sources = {e.name: covariance.names.index(e.name) for e in considered if e.name in covariance.names}
    terms = [
        VarianceTerm(parameter=name, source=source, fraction=float(P[i, j] ** 2 / (P[i, i] * P[j, j])))
        for source, j in sources.items()
        if j != i
    ]
    return sorted(terms, key=lambda term: -term.fraction)


def dominant_terms(identification: Identification) -> list[VarianceTerm]:
    """Of each converged parameter with a notable sigma, the uncertain parameter that causes most of its variance."""
    uncertain = {e.name for e in identification.uncertain}
    terms = []
    for estimate in identification.parameters:
        if estimate.verdict is not Verdict.CONVERGED or not estimate.sigma:
            continue
        if estimate.sigma >= NOTABLE_SIGMA * abs(estimate.value):
            terms += variance_budget(identification, estimate.name)[:1]
    return [term for term in terms if term.fraction > DOMINANT_FRACTION and term.source in uncertain]
