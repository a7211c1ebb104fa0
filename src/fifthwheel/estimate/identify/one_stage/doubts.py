"""The doubts at a solution of one stage."""

from collections.abc import Iterator, Sequence

from fifthwheel.estimate.identify.doubts import (
    NONLINEAR_ACCELERATION,
    Doubt,
    DoubtKind,
    Evidence,
    PriorTest,
    most_likely,
)
from fifthwheel.estimate.identify.one_stage.solution import Solution
from fifthwheel.estimate.identify.unknowns.unknown import is_possible
from fifthwheel.truck.quantities import FRICTION


def find_doubts(solution: Solution, likely: Sequence[PriorTest], left: float | None = None) -> list[Doubt]:
    """The doubts at a solution, each with the estimates that it concerns; the friction may differ as roads do.

    `likely` are the causes of a contradiction, see `causes`. What the first of them explains is no further doubt.
    `left` is the discrepancy, as a fraction of the signals, of logs that nothing explains.
    """
    problem, posterior = solution.problem, solution.linearisation.posterior
    evidence = Evidence(
        names=problem.names,
        z=solution.minimum.z + likely[0].shifts if likely else solution.minimum.z,
        covariance=posterior.covariance,
        unknowns=problem.unknowns_by_name,
        parameters=solution.estimated,
    )
    unexplained = [] if left is None else [evidence.unexplained(left)]
    return [
        *unexplained,
        *evidence.contradicted_assumptions(likely),
        *evidence.unusual_estimates(exempt=(FRICTION, *[test.name for test in likely])),
        *_nonlinear_range(solution),
    ]


def quick_doubts(solution: Solution) -> list[Doubt]:
    """The doubts without a fit for each cause: of the uncertain numbers, by the linear tests of their priors."""
    unknowns = solution.problem.unknowns_by_name
    tests = [t for t in solution.linearisation.tests if unknowns[t.name].is_uncertain]
    possible = [test for test in tests if is_possible(unknowns[test.name], test.implied)]
    return find_doubts(solution, most_likely(possible, unknowns) or most_likely(tests, unknowns))


def _nonlinear_range(solution: Solution) -> Iterator[Doubt]:
    """Logs beyond the range of the linear model."""
    if solution.settings.tyre_law != "linear":
        return
    for record, largest in zip(solution.dataset.records, solution.lateral_accelerations, strict=True):
        if largest > NONLINEAR_ACCELERATION:
            yield Doubt(
                kind=DoubtKind.RANGE, causes=(), parameters=solution.estimated, statistic=largest, log=record.name
            )
