"""The doubts of one stage: contradicted assumptions, unusual estimates, logs beyond the range of the linear model."""

from collections.abc import Iterator

import numpy as np

from fifthwheel._types import Array
from fifthwheel.identify.doubts import (
    HARMFUL_SHIFT,
    NONLINEAR_ACCELERATION,
    STRONG_SCORE,
    UNUSUAL_ESTIMATE,
    UNUSUAL_SENSOR_ERROR,
    UNUSUAL_SOFTENING,
    Cause,
    Doubt,
    DoubtKind,
    most_likely,
)
from fifthwheel.identify.one_stage.solution import Linearisation, Solution
from fifthwheel.identify.unknowns.unknown import Unknown, UnknownKind
from fifthwheel.record.lateral_acceleration import largest_lateral_acceleration
from fifthwheel.vehicle.parameters import FRICTION


def find_doubts(solution: Solution, linearisation: Linearisation) -> list[Doubt]:
    """The doubts at a solution, each with the estimates that it concerns."""
    doubts = _contradicted_assumptions(solution, linearisation)
    return [*doubts, *_unusual_estimates(solution, linearisation), *_nonlinear_range(solution)]


def _contradicted_assumptions(solution: Solution, linearisation: Linearisation) -> list[Doubt]:
    """The assumption that the score tests contradict most, with those that are about as likely."""
    likely, unknowns = most_likely(linearisation.tests, softening=UNUSUAL_SOFTENING), _unknowns(solution)
    if not likely:
        return []
    strong = abs(likely[0].statistic) > STRONG_SCORE
    moved = [name for test in likely for name in _moved(solution, linearisation, test.shifts)]
    return [
        Doubt(
            kind=DoubtKind.ASSUMPTION,
            causes=tuple(_cause(unknowns[test.name], test.name, test.implied) for test in likely),
            parameters=solution.estimated if strong else tuple(dict.fromkeys(moved)),
            statistic=abs(likely[0].statistic),
        )
    ]


def _unusual_estimates(solution: Solution, linearisation: Linearisation) -> Iterator[Doubt]:
    """Sensor errors and parameters far outside their priors; the friction may differ as roads do."""
    covariance = linearisation.posterior.covariance
    for name, u in _unknowns(solution).items():
        i = solution.problem.names.index(name)
        deviation = float(solution.minimum.z[i])
        if u.kind is UnknownKind.SENSOR and abs(deviation) > UNUSUAL_SENSOR_ERROR:
            kind = DoubtKind.SENSOR
            parameters = _moved(solution, linearisation, covariance[:, i] / covariance[i, i] * deviation)
        elif u.logarithmic and u.is_estimated and abs(deviation) > UNUSUAL_ESTIMATE and name != FRICTION:
            kind, parameters = DoubtKind.ESTIMATE, (name,)
        else:
            continue
        causes = (_cause(u, name, deviation),)
        yield Doubt(kind=kind, causes=causes, parameters=parameters, statistic=abs(deviation))


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


def _unknowns(solution: Solution) -> dict[str, Unknown]:
    """The unknowns by their names in z, without the initial states."""
    problem = solution.problem
    return {
        problem.names[index]: u
        for indices in problem.layout.unknowns
        for u, index in zip(problem.unknowns, indices, strict=True)
    }


def _moved(solution: Solution, linearisation: Linearisation, shifts: Array) -> tuple[str, ...]:
    """The estimated parameters that shifts (k,) of all unknowns move by more than `HARMFUL_SHIFT` sigma."""
    harmful = np.abs(shifts) > HARMFUL_SHIFT * linearisation.posterior.sigma
    return tuple(
        n for n, moved in zip(solution.problem.names, harmful, strict=True) if moved and n in solution.estimated
    )


def _cause(unknown: Unknown, name: str, deviation: float) -> Cause:
    """An unknown that may be wrong by so many standard deviations of its prior."""
    changes = {path: rate * unknown.scale * deviation for path, rate in unknown.slopes.items()}
    return Cause(name=name, changes=changes, prior_sigmas=deviation)
