"""What is known after an identification: a covariance that survives model error, verdicts, and what is confused."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fifthwheel.identify.information import Verdict

Array = NDArray[np.float64]

CONFUSED = 0.8
"""Two unknowns that are correlated by more than this can hardly be told apart."""


@dataclass(frozen=True, kw_only=True)
class Posterior:
    """All unknowns z of a problem, whose priors are N(0, 1)."""

    names: tuple[str, ...]
    information: Array  # (k, k) of the logs, without the prior
    covariance: Array  # (k, k), see `posterior`
    nuisances: tuple[int, ...] = ()  # places of the sensors' errors and the initial states

    @property
    def sigma(self) -> Array:
        """Standard deviation of each z (k,)."""
        return np.sqrt(np.diag(self.covariance))

    def alone(self, i: int) -> float:
        """Standard deviation of z_i if all other parameters were known, but not the sensors' errors and the starts:
        with those known too, the little that a steer zero turns the truck would pass for excitation."""
        own = [i, *[j for j in self.nuisances if j != i]]
        return float(np.sqrt(np.linalg.inv(np.eye(len(own)) + self.information[np.ix_(own, own)])[0, 0]))

    def held(self, i: int, j: int) -> float:
        """Standard deviation of z_i if z_j were known as well."""
        P = self.covariance
        return float(np.sqrt(max(P[i, i] - P[i, j] ** 2 / P[j, j], 0.0)))

    def confused(self, i: int, most: int = 3) -> list[int]:
        """The unknowns that z_i can hardly be told apart from, the worst first."""
        correlation = np.abs(self.covariance[i]) / (self.sigma[i] * self.sigma)
        correlation[i] = 0.0
        worst = np.argsort(-correlation)[:most]
        return [int(j) for j in worst if correlation[j] > CONFUSED]

    def worst_companion(self, i: int) -> int:
        """The unknown that z_i would gain most by knowing."""
        gain = self.covariance[i] ** 2 / np.diag(self.covariance)
        gain[i] = 0.0
        return int(np.argmax(gain))


def posterior(
    names: Sequence[str],
    information: Array,
    scores: Array | None = None,
    *,
    considered: Sequence[str] = (),
    nuisances: Sequence[int] = (),
) -> Posterior:
    """Covariance of the estimate.

    Where the model is right it is the inverse of information plus prior, P. Where it is not, residuals hang together
    and scores scatter more than they should: the sandwich P (I + M) P, M the long-run covariance of the scores (White
    1982, Newey and West 1987); each sigma is the greater of both, correlations are those of P. What is considered keeps
    its prior, and moves all others by -P H_fc (Schmidt 1966).

    Args:
        information: (k, k) of the logs.
        scores: (k, k), the long-run covariance of the scores' sum; None to take the model for right.
        considered: names of what is never learned.
        nuisances: places of the sensors' errors and the initial states.
    """
    k = len(names)
    fixed = np.array([name in considered for name in names])
    free = ~fixed
    own = information[np.ix_(free, free)]
    P = np.linalg.inv(np.eye(len(own)) + own)
    middle = np.eye(len(own)) + (own if scores is None else scores[np.ix_(free, free)])
    wider = np.sqrt(np.maximum(np.diag(P @ middle @ P) / np.diag(P), 1.0))
    moved = -P @ information[np.ix_(free, fixed)]
    covariance = np.eye(k)
    covariance[np.ix_(free, free)] = P * np.outer(wider, wider) + moved @ moved.T
    covariance[np.ix_(free, fixed)] = moved
    covariance[np.ix_(fixed, free)] = moved.T
    return Posterior(
        names=tuple(names),
        information=information,
        covariance=(covariance + covariance.T) / 2,
        nuisances=tuple(nuisances),
    )


def verdicts(known: Posterior, sought: Sequence[int], limit: float) -> dict[int, Verdict]:
    """CONVERGED, NOT_EXCITED or NOT_IDENTIFIABLE for each of the unknowns that are sought.

    Excited is a log that would tell something were all else known, identifiable what it does tell. An unknown that no
    channel shows in a drive that tells of others is not identifiable either.

    Args:
        limit: a sigma below this part of the prior's counts as known.
    """
    moving = any(known.alone(i) < limit for i in sought)
    found: dict[int, Verdict] = {}
    for i in sought:
        if known.sigma[i] < limit:
            found[i] = Verdict.CONVERGED
        else:
            found[i] = Verdict.NOT_IDENTIFIABLE if moving else Verdict.NOT_EXCITED
    return found
