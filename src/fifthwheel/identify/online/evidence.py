"""The doubts of a learner, by the rules of `identify.doubts`."""

import numpy as np

from fifthwheel.filters.relinearised import JointEstimate
from fifthwheel.identify.doubts import Doubt, DoubtKind, Evidence, PriorTest, most_likely
from fifthwheel.identify.online.live_filter import InnovationStatistics
from fifthwheel.identify.online.settings import LearnerSettings
from fifthwheel.identify.setup import Setup
from fifthwheel.identify.unknowns.unknown import UnknownKind


def find_doubts(
    setup: Setup, learner: LearnerSettings, estimate: JointEstimate, innovations: InnovationStatistics
) -> tuple[Doubt, ...]:
    """The doubts at an estimate, each with the parameters that it concerns."""
    unknowns = setup.estimated_unknowns
    evidence = Evidence(
        names=[u.name for u in unknowns],
        z=estimate.z,
        covariance=estimate.Pz + estimate.B @ estimate.B.T,
        unknowns={u.name: u for u in setup.unknowns},
        parameters=tuple(u.name for u in unknowns if u.kind is not UnknownKind.SENSOR),
    )
    doubts = [
        *evidence.contradicted_assumptions(most_likely(score_tests(setup, estimate))),
        *evidence.unusual_estimates(),
    ]
    size, autocorrelation = max(innovations.mean_square), max(innovations.autocorrelation)
    if size > learner.max_innovation_ratio or autocorrelation > learner.max_autocorrelation:
        largest = max(size, autocorrelation)
        doubts.append(Doubt(kind=DoubtKind.NOISE, causes=(), parameters=evidence.parameters, statistic=largest))
    return tuple(doubts)


def score_tests(setup: Setup, estimate: JointEstimate) -> list[PriorTest]:
    """The score test of every considered unknown, the largest |t| first.

    The innovations of the filter are independent of the estimates, so no other information matrix is needed.
    """
    tests = []
    for i, unknown in enumerate(setup.considered_unknowns):
        gradient, information = float(estimate.gradient[i]), float(estimate.information[i])
        if information > 0:
            implied = -gradient / (1 + information)
            tests.append(
                PriorTest(
                    name=unknown.name,
                    statistic=-gradient / np.sqrt(information),
                    implied=implied,
                    size=abs(implied),
                    shifts=estimate.B[:, i] * implied,
                )
            )
    return sorted(tests, key=lambda test: -abs(test.statistic))
