"""How well a vehicle explains a log: the model runs free, and no measurement corrects it.

Only what each log has of its own is fitted: initial states, the bank of the road, who brakes, sensor offsets. Logs that
were only predicted are therefore comparable with logs that the vehicle was identified on. The Gauss-Newton steps begin
at the values of the identification or, for another log, at the solution with linear tyres.
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
from fifthwheel.estimate.identify.setup import Setup
from fifthwheel.model.dynamics.tyre_law import Tyres
from fifthwheel.truck import Vehicle


def fits_of(solution: Solution, vehicle: Vehicle) -> FitsOf:
    """The fits of a log by the identified vehicle."""
    problem = solution.problem
    z = problem.without_variation(solution.minimum.z)
    values = problem.values(z, 0) | problem.model_values(z, 0)
    # with the optional numbers that are unknowns, the vehicle has the compiled model of the identification
    vehicle = vehicle.replace({n: values[n] for n in problem.vehicle.parameters().keys() - vehicle.parameters().keys()})
    setup = replace(problem.setup, vehicle=vehicle)

    def fits_of_log(log: LogData, identified_on: bool) -> list[Fit]:
        start = _of_log(solution, log) if identified_on else {}
        return free_run_fits(setup, log, values, start=start, identified_on=identified_on)

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


def free_run_fits(
    setup: Setup,
    log: LogData,
    shared: Mapping[str, float],
    *,
    start: Mapping[str, float] | None = None,
    identified_on: bool = False,
) -> list[Fit]:
    """Fit of every channel of a log by the vehicle of a setup.

    `shared` are values of what logs share beside this vehicle, such as gains and delays of sensors, SI. `start` are
    estimates of the unknowns of this log, in units of their priors.
    """
    own = setup.vehicle.parameters()
    unknowns = [
        u if u.per_log else replace(u, centre=shared.get(u.name, own.get(u.name, u.centre)), estimated=False)
        for u in setup.unknowns
        if u.per_log or not any(name in own for name in u.moves)
    ]
    start, white, law = start or {}, replace(log, noise_models={}), setup.settings.tyre_law
    laws: tuple[Tyres, ...] = (law,) if identified_on or law == "linear" else ("linear", law)
    for law in laws:
        settings = replace(setup.settings, tyres=law)
        alone = Problem(replace(setup, unknowns=tuple(unknowns), settings=settings), [white])
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
    measured = np.concatenate([measured_columns(segment, setup.outputs) for segment in log.segments])
    return channel_fits(log.name, setup.outputs, time, measured, measured - error, identified_on=identified_on)
