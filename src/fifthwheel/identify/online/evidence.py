"""The doubts of a learner, by the rules of `identify.doubts`."""

import numpy as np

from fifthwheel.filters.relinearised import JointEstimate
from fifthwheel.identify.doubts import Doubt, DoubtKind, Evidence, PriorTest, most_likely
from fifthwheel.identify.online.live_filter import LiveFilter
from fifthwheel.identify.unknowns.unknown import UnknownKind


def find_doubts(live: LiveFilter, estimate: JointEstimate) -> tuple[Doubt, ...]:
    """The doubts of a filter at an estimate, each with the parameters that it concerns."""
    setup, learner, innovations = live.setup, live.learner, live.innovations
    unknowns = setup.estimated_unknowns
    evidence = Evidence(
        names=[u.name for u in unknowns],
        z=estimate.z,
        covariance=estimate.covariance()[: len(unknowns), : len(unknowns)],
        unknowns={u.name: u for u in setup.unknowns},
        parameters=tuple(u.name for u in unknowns if u.kind is not UnknownKind.SENSOR),
    )
    doubts = [
        *evidence.contradicted_assumptions(most_likely(score_tests(live, estimate))),
        *evidence.unusual_estimates(),
    ]
    size, autocorrelation = max(innovations.mean_square), max(innovations.autocorrelation)
    if size > learner.max_innovation_ratio or autocorrelation > learner.max_autocorrelation:
        largest = max(size, autocorrelation)
        doubts.append(Doubt(kind=DoubtKind.NOISE, causes=(), parameters=evidence.parameters, statistic=largest))
    return tuple(doubts)


def score_tests(live: LiveFilter, estimate: JointEstimate) -> list[PriorTest]:
    """The score test of every considered unknown, the largest |t| first.

    The innovations of the filter are independent of the estimates, so no other information matrix is needed.
    """
    tests, cross = [], estimate.B @ estimate.correlation
    for i, unknown in enumerate(live.setup.considered_unknowns):
        gradient, information = float(estimate.gradient[i]), float(estimate.information[i])
        if information > 0:
            implied = -gradient / (1 + information)
            tests.append(
                PriorTest(
                    name=unknown.name,
                    statistic=-gradient / np.sqrt(information),
                    implied=implied * float(live.considered.sigma[i]),
                    size=abs(implied),
                    shifts=cross[:, i] * implied,
                )
            )
    return sorted(tests, key=lambda test: -abs(test.statistic))
