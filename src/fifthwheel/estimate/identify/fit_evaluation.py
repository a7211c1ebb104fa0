"""How well the identified vehicle explains each log: the model runs free, and no measurement corrects it.

The model is linear in the initial state of each segment, in the bank of the road there and in the sensor offsets of
the log, theta together. The prediction of a log is

    y(theta) = y_0 + Phi theta,    theta ~ N(0, S),

with y_0 the response to the inputs from the steady initial state and Phi the responses to unit changes. theta
minimises the weighted squares of y - y(theta) over all samples of the log plus theta' S^-1 theta. Nothing else is
fitted, so logs that were only predicted are comparable with logs that were used for the identification.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fifthwheel.base.types import Array
from fifthwheel.data.channels import CHANNELS, SignalName, is_sensor_error
from fifthwheel.data.record import Record
from fifthwheel.data.record.derived import estimate_noise_variance
from fifthwheel.estimate.filters import variances
from fifthwheel.estimate.filters.initial_state import initial_factor, initial_sigma, initial_state
from fifthwheel.estimate.filters.step_rows import corrected_inputs, steer_sigma
from fifthwheel.estimate.identify.dataset import Dataset, LogData, measured_columns
from fifthwheel.estimate.identify.result.parts import Fit
from fifthwheel.estimate.identify.settings import CommonSettings
from fifthwheel.estimate.identify.unknowns.unknown import Unknown
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics import ChainModel
from fifthwheel.model.dynamics.simulation import free_response
from fifthwheel.truck import Vehicle

FitsOf = Callable[[LogData, bool], list[Fit]]
"""Fits of every channel of a log, and whether the vehicle was identified on it."""
BLOCK = 4_000
"""Number of samples that are processed together."""
DECAYED = 1e-9
"""The response to an initial state is left out once it has decayed to this fraction."""
OUTLIER = 6.0
"""A residual beyond this multiple of the typical residual does not count in the fit of theta."""
LEAST_EXPLAINED = 0.5
"""A clear signal of which less than this fraction is explained makes the estimates untrustworthy."""
CLEAR_SIGNAL, CLEAR_ROLL = 4.0, 20.0
"""A signal is clear if its variance exceeds that of its noise by this factor. The factor is larger for a roll rate and
a lateral acceleration, because the road rolls a vehicle that drives straight."""
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


def free_run_fits(
    model: ChainModel,
    vehicle: Vehicle,
    log: LogData,
    unknowns: Sequence[Unknown],
    *,
    values: Mapping[str, float],
    identified_on: bool,
) -> list[Fit]:
    """Fit of every channel of a log by a model without free parameters; see `channel_fits`.

    The sensor offsets among the unknowns have their priors here; `values` are sensor gains and delays, SI.
    """
    runs = [_free_run(model, vehicle, log, segment, unknowns, values) for segment in log.segments]
    solutions = _robust_solution(runs)
    time, measured = (np.concatenate([getattr(run, key) for run in runs]) for key in ("time", "measured"))
    predicted = np.concatenate(
        [run.response + run.effect(theta) * run.deviation for run, theta in zip(runs, solutions, strict=True)]
    )
    return channel_fits(log.name, model.outputs, time, measured, predicted, identified_on=identified_on)


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


@dataclass(frozen=True, kw_only=True)
class _FreeRun:
    """The free run of one segment, and the responses to unit changes of theta.

    They are the columns of a design matrix (N, m, j) in units of the noise. It is made in blocks of samples, because it
    would not fit into memory.
    """

    time: Array  # (N,) s
    measured: Array  # (N, m)
    response: Array  # (N, m) from the steady initial state
    deviation: Array  # (m,) standard deviation of the noise
    own: Sequence[Array]  # responses (N_i, m) to initial state and bank, in units of their priors, 0 from N_i on
    shared: Sequence[Array]  # responses (N, m) to the offsets of the log, in units of their priors

    @property
    def target(self) -> Array:
        """What theta has to explain (N, m), in units of the noise; NaN where not measured."""
        return np.asarray((self.measured - self.response) / self.deviation)

    def blocks(self) -> Iterator[tuple[slice, Array, list[int]]]:
        """Blocks of samples, their matrices (M, m, j), and the numbers of the j columns that are not zero."""
        scale, columns = 1 / self.deviation, (*self.own, *self.shared)
        for begin in range(0, len(self.time), BLOCK):
            rows = slice(begin, min(begin + BLOCK, len(self.time)))
            active = [i for i, column in enumerate(columns) if len(column) > begin]
            matrix = np.zeros((rows.stop - begin, len(scale), len(active)))
            for j, i in enumerate(active):
                column = columns[i][rows]
                matrix[: len(column), :, j] = column
            yield rows, matrix * scale[:, None], active

    def effect(self, theta: Array) -> Array:
        """The product (N, m) of the design matrix with theta (j,) of the segment."""
        return np.concatenate([matrix @ theta[active] for _, matrix, active in self.blocks()])

    def normal_equations(self, target: Array, weight: Array) -> tuple[Array, Array]:
        """Matrix (j, j) and right side (j,) of the weighted least squares; target and weight (N, m)."""
        k = len(self.own) + len(self.shared)
        normal, product = np.zeros((k, k)), np.zeros(k)
        for rows, matrix, active in self.blocks():
            if active:
                weighted = (matrix * weight[rows, :, None]).reshape(-1, len(active))
                normal[np.ix_(active, active)] += weighted.T @ matrix.reshape(-1, len(active))
                product[active] += np.where(weight[rows] > 0, target[rows], 0.0).ravel() @ weighted
        return normal, product


def _free_run(
    model: ChainModel,
    vehicle: Vehicle,
    log: LogData,
    segment: Record,
    unknowns: Sequence[Unknown],
    values: Mapping[str, float],
) -> _FreeRun:
    p = dynamics.all_parameters(vehicle, model.outputs)
    p |= {name: value for name, value in values.items() if not is_sensor_error(name, "delay")}
    inputs = corrected_inputs(segment, model.inputs, values)
    first = {name: float(v[0]) for name, v in inputs.items()}
    bank = initial_sigma("bank.road") if model.bank else None
    x0, P0 = initial_state(vehicle, first, values, roll=model.roll, steer_sigma=steer_sigma(inputs), bank=bank)
    own, shared = _unit_responses(model, p, segment.time, inputs, initial_factor(P0), unknowns)
    return _FreeRun(
        time=segment.time,
        measured=measured_columns(segment, model.outputs),
        response=free_response(model, p, segment.time, inputs, x0)[1],
        deviation=np.sqrt([variances.sensor_variance(vehicle, name, log.noise) for name in model.outputs]),
        own=own,
        shared=shared,
    )


def _unit_responses(
    model: ChainModel,
    p: Mapping[str, float],
    time: Array,
    inputs: Mapping[str, Array],
    initial_factor: Array,
    unknowns: Sequence[Unknown],
) -> tuple[list[Array], list[Array]]:
    """Responses (N, m) to one prior standard deviation of each element of theta: of the segment, and of the log.

    Those of the segment are to the initial state, by the factor (n, n) of its covariance; they end where they have
    decayed. Those of the log are to the offsets among the unknowns.
    """
    straight = {name: np.zeros_like(time) for name in model.inputs[1:]}

    def run(x0: Array | None, steer: Mapping[str, Array], count: int = len(time)) -> Array:
        channels = {name: values[:count] for name, values in {**inputs, **steer}.items()}
        return free_response(model, p, time[:count], channels, x0)[1]

    baseline = run(None, straight)
    columns, count = [], min(BLOCK, len(time))
    for x0 in initial_factor.T:
        column = run(x0, straight, count) - baseline[:count]
        while count < len(time) and not _decayed(column):
            count = min(2 * count, len(time))
            column = run(x0, straight, count) - baseline[:count]
        columns.append(column)
    offsets, shared = {u.name: u.scale for u in unknowns if u.per_log}, []
    for name in model.inputs[1:]:
        if sigma := offsets.get(f"{name}.offset"):
            shared.append(sigma * (run(None, straight | {name: -np.ones_like(time)}) - baseline))
    for name, column in zip(model.outputs, np.eye(len(model.outputs)), strict=True):
        if sigma := offsets.get(f"{name}.offset"):
            shared.append(np.broadcast_to(sigma * column, (len(time), len(column))))
    return columns, shared


def _decayed(response: Array) -> bool:
    """Whether the second half of a response (N, m) is negligible."""
    first, second = (np.abs(half).max(initial=0.0) for half in np.array_split(response, 2))
    return bool(second <= DECAYED * first)


def _robust_solution(runs: Sequence[_FreeRun]) -> list[Array]:
    """theta (j,) of each segment in units of its prior, by least squares in three iterations without outliers."""
    targets = [run.target for run in runs]
    weights = [np.isfinite(target).astype(float) for target in targets]
    for _ in range(3):
        solutions = _solution(runs, [r.normal_equations(*tw) for r, *tw in zip(runs, targets, weights, strict=True)])
        residuals = [np.abs(t - run.effect(x)) for t, run, x in zip(targets, runs, solutions, strict=True)]
        typical = max(1.0, float(np.nanmedian(np.concatenate(residuals)) / 0.6745))
        weights = [(np.nan_to_num(r, nan=np.inf) < OUTLIER * typical).astype(float) for r in residuals]
    return solutions


def _solution(runs: Sequence[_FreeRun], equations: Sequence[tuple[Array, Array]]) -> list[Array]:
    """theta (j,) of each segment, from its normal equations without the prior."""
    k = len(runs[0].shared)
    matrix, right, eliminated = np.eye(k), np.zeros(k), []
    for run, (normal, product) in zip(runs, equations, strict=True):
        n = len(run.own)  # eliminated, which leaves equations of the shared elements: a log may have many segments
        own = _solved(normal[:n, :n] + np.eye(n), np.column_stack([normal[:n, n:], product[:n]]))
        matrix += normal[n:, n:] - normal[n:, :n] @ own[:, :k]
        right += product[n:] - normal[n:, :n] @ own[:, k]
        eliminated.append(own)
    shared = _solved(matrix, right[:, None])[:, 0]
    return [np.concatenate([own[:, k] - own[:, :k] @ shared, shared]) for own in eliminated]


def _solved(matrix: Array, right: Array) -> Array:
    """The solution (n, j) of normal equations; the least one if they are singular, as of an unstable vehicle, of which
    all responses grow without limit in the same direction."""
    scale = 1 / np.sqrt(np.maximum(np.diag(matrix), 1.0))[:, None]
    return np.asarray(scale * np.linalg.lstsq(matrix * scale * scale.T, scale * right)[0])
