"""How well a vehicle that was identified in one stage explains a log: the model runs free.

Only the initial states, the bank of the road and the sensor offsets of the log are fitted. With linear tyres the model
is linear in them (`fit_evaluation`). With tyres that saturate they are found by Gauss-Newton steps, which begin at the
values of the identification or, for another log, at the solution with linear tyres.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from fifthwheel import dynamics
from fifthwheel.dynamics.tyre_law import Tyres
from fifthwheel.identify.dataset import LogData, measured_columns
from fifthwheel.identify.fit_evaluation import FitsOf, channel_fits, free_run_fits
from fifthwheel.identify.one_stage.estimator import ROUND_TOLERANCES
from fifthwheel.identify.one_stage.gauss_newton import TOLERANCE, minimise
from fifthwheel.identify.one_stage.problem import Problem
from fifthwheel.identify.one_stage.solution import Solution
from fifthwheel.identify.result import Fit
from fifthwheel.identify.unknowns.unknown import UnknownKind
from fifthwheel.vehicle import Vehicle


def fits_of(solution: Solution, vehicle: Vehicle) -> FitsOf:
    """The fits of a log by the identified vehicle."""
    problem, law = solution.problem, solution.settings.tyre_law
    z = problem.without_variation(solution.minimum.z)
    values = problem.values(z, 0) | problem.model_values(z, 0)
    sensors = {u.name: values[u.name] for u in problem.unknowns if u.kind is UnknownKind.SENSOR and not u.per_log}
    model = dynamics.model(vehicle, problem.model.outputs, roll=problem.model.roll, bank=problem.model.bank)

    def fits_of_log(log: LogData, identified_on: bool) -> list[Fit]:
        if law != "linear":
            start = _of_log(solution, log) if identified_on else {}
            return _saturating_fits(problem, vehicle, values, log, start)
        return free_run_fits(model, vehicle, log, problem.unknowns, values=sensors, identified_on=identified_on)

    return fits_of_log


def _of_log(solution: Solution, log: LogData) -> dict[str, float]:
    """Estimated unknowns of one log of the identification, by the names that they have if it is the only one."""
    i = [own.name for own in solution.problem.logs].index(log.name)
    start = {}
    for name, z in zip(solution.problem.names, solution.minimum.z.tolist(), strict=True):
        base, _, number = name.rpartition("@")
        of_log, point, segment = number.partition(".")
        if base and of_log == str(i):
            start[f"{base}@0{point}{segment}"] = z
    return start


def _saturating_fits(
    problem: Problem, vehicle: Vehicle, values: Mapping[str, float], log: LogData, start: Mapping[str, float]
) -> list[Fit]:
    """Fit of every channel of a log, as `fit_evaluation.free_run_fits` for linear tyres.

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
    laws: tuple[Tyres, ...] = (problem.settings.tyre_law,) if identified_on else ("linear", problem.settings.tyre_law)
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
            tolerance=ROUND_TOLERANCES[0] if identified_on else TOLERANCE,
        )
        start = dict(zip(alone.names, minimum.z.tolist(), strict=True))
    time, error, _ = alone.residuals(minimum.z, 0, whitened=False)
    measured = np.concatenate([measured_columns(segment, outputs) for segment in log.segments])
    return channel_fits(log.name, outputs, time, measured, measured - error, identified_on=identified_on)
