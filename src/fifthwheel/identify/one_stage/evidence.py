"""The doubts of one stage: contradicted assumptions, unusual estimates, logs beyond the range of the linear model."""

from collections.abc import Iterator

from fifthwheel.dynamics.saturation import FRICTION
from fifthwheel.identify.doubts import (
    NONLINEAR_ACCELERATION,
    UNUSUAL_SOFTENING,
    Doubt,
    DoubtKind,
    Evidence,
    most_likely,
)
from fifthwheel.identify.one_stage.solution import Linearisation, Solution
from fifthwheel.record.lateral_acceleration import largest_lateral_acceleration


def find_doubts(solution: Solution, linearisation: Linearisation) -> list[Doubt]:
    """The doubts at a solution, each with the estimates that it concerns; the friction may differ as roads do."""
    problem = solution.problem
    evidence = Evidence(
        names=problem.names,
        z=solution.minimum.z,
        covariance=linearisation.posterior.covariance,
        unknowns={
            problem.names[index]: u
            for indices in problem.layout.unknowns
            for u, index in zip(problem.unknowns, indices, strict=True)
        },
        parameters=solution.estimated,
    )
    return [
        *evidence.contradicted_assumptions(most_likely(linearisation.tests, softening=UNUSUAL_SOFTENING)),
        *evidence.unusual_estimates(exempt=(FRICTION,)),
        *_nonlinear_range(solution),
    ]


def _nonlinear_range(solution: Solution) -> Iterator[Doubt]:
    """Logs beyond the range of the linear model."""
    if solution.settings.tyre_law == "saturating":
        return
    for record, largest in zip(solution.dataset.records, lateral_accelerations(solution), strict=True):
        if largest > NONLINEAR_ACCELERATION:
            yield Doubt(
                kind=DoubtKind.RANGE, causes=(), parameters=solution.estimated, statistic=largest, log=record.name
            )


def lateral_accelerations(solution: Solution) -> list[float]:
    """Largest lateral acceleration of the first unit in each log, m/s^2."""
    first, min_speed = solution.dataset.vehicle.units[0].name, solution.settings.min_speed
    offsets = [
        solution.problem.values(solution.minimum.z, i).get(f"yaw_rate.{first}.offset", 0.0)
        for i in range(len(solution.dataset.records))
    ]
    return [
        largest_lateral_acceleration(record, first, offset=offset, min_speed=min_speed)
        for record, offset in zip(solution.dataset.records, offsets, strict=True)
    ]
