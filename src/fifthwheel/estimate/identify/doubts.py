"""Doubts: evidence in the logs against an assumption, and the estimates that depend on it.

Every prior is an assumption: a mass of the vehicle file within its standard deviation, a latency near 0. With the
priors z ~ N(0, I) and the posterior covariance P, the estimate z_c of an unknown scatters about 0 with the standard
deviation s_c, about sqrt(1 - P_cc) (`one_stage.posterior`). |z_c| / s_c is therefore the statistic of the test of
"the prior of c is right", when all other priors are. It is the square root of twice the rise of ln p of the logs when
the prior of c is dropped (Rao 1948; "modification index" in econometrics). Without that prior c changes to
z_c / s_c^2, and the other estimates change with it by P_c z_c / s_c^2. A learner keeps some unknowns at their prior
mean 0 (considered, Schmidt) and has the same test for these from the score.

A prior is contradicted if a gross error of its number (`GrossError`) is more probable than none. Let d be the
deviation z_c / s_c^2 without the prior. If the prior holds, its variance is V = 1 / s_c^2; with a gross error of w
prior standard deviations V + w^2 - 1. With the rate pi of such errors

    ln p(gross error | y) / p(prior holds | y) = ln pi + z_c^2 / s_c^2 (1 - V / (V + w^2 - 1)) / 2
                                                 - ln((V + w^2 - 1) / V) / 2.
"""

import math
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from fifthwheel.base.names import split_log
from fifthwheel.base.types import Array
from fifthwheel.estimate.identify.unknowns.unknown import GrossError, Unknown, gross_error

STRONG_SCORE = 9.0
"""Statistic from which the model does not describe the logs: then every estimate is doubtful."""
ABOUT_AS_LIKELY = math.log(20)
"""Causes whose odds are within this factor of the largest are named together."""
INFORMED = 0.003
"""Least 1 - P_cc: an unknown on which the logs contain less information cannot contradict its prior. It is small,
because a gross error of a number with a narrow prior, such as the rate of a time base, shows nevertheless."""
UNUSUAL_SENSOR_ERROR = 3.5
"""An estimated sensor error so many prior standard deviations from its mean is not explained by its prior."""
UNUSUAL_ESTIMATE = 2.5
"""The same for an estimated parameter."""
NONLINEAR_ACCELERATION = 3.0
"""m/s^2; above this lateral acceleration a model with linear tyres and suspensions is a rough approximation."""
NONLINEAR_SPEED_RATE = 0.5
"""m/s^2; acceleration and braking beyond it move more than a tenth of the load of a front axle, which changes the
stiffness of its tyres."""
HARMFUL_SHIFT = 0.5
"""An estimate is doubtful if the evidence moves it by more than this number of its standard deviations."""


class DoubtKind(StrEnum):
    """What the evidence is against."""

    ASSUMPTION = "assumption"  # an uncertain number: the vehicle file, the latency of a gyro, the time base
    SENSOR = "sensor"  # an estimated sensor error far outside its prior
    ESTIMATE = "estimate"  # an estimate far outside its prior
    RANGE = "range"  # the range of the linear model
    NOISE = "noise"  # the noise: residuals are larger or more autocorrelated than it and any one cause explain


@dataclass(frozen=True, kw_only=True)
class Cause:
    """An unknown that may be wrong."""

    name: str
    changes: Mapping[str, float]  # implied change of each parameter that it alters, SI
    prior_sigmas: float  # the same in standard deviations of its prior
    prior_mean: float | None = field(default=None, repr=False)
    """SI; None for an unknown that changes numbers of other names."""


@dataclass(frozen=True, kw_only=True)
class Doubt:
    """Evidence against an assumption."""

    kind: DoubtKind
    causes: tuple[Cause, ...]  # what may be wrong, the most likely first; one of them is enough
    parameters: tuple[str, ...]  # estimates that are doubtful therefore
    statistic: float
    """Of the most likely cause: that of the test of its prior, or prior standard deviations, or m/s^2. Of residuals: on
    line their mean square over the expected one, else their discrepancy as a fraction of the signals."""
    log: str | None = None


_AGAINST = {
    DoubtKind.ASSUMPTION: "contradicted assumption",
    DoubtKind.SENSOR: "sensor error far outside its prior",
    DoubtKind.ESTIMATE: "estimate far outside its prior",
    DoubtKind.RANGE: "lateral acceleration above the range of the linear model",
    DoubtKind.NOISE: "residuals larger than the noise explains",
}
"""What the evidence is against, in words."""


def describe_doubt(doubt: Doubt) -> str:
    """Kind and causes: "contradicted assumption: semitrailer.mass (+5.2 prior sigma)"."""
    causes = [f"{split_log(cause.name)[0]} ({cause.prior_sigmas:+.1f} prior sigma)" for cause in doubt.causes]
    return ": ".join(filter(None, (_AGAINST[doubt.kind], " or ".join(causes))))


@dataclass(frozen=True, kw_only=True)
class PriorTest:
    """The test of the prior of one unknown."""

    name: str
    statistic: float  # N(0, 1) if the prior is right
    implied: float  # change that the logs imply, in standard deviations of the prior
    shifts: Array  # change (k,) of all unknowns that goes with it, in prior standard deviations

    @property
    def variance(self) -> float:
        """V, of the deviation without the prior, in that of the prior: 1 + 1 / I with the information I of the logs."""
        return (self.implied / self.statistic) ** 2 if self.statistic else 1.0


def prior_tests(
    names: Sequence[str], z: Array, P: Array, scatter: Array, tested: Iterable[str], variance: Array | None = None
) -> list[PriorTest]:
    """The test of the prior of each tested unknown that the logs inform, the largest statistic first.

    z are the estimates (k,) less their prior means, with the covariance P (k, k) if the model is right. The scatter
    (k,) is their standard deviation if all priors are right, the variance (k,) that of the prior, by default 1.
    """
    variance = np.ones(len(z)) if variance is None else variance
    tests = []
    for name in tested:
        i = names.index(name)
        informed = float(1 - P[i, i] / variance[i])
        if informed > INFORMED:
            statistic, implied = float(z[i] / scatter[i]), float(z[i]) / informed
            shifts = np.asarray(P[:, i] * (implied / variance[i]))
            shifts[i] = implied
            tests.append(PriorTest(name=name, statistic=statistic, implied=implied, shifts=shifts))
    return sorted(tests, key=lambda test: -abs(test.statistic))


def linear_odds(test: PriorTest, error: GrossError) -> float:
    """Logarithm of the odds of a gross error of the number that is tested."""
    wider = test.variance + error.size**2 - 1
    return error.prior_odds + (test.statistic**2 * (1 - test.variance / wider) - math.log(wider / test.variance)) / 2


def most_likely(tests: Iterable[PriorTest], unknowns: Mapping[str, Unknown]) -> list[PriorTest]:
    """The tests by which a gross error is more probable than none, those about as likely as the first of them."""
    odds = [(linear_odds(test, error), test) for test in tests if (error := gross_error(unknowns[test.name]))]
    least = max(0.0, max((each for each, _ in odds), default=0.0) - ABOUT_AS_LIKELY)
    return [test for each, test in sorted(odds, key=lambda pair: -pair[0]) if each > least]


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

    def contradicted_assumptions(self, likely: Sequence[PriorTest]) -> Iterator[Doubt]:
        """The assumption that the logs contradict most; `likely` are its causes, see `most_likely`."""
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

    def unexplained(self, discrepancy: float) -> Doubt:
        """Residuals that no single number explains, with their discrepancy as a fraction of the signals."""
        return Doubt(kind=DoubtKind.NOISE, causes=(), parameters=self.parameters, statistic=discrepancy)

    def unusual_estimates(self, exempt: Container[str] = ()) -> Iterator[Doubt]:
        """Sensor errors and parameters far outside their priors; `exempt` are unknowns that may be."""
        index = {name: i for i, name in enumerate(self.names)}
        for name, u in self.unknowns.items():
            if not u.estimated or name in exempt:
                continue
            i = index[name]
            deviation = float(self.z[i])
            if not (u.reported or u.is_uncertain) and abs(deviation) > UNUSUAL_SENSOR_ERROR:
                kind = DoubtKind.SENSOR
                parameters = self._moved(self.covariance[:, i] / self.covariance[i, i] * deviation)
            elif u.reported and u.logarithmic and abs(deviation) > UNUSUAL_ESTIMATE:
                kind, parameters = DoubtKind.ESTIMATE, (name,)  # a stiffness or inertia; the prior of a height is wide
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
        changes = {path: rate * u.change(deviation) for path, rate in u.slopes.items()}
        mean = None if u.moves else u.centre
        return Cause(name=name, changes=changes, prior_sigmas=deviation, prior_mean=mean)
