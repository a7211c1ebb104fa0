"""The doubts of one stage: contradicted assumptions, unusual estimates, logs beyond the range of the linear model."""

from collections.abc import Iterator

from fifthwheel.identify.doubts import (
    NONLINEAR_ACCELERATION,
    Doubt,
    DoubtKind,
    Evidence,
    PriorTest,
    most_likely,
)
from fifthwheel.identify.one_stage.solution import Solution
from fifthwheel.vehicle.parameters import FRICTION


def find_doubts(solution: Solution) -> list[Doubt]:
    """The doubts at a solution, each with the estimates that it concerns; the friction may differ as roads do."""
    problem, posterior = solution.problem, solution.linearisation.posterior
    evidence = Evidence(
        names=problem.names,
        z=solution.minimum.z,
        covariance=posterior.covariance,
        unknowns=problem.unknowns_by_name,
        parameters=solution.estimated,
    )
    return [
        *evidence.contradicted_assumptions(_likely_causes(solution)),
        *evidence.unusual_estimates(exempt=(FRICTION,)),
        *_nonlinear_range(solution),
    ]


def _likely_causes(solution: Solution) -> list[PriorTest]:
    """The most likely causes of a contradiction; one that is physically impossible only if all are."""
    tests, unknowns = solution.linearisation.tests, solution.problem.unknowns_by_name
    return most_likely([t for t in tests if unknowns[t.name].is_possible(t.implied)]) or most_likely(tests)


def _nonlinear_range(solution: Solution) -> Iterator[Doubt]:
    """Logs beyond the range of the linear model."""
    if solution.settings.tyre_law == "saturating":
        return
    for record, largest in zip(solution.dataset.records, solution.lateral_accelerations, strict=True):
        if largest > NONLINEAR_ACCELERATION:
            yield Doubt(
                kind=DoubtKind.RANGE, causes=(), parameters=solution.estimated, statistic=largest, log=record.name
            )
