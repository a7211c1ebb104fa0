"""How well a vehicle that was identified in one stage explains a log: the model runs free.

Only what each log has of its own is fitted: initial states, the bank of the road, who brakes, sensor offsets. The
Gauss-Newton steps begin at the values of the identification or, for another log, at the solution with linear tyres.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from fifthwheel.base.names import NumberedName
from fifthwheel.estimate.identify.dataset import LogData, measured_columns
from fifthwheel.estimate.identify.fit_evaluation import FitsOf, channel_fits
from fifthwheel.estimate.identify.one_stage.estimator import EARLY_TOLERANCE
from fifthwheel.estimate.identify.one_stage.gauss_newton import TOLERANCE, minimise
from fifthwheel.estimate.identify.one_stage.problem import Problem
from fifthwheel.estimate.identify.one_stage.solution import Solution
from fifthwheel.estimate.identify.result.parts import Fit
from fifthwheel.estimate.identify.unknowns.unknown import UnknownKind
from fifthwheel.model.dynamics.tyres import Tyres
from fifthwheel.truck import Vehicle


def fits_of(solution: Solution, vehicle: Vehicle) -> FitsOf:
    """The fits of a log by the identified vehicle."""
    problem = solution.problem
    z = problem.without_variation(solution.minimum.z)
    values = problem.values(z, 0) | problem.model_values(z, 0)

    def fits_of_log(log: LogData, identified_on: bool) -> list[Fit]:
        return _fits(problem, vehicle, values, log, _of_log(solution, log) if identified_on else {})

    return fits_of_log


def _of_log(solution: Solution, log: LogData) -> dict[str, float]:
    """Estimated unknowns of one log of the identification, by the names that they have if it is the only one."""
    i = [own.name for own in solution.problem.logs].index(log.name)
    start = {}
    for name, z in zip(solution.problem.names, solution.minimum.z.tolist(), strict=True):
        parsed = NumberedName.of(name)
        if parsed.log == i:
            start[parsed.of_log(0)] = z
    return start


def _fits(
    problem: Problem, vehicle: Vehicle, values: Mapping[str, float], log: LogData, start: Mapping[str, float]
) -> list[Fit]:
    """Fit of every channel of a log.

    `start` has the estimated unknowns of a log of the identification; it is empty for another log. `values` are those
    of all unknowns that logs share, and of all parameters, SI.
    """
    # with the optional numbers that are unknowns, the vehicle has the compiled model of the identification
    vehicle = vehicle.replace({n: values[n] for n in problem.vehicle.parameters().keys() - vehicle.parameters().keys()})
    own = vehicle.parameters()
    unknowns = [
        u if u.per_log else replace(u, centre=values[u.name], kind=UnknownKind.CONSIDERED)
        for u in problem.unknowns
        if u.per_log or not any(name in own for name in u.moves)
    ]
    outputs, white, identified_on = problem.model.outputs, replace(log, noise_models={}), bool(start)
    law = problem.settings.tyre_law
    laws: tuple[Tyres, ...] = (law,) if identified_on or law == "linear" else ("linear", law)
    for law in laws:
        settings = replace(problem.settings, tyres=law)
        alone = Problem(replace(problem.setup, vehicle=vehicle, unknowns=tuple(unknowns), settings=settings), [white])
        lower, upper = alone.bounds
        minimum = minimise(
            alone,
            np.array([start.get(name, 0.0) for name in alone.names]),
            lower=lower,
            upper=upper,
            iterations=settings.iterations,
            # from the values of the identification one step suffices
            tolerance=EARLY_TOLERANCE if identified_on else TOLERANCE,
        )
        start = dict(zip(alone.names, minimum.z.tolist(), strict=True))
    time, error, _ = alone.residuals(minimum.z, 0, whitened=False)
    measured = np.concatenate([measured_columns(segment, outputs) for segment in log.segments])
    return channel_fits(log.name, outputs, time, measured, measured - error, identified_on=identified_on)
