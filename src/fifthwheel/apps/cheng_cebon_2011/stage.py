"""One stage of the identification in two stages: the dual filter, in several passes through all logs.

A pass starts at the estimate z_b of the last pass, about which the filter linearises, with the prior covariance. That
centres the prior on z_b instead of on 0. The information form of the result, P^-1 z = P_0^-1 z_b + (data), shows that
the prior mean is restored by z - P P_0^-1 z_b; the active unknowns of the default settings have P_0 = I, and the
correction is z - P z_b. So neither a sample nor the prior counts twice, whatever the number of passes. If consecutive
passes move in opposite directions, the length of the step is halved.

The article carries the covariance on from pass to pass (`TwoStage.restart`) and has no correction.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fifthwheel.apps.cheng_cebon_2011.dual import DualCoupling
from fifthwheel.apps.cheng_cebon_2011.problem import DualProblem, sample_period
from fifthwheel.apps.cheng_cebon_2011.settings import TwoStage, deviation
from fifthwheel.base.types import Array
from fifthwheel.estimate.filters.noise_model import CORRELATION_TIME, autocorrelation_factor
from fifthwheel.estimate.filters.step_rows import StepRows
from fifthwheel.estimate.identify.dataset import LogData
from fifthwheel.estimate.identify.result.parts import ParameterHistory
from fifthwheel.estimate.identify.settings import Progress
from fifthwheel.estimate.identify.unknowns.unknown import Unknown, scaling

FEWEST_INNOVATIONS = 20
"""A channel with at most so many accepted innovations keeps its noise."""


@dataclass(frozen=True, kw_only=True)
class StageResult:
    """The result of a stage."""

    values: dict[str, float]  # of the unknowns that all logs share, SI
    logs: tuple[LogData, ...]  # with their own sensor errors and noise
    history: ParameterHistory
    settled: bool  # whether the last pass changed no parameter
    accepted: tuple[Array, ...]  # of each log: (N, m), 1 where the last pass used a measurement


def run_stage(
    problem: DualProblem,
    logs: Sequence[LogData],
    *,
    active: Collection[str],
    start: Mapping[str, float],
    passes: int,
    progress: Progress = lambda *_: None,
    title: str = "",
) -> StageResult:
    """Estimate the active ones of the unknowns by at most so many passes; the others keep their values.

    `logs` have the noise of every channel, `start` has the values of the unknowns that all logs share. `progress` is
    called with `title` before each pass and at the end.
    """
    stage = _Stage(problem=problem, active=frozenset(active))
    state = stage.initial(start, logs)
    for number in range(passes):
        progress(title, number, passes)
        state = stage.run_pass(state)
        if stage.settled(state):
            break
    progress(title, passes, passes)
    return StageResult(
        values=state.values,
        logs=state.logs,
        history=stage.history(state),
        settled=stage.settled(state),
        accepted=state.accepted,
    )


def has_changed(change: ArrayLike, value: ArrayLike, sigma: ArrayLike, settings: TwoStage) -> bool:
    """Whether any change exceeds both a tenth of sigma and a tenth of the tolerance."""
    allowed = 0.1 * np.maximum(sigma, settings.tolerance * np.abs(value))
    return bool((np.abs(change) > allowed).any())


@dataclass(frozen=True, kw_only=True)
class _Rows:
    """Estimates of the n parameters of a stage after each of N samples, for the history."""

    time: Array  # (N,) s
    z: Array  # (N, n)
    variance: Array  # (N, n) of z


@dataclass(frozen=True, kw_only=True)
class _StageState:
    """All that a stage has estimated between two passes; n_p unknowns."""

    z: Array  # (n_p,)
    Pz: Array  # (n_p, n_p)
    walk: float = 1.0  # factor that forgetting has left of the random walk
    values: dict[str, float]  # of the unknowns that all logs share
    logs: tuple[LogData, ...]
    accepted: tuple[Array, ...] = ()  # of each log in the last pass
    before: Array  # (n_p,) z at the start of the last pass
    step: Array  # (n_p,) undamped step of the last pass
    damping: float = 1.0  # fraction of a step that is taken
    rows: tuple[_Rows, ...] = ()
    starts: tuple[int, ...] = ()  # first row of each pass

    @property
    def elapsed(self) -> float:
        """Time of the last row, s."""
        return float(self.rows[-1].time[-1]) if self.rows else 0.0


@dataclass(frozen=True, kw_only=True)
class _Stage:
    """What stays the same during a stage."""

    problem: DualProblem
    active: frozenset[str]

    @property
    def settings(self) -> TwoStage:
        return self.problem.settings

    @cached_property
    def is_active(self) -> NDArray[np.bool_]:
        """Which unknowns are estimated (n_p,)."""
        return np.array([name in self.active for name in self.problem.names], dtype=np.bool_)

    @cached_property
    def per_log(self) -> NDArray[np.bool_]:
        """Which unknowns each log has for itself (n_p,)."""
        return np.array([u.per_log for u in self.problem.unknowns], dtype=np.bool_)

    @cached_property
    def is_estimated(self) -> NDArray[np.bool_]:
        """Which unknowns are active parameters, not sensor errors (n_p,)."""
        return self.is_active & ~np.array([u.is_sensor_error for u in self.problem.unknowns], dtype=np.bool_)

    @cached_property
    def sigmas(self) -> Array:
        """Standard deviations (2, n_p) of z at the start, and that z gains per sample; 0 if not active."""
        sigmas = np.array([filter_sigmas(u, self.settings) for u in self.problem.unknowns]).reshape(-1, 2)
        return np.where(self.is_active, sigmas.T, 0.0)

    def initial(self, start: Mapping[str, float], logs: Sequence[LogData]) -> _StageState:
        z = self.problem.z(self.problem.values(start, logs[0]))
        return _StageState(
            z=z, Pz=np.diag(self.sigmas[0] ** 2), values=dict(start), logs=tuple(logs), before=z, step=np.zeros(len(z))
        )

    def run_pass(self, state: _StageState) -> _StageState:
        """All logs once, in order; see the module docstring."""
        restart, active = self.settings.restart, self.is_active
        current = replace(
            state,
            Pz=np.diag(self.sigmas[0] ** 2) if restart else state.Pz,
            logs=(),
            accepted=(),
            before=state.z,
            starts=(*state.starts, sum(len(rows.time) for rows in state.rows)),
        )
        for log in state.logs:
            current = self._run_log(current, log)
        z, step, damping = current.z, state.step, state.damping
        if restart:
            z = z - current.Pz @ np.where(active & ~self.per_log, state.z, 0.0)
            step = np.where(self.per_log, 0.0, z - state.z)
            if step @ state.step < 0:
                damping /= 2
            z = np.where(self.per_log, z, state.z + damping * step)
        z, shared = self._within_bounds(z, active & ~self.per_log)
        last = self._rows(np.array([current.elapsed]), z[None], np.diag(current.Pz)[None])
        return replace(
            current, z=z, values=state.values | shared, step=step, damping=damping, rows=(*current.rows, last)
        )

    def _run_log(self, state: _StageState, log: LogData) -> _StageState:
        """One log: the unknowns that belong to it start from their prior, all others from the previous log."""
        specific = self.per_log & self.is_active
        Pz = state.Pz.copy()
        Pz[specific, :] = Pz[:, specific] = 0.0
        Pz[specific, specific] = 1.0
        values = self.problem.values(state.values, log)
        state = replace(state, z=np.where(self.per_log, self.problem.z(values), state.z), Pz=Pz)
        start = np.where(specific, state.z, 0.0)
        innovations, accepted = [], []
        for segment in log.segments:
            rows = self.problem.rows(segment, values)
            filtered = self.problem.run(
                log, rows, values, z=state.z, Pz=state.Pz, walk=state.walk, coupling=self._coupling(rows)
            )
            samples, end = rows.sample_indices, filtered.end
            time = rows.time[samples] - rows.time[0] + state.elapsed
            history = self._rows(time, filtered.z[samples], filtered.z_variance[samples])
            state = replace(state, z=end.z, Pz=end.Pz, walk=end.walk, rows=(*state.rows, history))
            innovations.append(filtered.innovation[samples] / np.sqrt(filtered.innovation_variance[samples]))
            accepted.append(filtered.accepted[samples])
        z, errors = self._within_bounds(state.z - state.Pz @ start, specific)
        used = np.concatenate(accepted)
        log = self._with_innovation_noise(
            replace(log, errors={**log.errors, **errors}), np.concatenate(innovations), used
        )
        return replace(state, z=z, logs=(*state.logs, log), accepted=(*state.accepted, used))

    def _coupling(self, rows: StepRows) -> DualCoupling:
        """Random walk and forgetting per second; the settings have them per sample."""
        step = sample_period(rows)
        return DualCoupling(
            consistent=self.settings.consistent,
            coupled=self.settings.coupled,
            random_walk=self.sigmas[1] ** 2 / step,
            forgetting=-np.log(self.settings.forgetting) / step,
        )

    def _within_bounds(self, z: Array, which: NDArray[np.bool_]) -> tuple[Array, dict[str, float]]:
        """z with some unknowns moved inside their bounds, and their values by name."""
        scale = self.problem.scaling
        p = np.clip(scale.to_p(z), scale.lower, scale.upper)
        values = {name: float(value) for name, value, flag in zip(self.problem.names, p, which, strict=True) if flag}
        return np.where(which, scale.to_z(p), z), values

    def _with_innovation_noise(self, log: LogData, innovation: Array, accepted: Array) -> LogData:
        """The log with noise and autocorrelation factor of each channel by its normalised innovations (N, m)."""
        if not self.settings.adapt_noise:
            return log
        rate = 1 / np.median(np.diff(log.segments[0].time))
        noise, factors = dict(log.noise), dict(log.autocorrelation_factor)
        for i, name in enumerate(self.problem.outputs):
            values = innovation[accepted[:, i] > 0, i]
            if len(values) > FEWEST_INNOVATIONS:
                noise[name] = log.effective_variance(name) * float(np.clip(np.mean(values**2), 1e-3, 1e3))
                factors[name] = autocorrelation_factor(values, int(CORRELATION_TIME * rate))
        return replace(log, noise=noise, autocorrelation_factor=factors)

    def _rows(self, time: Array, z: Array, variance: Array) -> _Rows:
        return _Rows(time=time, z=z[:, self.is_estimated], variance=variance[:, self.is_estimated])

    def settled(self, state: _StageState) -> bool:
        """Whether the last pass changed no parameter."""
        if not self.settings.restart:
            return False
        estimated, scale = self.is_estimated, self.problem.scaling
        if not estimated.any():
            return len(state.starts) > 1
        p, p_before = scale.to_p(state.before + state.step), scale.to_p(state.before)
        sigma = np.sqrt(np.diag(state.Pz)) * np.abs(scale.slope(p))
        return not has_changed((p - p_before)[estimated], p[estimated], sigma[estimated], self.settings)

    def history(self, state: _StageState) -> ParameterHistory:
        estimated = [u for u, flag in zip(self.problem.unknowns, self.is_estimated, strict=True) if flag]
        scale = scaling(estimated)
        p = scale.to_p(np.concatenate([rows.z for rows in state.rows]))
        variance = np.concatenate([rows.variance for rows in state.rows])
        return ParameterHistory(
            names=tuple(u.name for u in estimated),
            time=np.concatenate([rows.time for rows in state.rows]),
            values=p,
            sigma=np.sqrt(variance) * np.abs(scale.slope(p)),
            starts=state.starts,
        )


def filter_sigmas(unknown: Unknown, settings: TwoStage) -> tuple[float, float]:
    """Standard deviations of z at the start of the filter, and that z gains per sample."""
    if unknown.is_sensor_error:
        return 1.0, 0.0
    start, walk, prior = deviation(settings.P_p, unknown), deviation(settings.Q_p, unknown), unknown.prior_sigma
    return 1.0 if start is None else start / prior, (walk or 0.0) / prior
