"""The prior of all unknowns of a problem: of each by itself, and the information of earlier logs on some together.

Each unknown z has by itself a normal prior, N(0, 1) unless a log or a hypothesis gives another, or, if it is a guess,
the hyperbolic one of `Unknown`, with the precision w: w z is the gradient of its cost. Earlier logs replace these for
the unknowns that they informed by a joint normal prior N(m, C). Model error widens it to V = D C D (`posterior`).
"""

from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from fifthwheel.base.types import Array, selected
from fifthwheel.estimate.identify.one_stage.gauss_newton import Quadratic
from fifthwheel.estimate.identify.setup import Setup


@dataclass(frozen=True, kw_only=True, eq=False)
class JointPrior:
    """The information of earlier logs on n unknowns, in units of their own priors."""

    names: tuple[str, ...]
    mean: Array  # m (n,)
    covariance: Array  # C (n, n)
    widening: Array  # diagonal of D (n,)

    def among(self, names: Container[str]) -> "JointPrior":
        """That of some of the unknowns."""
        own: JointPrior = selected(self, [i for i, name in enumerate(self.names) if name in names])
        return own


Earlier = Callable[[Setup], JointPrior | None]
"""The information of earlier logs on the unknowns of a setup."""


def nothing(_: Setup) -> None:
    """There are no earlier logs."""


class Prior:
    """The prior of the unknowns z (k,) of a problem.

    Of each by itself, it has a tail (k,), infinite if it is normal, and by name its `own` mean and standard deviation,
    else 0 and 1. Names of `earlier` logs that the problem does not have are ignored.
    """

    def __init__(
        self,
        names: Sequence[str],
        tails: Array,
        earlier: JointPrior | None = None,
        own: Mapping[str, tuple[float, float]] = MappingProxyType({}),
    ) -> None:
        self.mean, self._sigmas = np.array([own.get(name, (0.0, 1.0)) for name in names]).reshape(-1, 2).T
        earlier = earlier.among(frozenset(names)) if earlier else None
        self._places = np.array([names.index(name) for name in earlier.names] if earlier else [], dtype=np.int64)
        self._tails = tails.copy()
        self._tails[self._places] = np.inf
        self.variance = self._sigmas**2
        """(k,), without tails and widening."""
        self._block = np.ix_(self._places, self._places)
        if earlier:
            self.mean[self._places] = earlier.mean
            self.variance[self._places] = np.diag(earlier.covariance)
            self._precision = np.linalg.inv(earlier.covariance)
            widened = earlier.covariance * np.outer(earlier.widening, earlier.widening)
            self._covariance, self._scores = earlier.covariance, self._precision @ widened @ self._precision

    def cost(self, z: Array) -> float:
        """Minus the logarithm of the prior density at z, without its constant."""
        guess, c, own = np.isfinite(self._tails), self._tails, (z - self.mean) / self._sigmas
        hyperbolic = c[guess] ** 2 * (np.sqrt(1 + (own[guess] / c[guess]) ** 2) - 1)
        alone, total = ~guess, 0.0
        if len(self._places):
            d, alone[self._places] = (z - self.mean)[self._places], False
            total = float(d @ self._precision @ d / 2)
        return total + float(own[alone] @ own[alone] / 2 + hyperbolic.sum())

    def own_precision(self, z: Array) -> Array:
        """w (k,): 1 for a normal prior, less for a guess far from its mean; of each unknown by itself."""
        own = (z - self.mean) / self._sigmas
        return np.asarray(1 / (self._sigmas**2 * np.sqrt(1 + (own / self._tails) ** 2)))

    def expand(self, z: Array) -> Quadratic:
        """The cost about z: its gradient, and the precision as Hessian."""
        precision = self.own_precision(z)
        gradient, hessian = precision * (z - self.mean), np.diag(precision)
        if len(self._places):
            gradient[self._places] = self._precision @ (z - self.mean)[self._places]
            hessian[self._block] = self._precision
        return Quadratic(self.cost(z), gradient, hessian)

    def score_covariance(self, precision: Array) -> Array:
        """What the prior adds to the covariance of the scores: its precision (k, k), for that of earlier logs widened
        by their model error."""
        if not len(self._places):
            return precision
        widened = precision.copy()
        widened[self._block] = self._scores
        return widened

    def spread(self, gains: Array) -> Array:
        """gains C gains' (k, k) with the covariance C of the prior, without tails."""
        others = np.delete(np.arange(len(self.mean)), self._places)
        own, joint = gains[:, others] * self._sigmas[others], gains[:, self._places]
        if not len(self._places):
            return np.asarray(own @ own.T)
        return np.asarray(own @ own.T + joint @ self._covariance @ joint.T)
