"""The doubts of a learner, by the rules of `identify.doubts`."""

from collections.abc import Iterator

import numpy as np

from fifthwheel._types import Array
from fifthwheel.filters.relinearised import JointEstimate
from fifthwheel.identify.doubts import (
    HARMFUL_SHIFT,
    STRONG_SCORE,
    UNUSUAL_ESTIMATE,
    UNUSUAL_SENSOR_ERROR,
    Cause,
    Doubt,
    DoubtKind,
    ScoreTest,
    most_likely,
)
from fifthwheel.identify.online.live_filter import InnovationStatistics
from fifthwheel.identify.online.problem import OnlineProblem
from fifthwheel.identify.online.settings import LearnerSettings
from fifthwheel.identify.unknowns.unknown import Unknown, UnknownKind


def find_doubts(
    problem: OnlineProblem, learner: LearnerSettings, estimate: JointEstimate, innovations: InnovationStatistics
) -> tuple[Doubt, ...]:
    """The doubts at an estimate, each with the parameters that it concerns."""
    return (
        *_contradicted_assumptions(problem, estimate),
        *_unusual_estimates(problem, estimate),
        *_inconsistent_innovations(problem, learner, innovations),
    )


def score_tests(problem: OnlineProblem, estimate: JointEstimate) -> list[ScoreTest]:
    """The score test of every considered unknown, the largest |t| first.

    The innovations of the filter are independent of the estimates, so no other information matrix is needed.
    """
    tests = []
    for i, unknown in enumerate(problem.considered):
        gradient, information = float(estimate.gradient[i]), float(estimate.information[i])
        if information > 0:
            implied = -gradient / (1 + information)
            tests.append(
                ScoreTest(
                    name=unknown.name,
                    statistic=-gradient / np.sqrt(information),
                    implied=implied,
                    size=abs(implied),
                    shifts=estimate.B[:, i] * implied,
                )
            )
    return sorted(tests, key=lambda test: -abs(test.statistic))


def _contradicted_assumptions(problem: OnlineProblem, estimate: JointEstimate) -> Iterator[Doubt]:
    """The assumption that the score tests contradict most, with those that are about as likely."""
    likely = most_likely(score_tests(problem, estimate))
    if not likely:
        return
    strong = abs(likely[0].statistic) > STRONG_SCORE
    moved = [name for test in likely for name in _moved(problem, estimate, test.shifts)]
    considered = {u.name: u for u in problem.considered}
    yield Doubt(
        kind=DoubtKind.ASSUMPTION,
        causes=tuple(_cause(considered[test.name], test.implied) for test in likely),
        parameters=problem.parameters if strong else tuple(dict.fromkeys(moved)),
        statistic=abs(likely[0].statistic),
    )


def _unusual_estimates(problem: OnlineProblem, estimate: JointEstimate) -> Iterator[Doubt]:
    """Sensor errors and parameters far outside their priors."""
    covariance = estimate.Pz + estimate.B @ estimate.B.T
    for i, u in enumerate(problem.estimated):
        deviation = float(estimate.z[i])
        if u.kind is UnknownKind.SENSOR and abs(deviation) > UNUSUAL_SENSOR_ERROR:
            kind = DoubtKind.SENSOR
            parameters = _moved(problem, estimate, covariance[:, i] / covariance[i, i] * deviation)
        elif u.logarithmic and abs(deviation) > UNUSUAL_ESTIMATE:
            kind, parameters = DoubtKind.ESTIMATE, (u.name,)
        else:
            continue
        yield Doubt(kind=kind, causes=(_cause(u, deviation),), parameters=parameters, statistic=abs(deviation))


def _inconsistent_innovations(
    problem: OnlineProblem, learner: LearnerSettings, innovations: InnovationStatistics
) -> Iterator[Doubt]:
    """Innovations that are larger or more autocorrelated than noise and discrepancy explain."""
    size, autocorrelation = max(innovations.mean_square), max(innovations.autocorrelation)
    if size > learner.max_innovation_ratio or autocorrelation > learner.max_autocorrelation:
        yield Doubt(
            kind=DoubtKind.NOISE, causes=(), parameters=problem.parameters, statistic=max(size, autocorrelation)
        )


def _moved(problem: OnlineProblem, estimate: JointEstimate, shifts: Array) -> tuple[str, ...]:
    """The estimated parameters that shifts (n_z,) move by more than `HARMFUL_SHIFT` sigma."""
    sigma = np.sqrt(np.diag(estimate.Pz + estimate.B @ estimate.B.T))
    harmful = np.abs(shifts) > HARMFUL_SHIFT * sigma
    return tuple(
        u.name for u, moved in zip(problem.estimated, harmful, strict=True) if moved and u.name in problem.parameters
    )


def _cause(unknown: Unknown, deviation: float) -> Cause:
    """An unknown that may be wrong by so many standard deviations of its prior."""
    changes = {path: rate * unknown.scale * deviation for path, rate in unknown.slopes.items()}
    return Cause(name=unknown.name, changes=changes, prior_sigmas=deviation)
