"""The posterior of the unknowns: a covariance that allows for model error.

The unknowns z have a prior with the precision W (`prior`) and, in the logs, the Fisher information H.

1. If the model is right, the covariance of z is P = (W + H)^-1.
2. Model error makes residuals autocorrelated, and the scores scatter more than H. With M, the long-run covariance of
   the sum of the scores, the covariance is the sandwich V = P (W + M) P (White 1982; Newey and West 1987). The larger
   of both variances counts: d_i^2 = max(V_ii / P_ii, 1). Correlations are those of P.

    cov(z, z) = D P D       D = diag(d)

If all priors are right, the estimates themselves scatter about their prior means with the covariance P (H C H + M) P,
which is C - P if the model is right, with the covariance C of the prior. One that is further away contradicts it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Self

import numpy as np

from fifthwheel.base.types import Array
from fifthwheel.estimate.identify.one_stage.prior import Prior

HIGH_CORRELATION = 0.8
"""Two unknowns that are correlated by more than this are hardly separable."""


@dataclass(frozen=True, kw_only=True)
class ScaledPosterior:
    """All k unknowns z of a problem; `result.posterior` has what follows in SI."""

    names: tuple[str, ...]
    information: Array  # (k, k) of the logs, without the prior
    covariance: Array  # (k, k)
    nuisances: tuple[int, ...] = ()  # indices of all but the estimated parameters

    model_covariance: Array = field(default_factory=lambda: np.zeros((0, 0)))  # P (k, k)
    predictive: Array = field(default_factory=lambda: np.zeros(0))  # standard deviation (k,) of the estimates

    @classmethod
    def from_information(
        cls,
        names: Sequence[str],
        information: Array,
        scores: Array | None = None,
        *,
        nuisances: Sequence[int] = (),
        precision: Array | None = None,
        prior: Prior | None = None,
    ) -> Self:
        """The posterior by the equations of this module: information H (k, k), scores M (k, k).

        M is H if it is None: the model is right. `nuisances` are indices of all but the estimated parameters,
        `precision` (k, k) is that of the prior, by default I; the prior is N(0, I) if it is None.
        """
        H = (information + information.T) / 2
        M = H if scores is None else scores
        W = np.eye(len(H)) if precision is None else precision
        prior = prior or Prior(names, np.full(len(H), np.inf))
        P = np.asarray(np.linalg.inv(W + H))
        widening = model_error_factors(P, prior.score_covariance(W), M)
        covariance = P * np.outer(widening, widening)
        gains = np.eye(len(H)) - P @ W  # P H, of which the product would lose its digits
        scatter = np.maximum(np.diag(prior.spread(gains) + P @ M @ P), prior.variance - np.diag(P))
        return cls(
            names=tuple(names),
            information=information,
            covariance=(covariance + covariance.T) / 2,
            nuisances=tuple(nuisances),
            model_covariance=P,
            predictive=np.sqrt(np.maximum(scatter, 0.0)),
        )

    @property
    def sigma(self) -> Array:
        """Standard deviation of each z (k,)."""
        return np.sqrt(np.diag(self.covariance))

    def sigma_of(self, name: str) -> float:
        """Standard deviation of one z."""
        return float(self.sigma[self.names.index(name)])

    def conditional_sigma(self, name: str) -> float:
        """Standard deviation of one z if all other estimated parameters were known, but not the other unknowns.

        If those were known too, the small yaw rate that a steering offset causes would count as excitation.
        """
        i = self.names.index(name)
        unknown = [i, *[j for j in self.nuisances if j != i]]
        information = self.information[np.ix_(unknown, unknown)]
        return float(np.sqrt(np.linalg.inv(np.eye(len(unknown)) + information)[0, 0]))

    def correlated(self, i: int, limit: int = 3) -> list[int]:
        """At most `limit` unknowns from which z_i is hardly separable, the strongest correlation first."""
        correlation = np.abs(self.covariance[i]) / (self.sigma[i] * self.sigma)
        correlation[i] = 0.0
        strongest = np.argsort(-correlation)[:limit]
        return [int(j) for j in strongest if correlation[j] > HIGH_CORRELATION]

    def most_limiting(self, i: int) -> int:
        """The unknown that would reduce the variance of z_i most if it were known."""
        reduction = self.covariance[i] ** 2 / np.diag(self.covariance)
        reduction[i] = 0.0
        return int(np.argmax(reduction))


def model_error_factors(P: Array, W: Array, M: Array) -> Array:
    """d (k,) of the second equation of this module, from P, W and M (k, k)."""
    return np.sqrt(np.maximum(np.diag(P @ (W + M) @ P) / np.diag(P), 1.0))
