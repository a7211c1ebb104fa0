"""Doubts: evidence in the logs against an assumption, and the estimates that depend on it.

The score test (Rao 1948; "modification index" in econometrics) asks of every considered unknown c, which keeps its
prior mean 0: would the residuals become smaller if it changed? With the gradient g of the cost and the Fisher
information H of the logs at the estimate, and with the covariance P = (I + H_ff)^-1 of the estimated unknowns f,

    I_c = H_cc - H_cf P H_fc,      s_c = g_c - H_cf P g_f,      t = -s_c / sqrt(I_c),      z_c = -s_c / (1 + I_c),

t is N(0, 1) if the assumption holds, z_c is the change that the logs imply, in standard deviations of the prior, and
-P H_fc z_c is the change of the estimates that goes with it. g_f is 0 at the minimum of the cost; it is not if part of
gradient and information is left to other unknowns.

The other considered unknowns are not 0 either. If all have their priors N(0, 1), and I is the information matrix of
all of them after f, the scores have the covariance I + I I, and z_c has the variance v_c = (I + I I)_cc / (1 + I_c)^2.
For a weak cause that acts like a strong one v_c is large: a usual error of the strong cause implies a large z_c.
Estimated beside all others, -((1 + I)^-1 s)_c, the change of a cause has a variance below 1. A change is unusual if one
of both is. A suspect, which is an error that logs usually do not have, is 0 in the tests of the others.
"""

from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from fifthwheel._types import Array
from fifthwheel.identify.unknowns.unknown import Unknown, UnknownKind

STRONG_SCORE = 9.0
"""|t| from which the model does not describe the logs: then every estimate is doubtful."""
UNUSUAL_CHANGE = 3.0
"""An implied change, alone in units of sqrt(v_c) or beside the others, that the priors do not explain. Alone, |t| is
then above 6, because |t| = |z_c| (1 + I_c) / sqrt(I_c): whitened residuals of a real vehicle are not exactly white."""
UNUSUAL_SOFTENING = 1.5
"""The same for a softening in complete logs: tyres that soften more than on a dry road are not linear enough, and sigma
holds only the typical softening."""
UNUSUAL_SENSOR_ERROR = 3.5
"""An estimated sensor error so many prior standard deviations from its mean is not explained by its prior."""
UNUSUAL_ESTIMATE = 2.5
"""The same for an estimated parameter."""
NONLINEAR_ACCELERATION = 3.0
"""m/s^2; above this lateral acceleration a model with linear tyres and suspensions is a rough approximation."""
AS_LIKELY = 0.85
"""Causes with so large a fraction of the largest |t| are about as likely."""
HARMFUL_SHIFT = 0.5
"""An estimate is doubtful if the evidence moves it by more than this number of its standard deviations."""


class DoubtKind(StrEnum):
    """What the evidence is against."""

    ASSUMPTION = "assumption"  # a considered unknown: the vehicle file, the latency of a gyro, the time base
    SENSOR = "sensor"  # an estimated sensor error far outside its prior
    ESTIMATE = "estimate"  # an estimate far outside its prior
    RANGE = "range"  # the range of the linear model
    NOISE = "noise"  # the noise: innovations are larger or more autocorrelated than it explains; on line only


@dataclass(frozen=True, kw_only=True)
class Cause:
    """An unknown that may be wrong."""

    name: str
    changes: Mapping[str, float]
    """Implied change of each parameter that it alters, SI."""
    prior_sigmas: float
    """The same in standard deviations of its prior."""


@dataclass(frozen=True, kw_only=True)
class Doubt:
    """Evidence against an assumption."""

    kind: DoubtKind
    causes: tuple[Cause, ...]
    """What may be wrong, the most likely first; one of them is enough."""
    parameters: tuple[str, ...]
    """Estimates that are doubtful therefore."""
    statistic: float
    """Of the most likely cause: t of the score test, or prior standard deviations, or m/s^2."""
    log: str | None = None


@dataclass(frozen=True, kw_only=True)
class ScoreTest:
    """The score test of one considered unknown."""

    name: str
    statistic: float
    """t."""
    implied: float
    """z_c."""
    size: float
    """The larger of |z_c| / sqrt(v_c) and the change that is estimated beside the others; compare `UNUSUAL_CHANGE`."""
    shifts: Array
    """Change (k,) of all unknowns that goes with it, in prior standard deviations."""


def score_tests(
    names: Sequence[str],
    gradient: Array,
    information: Array,
    considered: Sequence[str],
    suspects: Sequence[str] = (),
) -> list[ScoreTest]:
    """The score test of every considered unknown, the largest |t| first.

    The gradient (k,) of the cost contains the prior; the information H (k, k) does not. Suspects are considered in
    score tests only.
    """
    fixed = np.array([name in considered for name in names])
    free = ~fixed
    P = np.linalg.inv(np.eye(int(free.sum())) + information[np.ix_(free, free)])
    towards = P @ information[np.ix_(free, fixed)]
    remaining = information[np.ix_(fixed, fixed)] - information[np.ix_(fixed, free)] @ towards
    scores = gradient[fixed] - towards.T @ gradient[free]
    usual = np.array([name not in suspects for name in names])[fixed]
    variance = np.diag(remaining) + np.square(remaining[:, usual]).sum(axis=1)  # of the scores
    tests = []
    for i, c in enumerate(np.flatnonzero(fixed).tolist()):
        own = float(remaining[i, i])
        if own <= 1e-9 * max(float(information[c, c]), 1.0):
            continue
        implied = -float(scores[i]) / (1 + own)
        alone = abs(implied) / max(1.0, float(np.sqrt(variance[i])) / (1 + own))
        together = np.flatnonzero(usual | (np.arange(len(usual)) == i))
        joint = np.linalg.solve(np.eye(len(together)) + remaining[np.ix_(together, together)], scores[together])
        beside = abs(float(joint[together == i][0]))
        shifts = np.zeros(len(names))
        shifts[free], shifts[c] = -towards[:, i] * implied, implied
        statistic = -float(scores[i]) / float(np.sqrt(own))
        size = max(alone, beside)
        tests.append(ScoreTest(name=names[c], statistic=statistic, implied=implied, size=size, shifts=shifts))
    return sorted(tests, key=lambda test: -abs(test.statistic))


def most_likely(tests: Sequence[ScoreTest], *, softening: float = UNUSUAL_CHANGE) -> list[ScoreTest]:
    """The tests with an unusual change that are about as likely as the first of them, which has the largest |t|.

    A softening is unusual from the size `softening` on.
    """
    unusual = [t for t in tests if t.size > (softening if t.name.endswith(".softening") else UNUSUAL_CHANGE)]
    return [t for t in unusual if abs(t.statistic) >= AS_LIKELY * abs(unusual[0].statistic)]


@dataclass(frozen=True, kw_only=True, eq=False)
class Evidence:
    """Estimates of unknowns, by which doubts are found."""

    names: Sequence[str]
    """Of the k estimates."""
    z: Array
    """Estimates (k,)."""
    covariance: Array
    """Of z (k, k)."""
    unknowns: Mapping[str, Unknown]
    """The unknowns by name, also those without an estimate."""
    parameters: tuple[str, ...]
    """Names of the estimated parameters, which may be doubtful."""

    def contradicted_assumptions(self, likely: Sequence[ScoreTest]) -> Iterator[Doubt]:
        """The assumption that the score tests contradict most; `likely` are its causes, see `most_likely`."""
        if not likely:
            return
        strong = abs(likely[0].statistic) > STRONG_SCORE
        moved = [name for test in likely for name in self._moved(test.shifts)]
        yield Doubt(
            kind=DoubtKind.ASSUMPTION,
            causes=tuple(self._cause(test.name, test.implied) for test in likely),
            parameters=self.parameters if strong else tuple(dict.fromkeys(moved)),
            statistic=abs(likely[0].statistic),
        )

    def unusual_estimates(self, exempt: Container[str] = ()) -> Iterator[Doubt]:
        """Sensor errors and parameters far outside their priors; `exempt` are parameters that may be."""
        index = {name: i for i, name in enumerate(self.names)}
        for name, u in self.unknowns.items():
            if not u.is_estimated:
                continue
            i = index[name]
            deviation = float(self.z[i])
            if u.kind is UnknownKind.SENSOR and abs(deviation) > UNUSUAL_SENSOR_ERROR:
                kind = DoubtKind.SENSOR
                parameters = self._moved(self.covariance[:, i] / self.covariance[i, i] * deviation)
            elif u.logarithmic and abs(deviation) > UNUSUAL_ESTIMATE and name not in exempt:
                kind, parameters = DoubtKind.ESTIMATE, (name,)
            else:
                continue
            causes = (self._cause(name, deviation),)
            yield Doubt(kind=kind, causes=causes, parameters=parameters, statistic=abs(deviation))

    def _moved(self, shifts: Array) -> tuple[str, ...]:
        """The parameters that shifts (k,) of z move by more than `HARMFUL_SHIFT` sigma."""
        harmful = np.abs(shifts) > HARMFUL_SHIFT * np.sqrt(np.diag(self.covariance))
        return tuple(n for n, moved in zip(self.names, harmful, strict=True) if moved and n in self.parameters)

    def _cause(self, name: str, deviation: float) -> Cause:
        """An unknown that may be wrong by so many standard deviations of its prior."""
        u = self.unknowns[name]
        changes = {path: rate * u.scale * deviation for path, rate in u.slopes.items()}
        return Cause(name=name, changes=changes, prior_sigmas=deviation)
