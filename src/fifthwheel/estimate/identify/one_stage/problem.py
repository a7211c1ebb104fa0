"""The one-stage problem: the cost of all unknowns over all logs, and its derivatives.

Unknowns. z holds every unknown in units of its prior, z ~ N(0, I) (`unknown.Unknown`):

    parameters, sensor errors that all logs share    "name"         once
    sensor errors of one log                         "name@i"       for each log i
    initial states of a segment                      "state@i.j"    for each segment j of log i; output-error form only

The initial state of a segment is x_0 = x_s(p, d_0, b) + L z_x: the steady state of the first inputs d_0 and of the bank
b, and a deviation with the prior covariance L L'. The last element of z_x is the bank in units of its prior.

Cost. Minus the logarithm of the posterior density, without its constant:

    J(z) = cost of the prior (`prior`) + sum over samples and channels of rho(e / s) [+ log s],

with rho of Huber (1964), see `likelihood`. Two forms of the residual e (Ljung 1999, chapter 7):

    output error        e = y - h(x, d, p) with x free-running from x_0; s is a constant of the channel
    prediction error    e is the innovation of a Kalman filter from x_0, s its standard deviation, which depends on z

Derivatives. e and s are differentiated along every unknown, without differences (`filters.tangent`). `Problem.expand`
combines them to the gradient of J, and to the Hessian W + H with the precision W of the prior and the Fisher
information H of the logs (Gauss-Newton).
"""

import copy
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np

from fifthwheel.base.errors import VehicleError
from fifthwheel.base.native import AdjointScan, DirectionScan
from fifthwheel.base.types import Array, Indices
from fifthwheel.data.channels import ARTICULATION, SPEED, STEER, YAW_RATE, is_input, is_of, is_sensor_error, names_of
from fifthwheel.data.checks.samples import present_samples
from fifthwheel.data.record import Record
from fifthwheel.estimate.filters import Noise, tangent, variances
from fifthwheel.estimate.filters.initial_state import (
    bank_effect,
    initial_factor,
    initial_state,
    steady_initial_state,
)
from fifthwheel.estimate.filters.noise_model import CORRELATION_TIME, autocorrelation_factor, fit_noise_model
from fifthwheel.estimate.filters.step_rows import StepRows, steer_sigma, step_rows
from fifthwheel.estimate.identify.dataset import LogData, speed_range
from fifthwheel.estimate.identify.one_stage import likelihood
from fifthwheel.estimate.identify.one_stage.gauss_newton import Quadratic
from fifthwheel.estimate.identify.one_stage.likelihood import ResidualBlock
from fifthwheel.estimate.identify.one_stage.prior import JointPrior, Prior
from fifthwheel.estimate.identify.one_stage.segment_run import (
    segment_blocks,
    segment_gradient,
    steady_state_slopes,
)
from fifthwheel.estimate.identify.setup import Setup
from fifthwheel.estimate.identify.statement import prior_of
from fifthwheel.estimate.identify.unknowns.unknown import Unknown
from fifthwheel.truck.quantities import DISCREPANCY, DRIVE_AXLE_BRAKING

SHORTEST_PART = 20.0
"""Of a segment in a shortened problem, s."""

CLEAR_SIGNAL = 20.0
"""A truck turns where the variance of a channel exceeds that of its white noise by this factor."""

START_DECAY = 0.3
"""Least rate at which the slowest mode decays at the start of a search, 1/s: a truck that hardly decays may spin."""
FEWEST_RESIDUALS = 20
"""A channel with fewer residuals keeps its noise."""


class ProblemLayout(NamedTuple):
    """Where each unknown is in z."""

    names: tuple[str, ...]
    unknowns: tuple[Indices, ...]  # of each log: indices of its unknowns, in their order
    initial_states: tuple[tuple[Indices, ...], ...]  # of each segment of each log; empty in the prediction-error form

    @classmethod
    def of(cls, unknowns: Sequence[Unknown], segments: Sequence[int], states: Sequence[str]) -> Self:
        """The layout for logs with these numbers of segments, each of which has these initial states."""
        own, logs = [u.name for u in unknowns if u.per_log], range(len(segments))
        names = [u.name for u in unknowns if not u.per_log]
        names += [f"{name}@{i}" for i in logs for name in own]
        names += [f"{state}@{i}.{j}" for i, count in enumerate(segments) for j in range(count) for state in states]
        place = {name: k for k, name in enumerate(names)}

        def places(selected: Iterable[str]) -> Indices:
            return np.array([place[name] for name in selected], dtype=np.int64)

        return cls(
            tuple(names),
            tuple(places(f"{u.name}@{i}" if u.per_log else u.name for u in unknowns) for i in logs),
            tuple(tuple(places(f"{s}@{i}.{j}" for s in states) for j in range(segments[i])) for i in logs),
        )


class Problem:
    """The cost of the unknowns over all logs of one vehicle, for the noise of the channels in `logs`.

    A problem does not change; `with_residual_noise` gives one with other noise. A channel of a log without noise
    variance gets that of the settings or the table; all autocorrelation factors are set to 1. `earlier` is the
    information of earlier logs on the unknowns.
    """

    def __init__(
        self,
        setup: Setup,
        logs: Sequence[LogData],
        earlier: JointPrior | None = None,
        gross_error: tuple[str, float] | None = None,
    ) -> None:
        self._gross_error = gross_error  # see `with_gross_error`
        self.setup, self.model, self.vehicle = setup, setup.model, setup.vehicle
        self.unknowns, self.settings, self._earlier = setup.unknowns, setup.settings, earlier
        self.logs = tuple(
            replace(
                log.with_noise(self.vehicle, self.model.outputs, self.settings.noise),
                autocorrelation_factor=dict.fromkeys(self.model.outputs, 1.0),
            )
            for log in logs
        )
        self._rows: dict[tuple[float, ...], StepRows] = {}  # of each segment, for the last delays

    def shortened(self, rows: int) -> "Problem":
        """The problem for about so many rows of the logs: of each segment, the part with most steering.

        A part lasts at least `SHORTEST_PART`. The problem itself if the logs are not longer.
        """
        fraction = rows / len(self)
        if fraction >= 1:
            return self
        logs = [replace(log, segments=[_part(segment, fraction) for segment in log.segments]) for log in self.logs]
        return self._with_logs(logs)

    def with_delays(self, delays: Mapping[tuple[str, str], float]) -> "Problem":
        """The problem with corrected timestamps: the delay, s, by log and signal."""
        logs = []
        for log in self.logs:
            own = {signal: delay for (name, signal), delay in delays.items() if name == log.name}
            logs.append(replace(log, segments=[_corrected(segment, own) for segment in log.segments]))
        return self._with_logs(logs)

    def with_gross_error(self, name: str, factor: float, largest: float) -> "Problem":
        """The problem in which the prior of an element of z is normal and so many times wider, without earlier logs.

        Its bounds are so many of the new standard deviations away, as far as a vehicle can have the number.
        """
        others = frozenset(self.names) - {name}
        setup = self.setup.with_unknown(self.unknowns_by_name[name].reaching(factor * largest))
        return Problem(setup, self.logs, self._earlier and self._earlier.among(others), (name, factor))

    def _with_logs(self, logs: Sequence[LogData]) -> "Problem":
        return Problem(self.setup, logs, self._earlier, self._gross_error)

    def __len__(self) -> int:
        """Number of rows."""
        return sum(len(segment) for log in self.logs for segment in log.segments)

    @property
    def output_error(self) -> bool:
        """Whether the residuals are those of the free-running model."""
        return self.settings.form == "output_error"

    @cached_property
    def layout(self) -> ProblemLayout:
        """Where each unknown is in z."""
        states = self.model.states if self.output_error else ()
        return ProblemLayout.of(self.unknowns, [len(log.segments) for log in self.logs], states)

    @property
    def names(self) -> tuple[str, ...]:
        """Of all elements of z (k,)."""
        return self.layout.names

    @cached_property
    def unknowns_by_name(self) -> dict[str, Unknown]:
        """The unknown of each element of z but the initial states, by its name."""
        return {
            self.names[index]: u
            for indices in self.layout.unknowns
            for u, index in zip(self.unknowns, indices, strict=True)
        }

    @property
    def nuisances(self) -> tuple[int, ...]:
        """Indices of all unknowns but the estimated parameters."""
        return tuple(i for i, name in enumerate(self.names) if name not in self.setup.estimated)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of z (k,); unknowns that are not estimated keep their prior mean 0."""
        lower, upper = np.full(len(self.names), -8.0), np.full(len(self.names), 8.0)
        for indices in self.layout.unknowns:
            lower[indices] = self.setup.scaling.to_z(self.setup.scaling.lower)
            upper[indices] = self.setup.scaling.to_z(self.setup.scaling.upper)
            considered = indices[[not u.estimated for u in self.unknowns]]
            lower[considered] = upper[considered] = 0.0
        return lower, upper

    def segments(self) -> list[tuple[int, int]]:
        """Numbers (log, segment) of all segments in order."""
        return [(i, j) for i, log in enumerate(self.logs) for j in range(len(log.segments))]

    def values(self, z: Array, log: int) -> dict[str, float]:
        """Values of the unknowns of one log, SI."""
        return self.setup.values(z[self.layout.unknowns[log]])

    def model_values(self, z: Array, log: int) -> dict[str, float]:
        """Every parameter of the model for one log, SI."""
        return self.setup.model_values(z[self.layout.unknowns[log]])

    def without_variation(self, z: Array) -> Array:
        """z without what differs from log to log in the vehicle."""
        unknowns = zip(self.unknowns, self.layout.unknowns[0], strict=True)
        z = z.copy()
        z[[index for u, index in unknowns if u.per_log and not u.is_sensor_error]] = 0.0
        return z

    def variance(self, log: int) -> Array:
        """Effective noise variance of every channel (m,)."""
        return np.array([self.logs[log].effective_variance(name) for name in self.model.outputs])

    @cached_property
    def prior(self) -> Prior:
        """Of all unknowns."""
        tails = np.array([u.tail if (u := self.unknowns_by_name.get(name)) else np.inf for name in self.names])
        own = dict[str, tuple[float, float]]()
        for i, log in enumerate(self.logs):
            name = f"{DRIVE_AXLE_BRAKING}@{i}"
            if log.drive_axle_braking and (u := self.unknowns_by_name.get(name)):
                mean, sigma = log.drive_axle_braking
                own[name] = (mean - u.centre) / u.scale, sigma / u.scale
        if self._gross_error:
            name, factor = self._gross_error
            tails[self.names.index(name)], own[name] = np.inf, (own.get(name, (0.0, 1.0))[0], factor)
        return Prior(self.names, tails, self._earlier, own)

    def sample_interval(self, log: int, channel: str) -> float:
        """Typical time between two samples of a channel of a log, s; NaN for fewer than two."""
        present = [present_samples(s, channel)[0] for s in self.logs[log].segments if channel in s.signals]
        steps = np.concatenate([np.empty(0), *map(np.diff, present)])
        return float(np.median(steps)) if steps.size else math.nan

    def cost(self, z: Array) -> float:
        """J(z); infinite where a free-running vehicle is unstable: its residuals would grow without limit."""
        if self.output_error and self.unstable(z):
            return np.inf
        total, limit = self.prior.cost(z), self.settings.outlier
        with np.errstate(over="ignore", invalid="ignore"):
            for i, j in self.segments():
                total += sum(likelihood.loss(block, limit) for block in self.blocks(z, i, j, differentiated=False))
        return total if np.isfinite(total) else np.inf

    def expand(self, z: Array) -> Quadratic:
        """J about z: its gradient and the Gauss-Newton Hessian."""
        cost, gradient, hessian = self.prior.expand(z)
        limit = self.settings.outlier
        with np.errstate(over="ignore", invalid="ignore"):
            for i, j in self.segments():
                for block in self.blocks(z, i, j):
                    block_gradient, block_information = likelihood.gradient_and_information(block, limit)
                    cost += likelihood.loss(block, limit)
                    gradient[block.indices] += block_gradient
                    hessian[np.ix_(block.indices, block.indices)] += block_information
        return Quadratic(cost, gradient, hessian)

    def gradient(self, z: Array) -> Array:
        """Gradient (k,) of J at z, which takes less time than `expand` in the output-error form."""
        if not self.output_error:
            return self.expand(z).gradient
        gradient, scan = self.prior.expand(z).gradient, tangent.simulation_gradient(self.model)
        with np.errstate(over="ignore", invalid="ignore"):
            for i, j in self.segments():
                rows, start, constant, directions, indices = self._start(z, i, j)
                limit = self.settings.outlier
                gradient[indices] += segment_gradient(scan, rows, start, constant, directions, limit)
        return gradient

    def blocks(
        self, z: Array, i: int, j: int, *, differentiated: bool = True, whitened: bool = True
    ) -> Iterator[ResidualBlock]:
        """Residuals of segment j of log i at z, block by block, `differentiated` along the estimated unknowns or not.

        `whitened`: the discrepancy of each channel is predicted from the residuals before and subtracted; only in the
        output-error form.
        """
        scan: AdjointScan | DirectionScan
        if not self.output_error:
            scan = tangent.innovations_tangent(self.model)
        elif self.model.tyres == "linear":
            scan = tangent.simulation_directions(self.model)
        else:
            scan = tangent.simulation_adjoint(self.model)
        return segment_blocks(scan, *self._start(z, i, j, differentiated=differentiated, whitened=whitened))

    def _start(
        self, z: Array, i: int, j: int, *, differentiated: bool = True, whitened: bool = True
    ) -> tuple[StepRows, tuple[Array, Array], Array, Array, Indices]:
        """Rows, start, constant, directions and indices of `segment_blocks` for a segment; arguments as in `blocks`."""
        values = self.model_values(z, i)
        rows = self._step_rows(i, j, values)
        # the delays have been applied to the rows, so the model has none
        p = self.model.free_values({**values, **dict.fromkeys(self._delays, 0.0)})
        factor, initial = self._initial_factors[i][j], self.layout.initial_states[i][j]
        level, m = steady_initial_state(self.vehicle, rows.first, values, roll=self.model.roll)
        steady = np.append(level, 0.0)
        x0 = steady[: len(self.model.states)]
        if self.output_error:
            if self.model.bank:
                effect = self.setup.bank_sigma * bank_effect(m)
                factor = np.column_stack([factor[:, :-1], effect])
                steady = steady + effect * z[initial[-1]]
            x0 = x0 + factor @ z[initial]
        if not differentiated:
            p_directions, x0_directions = np.zeros((0, len(p))), np.zeros((0, len(x0)))
            indices = np.zeros(0, dtype=np.int64)
        else:
            selected = [a for a, u in enumerate(self.unknowns) if u.estimated]
            unknowns = [self.unknowns[a] for a in selected]
            slope = self.setup.scaling.slope(np.array(list(self.values(z, i).values())))[selected]
            p_directions = np.zeros((len(unknowns) + len(initial), len(p)))
            for row, (u, dp_dz) in enumerate(zip(unknowns, slope, strict=True)):
                for name, rate in u.slopes.items():
                    p_directions[row, self._places[name]] = rate * dp_dz
            of_steady = steady_state_slopes(self.model, self.vehicle, rows.first, values, unknowns, steady, m)
            x0_directions = np.vstack([of_steady * slope[:, None], factor.T[: len(initial)]])
            indices = np.concatenate([self.layout.unknowns[i][selected], initial])
        if self.output_error:
            models = [self.logs[i].noise_model(name) for name in self.model.outputs]
            if not whitened:
                models = [replace(m, white=r, discrepancy=0.0) for m, r in zip(models, self.variance(i), strict=True)]
            r, q, tau = np.array([(m.white, m.discrepancy, m.time_constant) for m in models]).T
            start, constant = tangent.simulation_start(x0, q, x0_directions), [p, r, q, tau]
        else:
            multiple = max(self.settings.process_noise, 1e-9)
            process = variances.process_covariance(self.model.states, variances.PROCESS_VARIANCE, multiple)
            noise = Noise(process=process, measurement=self.variance(i), gate=self.settings.gate)
            start, constant = tangent.innovations_start(x0, factor @ factor.T, x0_directions), [p, noise.vector()]
        return rows, start, np.concatenate(constant), p_directions, indices

    def residuals(self, z: Array, log: int, *, whitened: bool = True) -> tuple[Array, Array, Array]:
        """Time (N,), residuals (N, m) and their variances (N, m) of all segments of a log, `whitened` or not."""
        segments, end = self.logs[log].segments, 0
        time = np.empty(sum(map(len, segments)))
        error, variance = (np.empty((len(time), len(self.model.outputs)), order="F") for _ in range(2))
        for j in range(len(segments)):
            for block in self.blocks(z, log, j, differentiated=False, whitened=whitened):
                rows = slice(end, end := end + len(block.time))
                time[rows], error[rows], variance[rows] = block.time, block.error, block.variance
        return time, error, variance

    def log_likelihood(self, z: Array) -> float:
        """Logarithm of the density of all logs at z, for the noise of the problem."""
        limit = self.settings.outlier
        blocks = (b for i, j in self.segments() for b in self.blocks(z, i, j, differentiated=False))
        return sum(likelihood.log_density(block, limit) for block in blocks)

    def slowest_decay(self, z: Array) -> float:
        """Rate at which the slowest mode of the vehicle decays at the lowest or highest speed of the logs, 1/s."""
        return self.setup.slowest_decay(z[self.layout.unknowns[0]], self._speed_range)

    def unstable(self, z: Array) -> bool:
        """Whether the vehicle is unstable at the lowest or highest speed of the logs."""
        try:
            return self.slowest_decay(z) <= 0
        except VehicleError:  # such as a payload that is heavier than its unit
            return True

    def stiffened(self, z: Array) -> Array:
        """z with stiffer tyres behind the first axle group, if the vehicle is unstable at z, or nearly."""
        first, z = self.layout.unknowns[0], z.copy()
        z[first] = self.setup.stiffened(z[first], self._speed_range, START_DECAY)
        return z

    def with_residual_noise(self, z: Array, *, autocorrelated: bool) -> "Problem":
        """The problem with the noise of each channel that its residuals at z have.

        Residuals beyond the limit for outliers count as lying on it. `autocorrelated`: they are not taken as white, so
        that the output-error form fits a noise model to them, and the prediction-error form enlarges their variance by
        an autocorrelation factor.
        """
        problem = copy.copy(self)  # what is cached does not depend on the noise
        problem.logs = tuple(self._residual_noise(z, i, autocorrelated) for i in range(len(self.logs)))
        return problem

    def excess(self, z: Array, part: "Problem") -> float:
        """Largest ratio of the mean square of the residuals of a channel at z to its noise in a part of the logs."""
        ratios = [1.0]
        for i, log in enumerate(part.logs):
            _, error, _ = self.residuals(z, i, whitened=False)
            with np.errstate(over="ignore", invalid="ignore"):
                ratios += [
                    float(np.nanmean(e**2)) / log.noise[n]
                    for n, e in zip(self.model.outputs, error.T, strict=True)
                    if np.isfinite(e).any()
                ]
        return max(ratios)

    def _residual_noise(self, z: Array, i: int, autocorrelated: bool) -> LogData:
        log, limit = self.logs[i], self.settings.outlier
        least = prior_of(self.settings.given, DISCREPANCY)[1] ** 2
        noise, factors, models = dict(log.noise), dict(log.autocorrelation_factor), dict(log.noise_models)
        _, error, spread = self.residuals(z, i, whitened=False)
        ends = np.cumsum([len(segment) for segment in log.segments])[:-1]
        for c, name in enumerate(self.model.outputs):
            of_segments = np.split(error[:, c] / np.sqrt(spread[:, c]), ends)
            sizes = [np.clip(size[np.isfinite(size)], -limit, limit) for size in of_segments]
            size = np.concatenate(sizes)
            if len(size) < FEWEST_RESIDUALS:
                continue
            dt, variance = self.sample_interval(i, name), log.effective_variance(name)
            noise[name] = variance * float(np.clip(np.mean(size**2), 1e-3, 1e3))
            models.pop(name, None)
            if autocorrelated and self.output_error:
                fitted = fit_noise_model([s * np.sqrt(variance) for s in sizes], dt)
                smallest = least * self._signal_variance(i, name)
                models[name] = replace(fitted, discrepancy=max(fitted.discrepancy, smallest))
            elif autocorrelated:
                factors[name] = autocorrelation_factor(size, int(CORRELATION_TIME / dt))
        return replace(log, noise=noise, autocorrelation_factor=factors, noise_models=models)

    @property
    def relative_discrepancy(self) -> float:
        """Standard deviation of the discrepancy as a fraction of the signal; 0 without noise models.

        The largest of the yaw rates and articulation angles, which the road hardly moves, where the truck turns.
        """
        largest = 0.0
        for i, log in enumerate(self.logs):
            for name, noise in log.noise_models.items():
                signal = self._signal_variance(i, name)
                if is_of(name, YAW_RATE, ARTICULATION) and signal > CLEAR_SIGNAL * noise.white:
                    largest = max(largest, math.sqrt(noise.discrepancy / signal))
        return largest

    def _signal_variance(self, i: int, name: str) -> float:
        """Variance of a channel of log i, without that of its noise, SI squared."""
        values = np.concatenate([present_samples(s, name)[1] for s in self.logs[i].segments if name in s.signals])
        steps = np.diff(values)
        return max(float(np.nanvar(values) - np.nanvar(steps) / 2), 0.0)

    @cached_property
    def _places(self) -> dict[str, int]:
        """Index of each free parameter of the model."""
        return {name: i for i, name in enumerate(self.model.free)}

    @cached_property
    def _input_errors(self) -> tuple[str, ...]:
        """Names of the delays of the inputs, and of plays and gains of the steering, which change them."""
        steer = [u.name for u in self.unknowns if is_of(u.name, STEER)]
        return (*self._delays, *[name for name in steer if not is_sensor_error(name, "offset")])

    @cached_property
    def _speed_range(self) -> tuple[float, float]:
        """Lowest and highest speed, m/s."""
        return speed_range(self.logs)

    @cached_property
    def _delays(self) -> tuple[str, ...]:
        """Names of the unknown delays of speed and steer angles; these shift the inputs."""
        late = [name for u in self.unknowns for name in u.slopes if is_of(name, SPEED, STEER)]
        return tuple(dict.fromkeys(name for name in late if is_sensor_error(name, "delay")))

    @cached_property
    def _initial_factors(self) -> list[list[Array]]:
        """For each segment of each log: factor L (n, n) of the prior covariance of the initial state with the vehicle
        as given. Its last column is the effect of the bank."""
        return [[self._initial_factor(segment) for segment in log.segments] for log in self.logs]

    def _initial_factor(self, segment: Record) -> Array:
        inputs = {name: segment.input(name) for name in ("speed", *self.model.vehicle.steer_signals())}
        first = {name: float(v[0]) for name, v in inputs.items()}
        bank = self.setup.bank_sigma if self.model.bank else None
        _, P0 = initial_state(self.vehicle, first, {}, roll=self.model.roll, steer_sigma=steer_sigma(inputs), bank=bank)
        return initial_factor(P0)

    def _step_rows(self, i: int, j: int, values: Mapping[str, float]) -> StepRows:
        """Rows of a segment at the present errors of the steering; kept until these change."""
        key = (i, j, *[values[name] for name in self._input_errors])
        if key not in self._rows:
            self._rows = {k: rows for k, rows in self._rows.items() if k[:2] != (i, j)}
            self._rows[key] = step_rows(self.model, self.vehicle, self.logs[i].segments[j], errors=values)
        return self._rows[key]


def _corrected(segment: Record, delays: Mapping[str, float]) -> Record:
    """The segment with signals that are early by their delays, s, which may be negative."""
    time, half, corrected = segment.time, 0.5 / segment.rate, {}
    for name, delay in delays.items():
        if np.isfinite(segment.signals.get(name, np.nan)).any():
            at, present = time + delay, np.isfinite(segment.signals[name])
            nearest = np.searchsorted(time + half, at).clip(max=len(time) - 1)
            inside = (at > time[0] - half) & (at < time[-1] + half) & present[nearest]
            values = np.interp(at, time[present], segment.signals[name][present])
            corrected[name] = values if is_input(name) else np.where(inside, values, np.nan)
    return segment.with_signals(corrected)


def _part(segment: Record, fraction: float) -> Record:
    """The part of a segment with the largest variance of speed times steer angle, which the yaw rate follows."""
    length = max(math.ceil(fraction * len(segment)), math.ceil(SHORTEST_PART * segment.rate))
    steers = names_of(STEER, segment.signals)
    if length >= len(segment) or not steers:
        return segment
    steered = segment.input("speed") * segment.input(steers[0])
    sums = [np.cumsum(np.concatenate([[0.0], values])) for values in (steered, steered**2)]
    mean, square = ((total[length:] - total[:-length]) / length for total in sums)
    first = int(np.argmax(square - mean**2))
    return segment.cut(segment.time[first], segment.time[first + length - 1])
