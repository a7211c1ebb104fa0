"""The posterior of the unknowns: a covariance that allows for model error and for considered parameters.

The unknowns z have the prior N(0, I) and, in the logs, the Fisher information H. A considered parameter c keeps its
prior mean; the others, e, are estimated.

1. If the model is right, the covariance of z_e is P = (I + H_ee)^-1.
2. Model error makes residuals autocorrelated, and the scores scatter more than H. With M, the long-run covariance of
   the sum of the scores, the covariance is the sandwich V = P (I + M) P (White 1982; Newey and West 1987). The larger
   of both variances counts: d_i^2 = max(V_ii / P_ii, 1). Correlations are those of P.
3. An error of z_c shifts z_e by K z_c, with K = -P H_ec (Schmidt 1966).

    cov(z_e, z_e) = D P D + K K'       D = diag(d)
    cov(z_e, z_c) = K
    cov(z_c, z_c) = I
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from fifthwheel._types import Array

HIGH_CORRELATION = 0.8
"""Two unknowns that are correlated by more than this are hardly separable."""


@dataclass(frozen=True, kw_only=True)
class Posterior:
    """All k unknowns z of a problem, with the prior N(0, I)."""

    names: tuple[str, ...]
    information: Array  # (k, k) of the logs, without the prior
    covariance: Array  # (k, k)
    nuisances: tuple[int, ...] = ()  # indices of sensor errors and initial states

    @classmethod
    def from_information(
        cls,
        names: Sequence[str],
        information: Array,
        scores: Array | None = None,
        *,
        considered: Sequence[str] = (),
        nuisances: Sequence[int] = (),
    ) -> Self:
        """The posterior by the equations of this module: information H (k, k), scores M (k, k).

        M is H if it is None: the model is right. `considered` are names, `nuisances` indices of sensor errors and
        initial states.
        """
        k = len(names)
        fixed = np.array([name in considered for name in names])
        free = ~fixed
        H = information[np.ix_(free, free)]
        M = H if scores is None else scores[np.ix_(free, free)]
        P = np.linalg.inv(np.eye(len(H)) + H)
        widening = model_error_factors(P, M)
        shift = -P @ information[np.ix_(free, fixed)]
        covariance = np.eye(k)
        covariance[np.ix_(free, free)] = P * np.outer(widening, widening) + shift @ shift.T
        covariance[np.ix_(free, fixed)] = shift
        covariance[np.ix_(fixed, free)] = shift.T
        return cls(
            names=tuple(names),
            information=information,
            covariance=(covariance + covariance.T) / 2,
            nuisances=tuple(nuisances),
        )

    @property
    def sigma(self) -> Array:
        """Standard deviation of each z (k,)."""
        return np.sqrt(np.diag(self.covariance))

    def conditional_sigma(self, i: int) -> float:
        """Standard deviation of z_i if all other parameters were known, but not the sensor errors and initial states.

        If those were known too, the small yaw rate that a steering offset causes would count as excitation.
        """
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


def model_error_factors(P: Array, M: Array) -> Array:
    """d (k,) of the second equation of this module, from P (k, k) and M (k, k)."""
    return np.sqrt(np.maximum(np.diag(P @ (np.eye(len(P)) + M) @ P) / np.diag(P), 1.0))


def without(information: Array, indices: Sequence[int]) -> Array:
    """The information matrix (k, k) with zeros for some unknowns."""
    reduced = information.copy()
    reduced[list(indices), :] = 0.0
    reduced[:, list(indices)] = 0.0
    return reduced
