"""The likely causes of a contradiction by comparison of hypotheses.

H_0: the priors of all numbers hold. H_k: number k has a gross error (`quantities`), in one log if each log has its own,
so that its prior has w_k times the standard deviation. With the cost J of the problem, the posterior variance P_kk of
z_k under H_0 and the rate pi_k of such errors, the odds are (Laplace's approximation; R. E. Kass and A. E. Raftery,
Bayes factors, JASA 1995)

    ln p(H_k | y) / p(H_0 | y) = ln pi_k + J_0 - J_k - ln w_k - ln(1 - (1 - 1 / w_k^2) P_kk) / 2.

The logs are fitted again under each hypothesis, because a gross error, such as a trailer that is logged 0.3 s late,
lies far beyond the range of the linear tests of priors (`identify.doubts`). These select the hypotheses that are
fitted, each as long as it may become about as likely as the best one. The noise of the channels is that of H_0. A
number stays within the range that a truck can have.

A hypothesis is a cause if it is more probable than H_0. It has to explain the logs: with the noise of its own
residuals, either the discrepancy is a small fraction of the signals, or the priors of all numbers agree with the logs:
with the precision W of the prior and the covariance P, twice the cost of the prior has the expected value tr(I - P W)
(`posterior`). If no cause explains them, the vehicle file or the signal map does not fit, or the model lacks something;
the change of any one number would mislead. `benchmarks/constants.md` shows what each constant decides.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fifthwheel.base.types import Array
from fifthwheel.data.checks import Fault
from fifthwheel.estimate.identify.doubts import ABOUT_AS_LIKELY, PriorTest, linear_odds
from fifthwheel.estimate.identify.one_stage.gauss_newton import INITIAL_RADIUS, Minimum, minimise
from fifthwheel.estimate.identify.one_stage.problem import Problem
from fifthwheel.estimate.identify.one_stage.solution import Solution
from fifthwheel.estimate.identify.settings import Progress
from fifthwheel.estimate.identify.unknowns.unknown import RANGE, GrossError, gross_error

TITLE = "test of assumptions"
"""Of the progress."""
MOST_HYPOTHESES = 10
"""Largest number of fits, those that the linear tests find most probable."""
LEAST_LINEAR_ODDS = -5.0
"""Logarithm. A gross error distorts its linear test, whose odds are often too small."""
ROWS = 2_000
"""Of longer logs, the fits use about this number of rows."""
ITERATIONS, TOLERANCE = 16, 0.5
"""Of each fit, whose result is a rank and a size."""
LARGE_DISCREPANCY = 0.1
"""As a fraction of the signals. One wrong number leaves about 0.015 of the nonlinear truck, the vehicle file of another
truck 0.12 or more. A real truck may leave as much with its own file, but contradicts fewer priors."""
LARGE_PULL = 2.5
"""Of all priors together: twice their cost over its expected value. If all are right, 1 of 1000 logs exceeds it: one
lane change informs about 16 combinations of the unknowns (chi-square)."""


@dataclass(frozen=True, kw_only=True)
class Causes:
    """What explains a contradiction."""

    likely: list[PriorTest] = field(default_factory=list)
    """The likeliest first; empty without a contradiction, and where no cause explains the logs."""
    left: float | None = None
    """The least discrepancy that any cause leaves, as a fraction of the signals, if none explains the logs."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Hypothesis:
    """A gross error of one number."""

    test: PriorTest  # with the change and the shifts of the fit
    minimum: Minimum[Problem]
    odds: float  # their logarithm, over the hypothesis that all priors hold


def likely_causes(solution: Solution, tests: Sequence[PriorTest], progress: Progress = lambda *_: None) -> Causes:
    """The causes that explain a contradiction about as well as the best one, the likeliest first; none without one.

    `tests` are those of the priors. Logs that contradict no single prior may contradict all of them together.
    """
    unknowns = solution.problem.unknowns_by_name
    wrong = [(linear_odds(test, error), test, error) for test in tests if (error := gross_error(unknowns[test.name]))]
    wrong = sorted((each for each in wrong if each[0] > LEAST_LINEAR_ODDS), key=lambda each: -each[0])
    candidates, base = wrong[:MOST_HYPOTHESES], _base(solution) if wrong else solution.minimum
    found = list[_Hypothesis]()
    for i, (_, test, error) in enumerate(candidates):
        progress(TITLE, i, len(candidates))
        best = max((h.odds for h in found), default=0.0)
        found.append(_fitted(base, test, error, least=max(best - ABOUT_AS_LIKELY, 0.0)))
        progress(TITLE, i + 1, len(candidates))
    found = sorted((h for h in found if h.odds > 0), key=lambda hypothesis: -hypothesis.odds)
    likely = [h for h in found if h.odds > found[0].odds - ABOUT_AS_LIKELY]
    if not likely:
        return Causes(left=_left(solution.minimum) or None)
    left = [_unexplained(h.minimum) for h in likely]
    if explaining := [h.test for h, discrepancy in zip(likely, left, strict=True) if not discrepancy]:
        return Causes(likely=explaining)
    left.append(_unexplained(_corrected(solution, base)))
    return Causes(left=min(left)) if left[-1] else Causes(likely=[h.test for h in likely])


def _base(solution: Solution) -> Minimum[Problem]:
    """The solution for the samples that the fits use."""
    problem, z = solution.problem.shortened(ROWS), solution.minimum.z.copy()
    if problem is solution.problem:
        return solution.minimum
    z[_initial_states(problem)] = 0.0  # the parts begin later than the segments
    return _fit(problem, z)


def _fitted(base: Minimum[Problem], test: PriorTest, error: GrossError, *, least: float) -> _Hypothesis:
    """The logs fitted again with a gross error of one number, as long as its odds may exceed the `least`."""
    place, w = base.objective.names.index(test.name), error.size
    problem = base.objective.with_gross_error(test.name, w, RANGE)
    variance = float(np.linalg.inv(base.model.hessian)[place, place])
    occam = -math.log(w) - math.log(max(1 - (1 - 1 / w**2) * variance, 1e-12)) / 2
    highest = error.prior_odds + base.model.cost + occam  # odds at no cost
    linear = np.clip(base.z + test.shifts, *problem.bounds)
    start = linear if problem.cost(linear) < problem.cost(base.z) else base.z
    minimum = _fit(problem, start, w, hopeless=lambda cost: highest - cost < least)
    shifts, odds = minimum.z - base.z, highest - minimum.model.cost
    shifts[_initial_states(problem)] = 0.0
    return _Hypothesis(test=replace(test, implied=float(minimum.z[place]), shifts=shifts), minimum=minimum, odds=odds)


def _corrected(solution: Solution, base: Minimum[Problem]) -> Minimum[Problem]:
    """The fit with the delays that the samples show (`time_bases`), for which the model of a delay is too simple."""
    delays = {
        (str(finding.log), signal): float(finding.remedy["delay"])
        for finding in solution.dataset.findings
        if finding.fault is Fault.TIME_OFFSET
        for signal in (finding.signal, *finding.others)
    }
    return _fit(base.objective.with_delays(delays), base.z) if delays else base


def _unexplained(minimum: Minimum[Problem]) -> float:
    """The discrepancy that a fit leaves with the noise of its own residuals, as `_left`."""
    return _left(_fit(minimum.objective.with_residual_noise(minimum.z, autocorrelated=True), minimum.z))


def _left(fit: Minimum[Problem]) -> float:
    """The discrepancy that a fit leaves, as a fraction of the signals; 0 if it explains the logs."""
    discrepancy = fit.objective.with_residual_noise(fit.z, autocorrelated=True).relative_discrepancy
    return discrepancy if discrepancy > LARGE_DISCREPANCY and _pull(fit) > LARGE_PULL else 0.0


def _pull(minimum: Minimum[Problem]) -> float:
    """Twice the cost of the prior of all unknowns but the initial states, over its expected value."""
    problem, z = minimum.objective, minimum.z.copy()
    z[_initial_states(problem)] = 0.0
    gains = 1 - np.diag(np.linalg.solve(minimum.model.hessian, problem.prior.expand(minimum.z).hessian))
    gains[_initial_states(problem)] = 0.0
    return 2 * problem.prior.cost(z) / max(float(gains.sum()), 1.0)


def _fit(
    problem: Problem, z: Array, widest: float = 1.0, hopeless: Callable[[float], bool] = lambda _: False
) -> Minimum[Problem]:
    """The minimum from z, unless the cost is `hopeless`; `widest` is the largest prior standard deviation."""
    lower, upper = problem.bounds
    return minimise(
        problem,
        z,
        lower=lower,
        upper=upper,
        iterations=ITERATIONS,
        tolerance=TOLERANCE,
        radius=INITIAL_RADIUS * widest,
        hopeless=hopeless,
    )


def _initial_states(problem: Problem) -> list[int]:
    """Indices of the initial states of all segments."""
    return [int(i) for segments in problem.layout.initial_states for indices in segments for i in indices]
