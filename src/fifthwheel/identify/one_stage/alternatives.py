"""The likely causes of a contradiction: for each candidate, the logs are fitted again without its prior.

A test of a prior is linear (`identify.doubts`). A gross error, such as a trailer that is logged 0.3 s late, lies far
beyond its range, and distorts the tests of all other priors. The fit without the prior of one unknown has no such
limit. With the noise of the channels fixed, the decrease of the cost is half the square of the statistic that the test
approximates, so that it ranks the causes.

A cause has to explain the logs. Without its prior and with the noise of its own residuals, either the discrepancy is a
small fraction of the signals, or the priors of all other unknowns agree with the logs: with the precision W of the
prior and the covariance P, twice the cost of the prior has the expected value tr(I - P W) (`posterior`). If no cause
explains them, the vehicle file or the signal map does not fit, and the change of any one number would mislead.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fifthwheel._types import Array
from fifthwheel.checks import Fault
from fifthwheel.dynamics import TIME_SCALE
from fifthwheel.identify.doubts import AS_LIKELY, UNUSUAL_CHANGE, PriorTest
from fifthwheel.identify.one_stage.gauss_newton import INITIAL_RADIUS, Minimum, Quadratic, minimise, newton_step
from fifthwheel.identify.one_stage.problem import Problem
from fifthwheel.identify.one_stage.solution import Solution
from fifthwheel.identify.settings import Progress

TITLE = "test of assumptions"
"""Of the progress."""
CANDIDATE_FRACTION = 0.5
"""A candidate has at least this fraction of the largest |statistic|: the tests are distorted, but not without value."""
MOST_CANDIDATES = 12
SAMPLES = 6_000
"""Of longer logs, the fits use about this number of samples."""
ITERATIONS, TOLERANCE = (5, 4, 7), 0.5
"""Of each fit, whose result is a rank and a size. After the first steps, and again after the next ones, the half of the
fits goes on that promises more, with those that are about as good as the best one. The first steps are within a small
trust region: after three of them, a cause of 50 prior standard deviations explains less than a wrong one."""
LEAST_GAIN = (AS_LIKELY * UNUSUAL_CHANGE) ** 2 / 2
"""Decrease of the cost by a cause of a contradiction: less would be no contradiction."""
GROSS = 4.0
"""A cause that is physically impossible, such as a digit too many, has at least so many times this decrease."""
WIDER = 10.0
"""The bounds of an unknown without its prior are so many times further apart."""
USUAL_CLOCK_ERROR = 0.02
"""Largest relative error of the rate of a clock that loggers have; beyond it, a timestamp column must be wrong."""
UNUSUAL_WEIGHT = 0.5
"""Of the decrease of the cost by a larger one: a wrong number of the vehicle is the more common error by far."""
LARGE_DISCREPANCY = 0.1
"""As a fraction of the signals. One wrong number leaves about 0.015 of the nonlinear truck, the vehicle file of another
truck 0.12 or more. A real truck may leave as much with its own file, but contradicts fewer priors."""
LARGE_PULL = 2.5
"""Of all priors together: twice their cost over its expected value. If all are right, 1 of 1000 logs exceeds it: one
lane change informs about 16 combinations of the unknowns (chi-square)."""
NO_TAIL = 1e-3
"""Tail of a prior, in its standard deviations, that is almost without effect."""


@dataclass(frozen=True, kw_only=True)
class Causes:
    """What explains a contradiction."""

    likely: list[PriorTest] = field(default_factory=list)
    """The likeliest first; empty without a contradiction, and where no cause explains the logs."""
    left: float | None = None
    """The least discrepancy that any cause leaves, as a fraction of the signals, if no possible one explains them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Alternative:
    """The fit without one prior."""

    test: PriorTest
    """With the change and the shifts of this fit."""
    minimum: Minimum[Problem]
    gain: float
    """Decrease of the cost."""
    promise: float
    """The decrease that its quadratic model predicts after all further steps."""
    possible: bool
    """Whether the unknown may be so far from its prior mean."""
    usual: bool
    """Whether such errors are common; all are but gross errors of a clock."""

    @property
    def explains(self) -> bool:
        """Whether it explains an unusual contradiction."""
        return self.gain >= LEAST_GAIN * (1.0 if self.possible else GROSS)

    @property
    def rank(self) -> float:
        """The larger, the likelier."""
        return self.gain if self.usual else UNUSUAL_WEIGHT * self.gain


def likely_causes(solution: Solution, tests: Sequence[PriorTest], progress: Progress = lambda *_: None) -> Causes:
    """The causes that explain a contradiction about as well as the best one, the likeliest first; none without one.

    A cause that is physically impossible counts only if it is the only one, such as a digit too many. A gross error of
    a clock is behind others that explain half as much. Logs that contradict no single prior may contradict all of them
    together. `tests` are those of the priors, the largest statistic first.
    """
    if not tests or tests[0].size <= UNUSUAL_CHANGE:
        return Causes(left=_left(solution.minimum) or None)
    least = CANDIDATE_FRACTION * abs(tests[0].statistic)
    candidates = [test for test in tests if abs(test.statistic) >= least][:MOST_CANDIDATES]
    base = _base(solution)
    found = [a for a in _alternatives(base, candidates, progress) if a.explains]
    if not found:
        return Causes(left=_left(solution.minimum) or None)
    possible = [a for a in found if a.possible]
    likely = _likely(possible or found)
    left = [_unexplained(a.minimum) for a in likely]
    if not possible and len(likely) > 1:
        return Causes(left=min(left))
    if explaining := [a.test for a, discrepancy in zip(likely, left, strict=True) if not discrepancy]:
        return Causes(likely=explaining)
    left.append(_unexplained(_corrected(solution, base)))
    return Causes(left=min(left)) if left[-1] else Causes(likely=[a.test for a in likely])


def _base(solution: Solution) -> Minimum[Problem]:
    """The solution for the samples that the fits use."""
    problem, z = solution.problem.shortened(SAMPLES), solution.minimum.z.copy()
    if problem is solution.problem:
        return solution.minimum
    z[_initial_states(problem)] = 0.0  # the parts begin later than the segments
    return _fit(problem, z)


def _alternatives(base: Minimum[Problem], candidates: Sequence[PriorTest], progress: Progress) -> list[_Alternative]:
    """The fits without one prior that were among the better ones after each number of steps, the likeliest first."""
    found, done, total = [_without_prior(base, test) for test in candidates], 0, sum(ITERATIONS)
    for iterations in ITERATIONS:
        if done:
            promising = sorted(found, key=lambda alternative: -alternative.promise)[: math.ceil(len(found) / 2)]
            likely = _likely(found)
            found = [a for a in found if a in promising or a in likely]
        for i, alternative in enumerate(found):
            progress(TITLE, done + iterations * i // len(found), total)
            if not alternative.minimum.converged:
                found[i] = _continued(base, alternative, iterations)
        found.sort(key=lambda alternative: (not alternative.possible, -alternative.rank))
        done += iterations
    progress(TITLE, total, total)
    return found


def _likely(found: Sequence[_Alternative]) -> list[_Alternative]:
    """Those that explain about as much as the first one, and the one that explains most."""
    least, most = AS_LIKELY**2 * found[0].rank, max(a.gain for a in found)
    return [a for a in found if a.rank >= least or a.gain == most]


def _without_prior(base: Minimum[Problem], test: PriorTest) -> _Alternative:
    """The fit without the prior of one unknown, before its first step."""
    problem, z = base.objective.without_prior(test.name, tail=NO_TAIL, wider=WIDER), base.z
    lower, upper = problem.bounds
    linear = np.clip(z + test.shifts, lower, upper)
    return _alternative(base, test, _fit(problem, linear if problem.cost(linear) < problem.cost(z) else z, 0))


def _continued(base: Minimum[Problem], alternative: _Alternative, iterations: int) -> _Alternative:
    """A fit after more steps."""
    last = alternative.minimum
    minimum = _fit(last.objective, last.z, iterations, radius=last.radius, model=last.model)
    return _alternative(base, alternative.test, minimum)


def _alternative(base: Minimum[Problem], test: PriorTest, minimum: Minimum[Problem]) -> _Alternative:
    """A fit without the prior of one unknown."""
    problem, shifts, model = minimum.objective, minimum.z - base.z, minimum.model
    further, gain = newton_step(minimum.z, model.gradient, model.hessian, *problem.bounds), base.model.cost - model.cost
    shifts[_initial_states(problem)] = 0.0
    implied = float(minimum.z[problem.names.index(test.name)])
    unknown = problem.unknowns_by_name[test.name]
    clock_error = TIME_SCALE in unknown.moves and abs(unknown.change(implied)) > USUAL_CLOCK_ERROR
    return _Alternative(
        test=replace(test, implied=implied, shifts=shifts),
        minimum=minimum,
        gain=gain,
        promise=gain - float(model.gradient @ further + further @ model.hessian @ further / 2),
        possible=unknown.is_possible(implied),
        usual=not clock_error,
    )


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
    problem: Problem,
    z: Array,
    iterations: int = sum(ITERATIONS),
    *,
    radius: float = INITIAL_RADIUS,
    model: Quadratic | None = None,
) -> Minimum[Problem]:
    lower, upper = problem.bounds
    return minimise(
        problem,
        z,
        lower=lower,
        upper=upper,
        iterations=iterations,
        tolerance=TOLERANCE,
        radius=radius,
        model=model,
    )


def _initial_states(problem: Problem) -> list[int]:
    """Indices of the initial states of all segments."""
    return [int(i) for segments in problem.layout.initial_states for indices in segments for i in indices]
