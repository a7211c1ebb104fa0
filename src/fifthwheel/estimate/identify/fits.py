"""How well a vehicle explains each log, and whether that supports the estimates.

The model runs free, and no measurement corrects it. Only what each log has of its own is fitted: initial states, the
bank of the road, who brakes, sensor offsets. Logs that were only predicted are therefore comparable with logs that the
vehicle was identified on. The Gauss-Newton steps begin at the values of the identification or, for another log, at the
solution with linear tyres.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fifthwheel.base.names import NumberedName
from fifthwheel.base.types import Array
from fifthwheel.data.channels import CHANNELS, SignalName
from fifthwheel.data.record.derived import estimate_noise_variance
from fifthwheel.estimate.filters import variances
from fifthwheel.estimate.identify.dataset import Dataset, LogData, measured_columns
from fifthwheel.estimate.identify.one_stage.estimator import EARLY_TOLERANCE
from fifthwheel.estimate.identify.one_stage.gauss_newton import TOLERANCE, minimise
from fifthwheel.estimate.identify.one_stage.problem import Problem
from fifthwheel.estimate.identify.one_stage.solution import Solution
from fifthwheel.estimate.identify.result.parts import Fit
from fifthwheel.estimate.identify.settings import CommonSettings
from fifthwheel.estimate.identify.setup import Setup
from fifthwheel.model.dynamics.tyres import Tyres
from fifthwheel.truck import Vehicle

FitsOf = Callable[[LogData, bool], list[Fit]]
"""Fits of every channel of a log, and whether the vehicle was identified on it."""
LEAST_EXPLAINED = 0.5
"""A clear signal of which less than this fraction is explained makes the estimates untrustworthy."""
CLEAR_SIGNAL, CLEAR_ROLL = 4.0, 20.0
"""A signal is clear if its variance exceeds that of its noise by this factor. The factor is larger for a roll rate and
a lateral acceleration, because the road rolls a vehicle that drives straight."""
TYRES_AS_THEY_ARE = {"softening": "exact", "variation": "exact"}
"""Given where a vehicle with linear tyres is taken as it is."""
SPEED_MARGIN = 0.1
"""A predicted log may leave the speeds of the identification by this fraction without a note."""


@dataclass(frozen=True, kw_only=True)
class FitEvaluation:
    """Fits of all logs."""

    fits: tuple[Fit, ...]
    notes: tuple[str, ...]
    trusted: bool  # False if the vehicle does not explain a clear signal of a log that was used for the identification


def evaluate_fits(
    dataset: Dataset, logs: Sequence[LogData], fits_of: FitsOf, settings: CommonSettings
) -> FitEvaluation:
    """Fits of all logs of a dataset, and whether they support the estimates.

    `logs` are those that the vehicle was identified on, with their estimated noise; predicted logs get that of the
    first.
    """
    fits = [fit for log in logs for fit in fits_of(log, True)]
    unexplained = [fit for fit in fits if _is_unexplained(fit, dataset.vehicle, settings)]
    notes = [
        f"{fit.signal}: the model explains {max(fit.explained, 0):.0%} of its variance in {fit.log}. Check the signal, "
        "the vehicle file and the initial values."
        for fit in unexplained
    ]
    for log in dataset.validation:
        log = replace(log, noise=logs[0].noise)
        fits += fits_of(log, False)
        notes += _speed_notes(log, dataset.speeds)
    return FitEvaluation(fits=tuple(fits), notes=tuple(notes), trusted=not unexplained)


def _is_unexplained(fit: Fit, vehicle: Vehicle, settings: CommonSettings) -> bool:
    """Whether the model explains too little of a clear signal."""
    noise = variances.sensor_variance(vehicle, fit.signal, settings.stated_noise)
    channel = CHANNELS[SignalName.of(fit.signal).quantity]
    if channel.large_offset:  # its noise is different on every truck
        noise = max(noise, estimate_noise_variance(fit.time, fit.measured) or 0.0)
    ratio = float(np.nanvar(fit.measured)) / noise
    if channel.of_roll:
        return ratio > CLEAR_ROLL and not fit.explained > LEAST_EXPLAINED
    return ratio > CLEAR_SIGNAL and not fit.explained > LEAST_EXPLAINED * (1 - 1 / ratio)


def _speed_notes(log: LogData, speeds: tuple[float, float]) -> list[str]:
    """A note if a log leaves the range of speeds (m/s) by more than the margin."""
    (low, high), (slow, fast) = speeds, log.speeds
    if slow >= (1 - SPEED_MARGIN) * low and fast <= (1 + SPEED_MARGIN) * high:
        return []
    return [
        f"{log.name}: speed from {3.6 * slow:.0f} to {3.6 * fast:.0f} km/h, identified at {3.6 * low:.0f} to "
        f"{3.6 * high:.0f} km/h; the understeer may differ there."
    ]


def channel_fits(
    log: str, channels: Sequence[str], time: Array, measured: Array, predicted: Array, *, identified_on: bool
) -> list[Fit]:
    """Fit of every channel; a channel without variance or with fewer than three samples has none.

    `time` (N,) is in s, `measured` and `predicted` are (N, m).
    """
    fits = []
    for name, y, y_hat in zip(channels, measured.T.copy(), predicted.T.copy(), strict=True):
        present = np.isfinite(y)
        if present.sum() < 3 or np.var(y[present]) == 0:
            continue
        residual = (y - y_hat)[present]
        fits.append(
            Fit(
                log=log,
                signal=name,
                explained=float(1 - np.var(residual) / np.var(y[present])),
                rms=float(np.sqrt(np.mean(residual**2))),
                time=time,
                measured=y,
                predicted=y_hat,
                identified_on=identified_on,
            )
        )
    return fits


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
    known, white, law = start or {}, replace(log, noise_models={}), setup.settings.tyre_law
    laws: tuple[Tyres, ...] = (law,) if known or law == "linear" else ("linear", law)
    # from the values of the identification one step suffices
    tolerance = EARLY_TOLERANCE if known else TOLERANCE
    for law in laws:
        settings = replace(setup.settings, tyres=law)
        alone = Problem(replace(setup, unknowns=tuple(unknowns), settings=settings), [white])
        lower, upper = alone.bounds
        minimum = minimise(
            alone,
            np.array([known.get(name, 0.0) for name in alone.names]),
            lower=lower,
            upper=upper,
            iterations=settings.iterations,
            tolerance=tolerance,
        )
        known = dict(zip(alone.names, minimum.z.tolist(), strict=True))
    time, error, _ = alone.residuals(minimum.z, 0, whitened=False)
    measured = np.concatenate([measured_columns(segment, setup.outputs) for segment in log.segments])
    return channel_fits(log.name, setup.outputs, time, measured, measured - error, identified_on=identified_on)
