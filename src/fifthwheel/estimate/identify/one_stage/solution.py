"""The solution of one stage, and the logs linearised at it: posterior, history and tests of the priors."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fifthwheel.base.types import Array, Indices
from fifthwheel.estimate.filters.noise_model import CORRELATION_TIME, long_run_covariance
from fifthwheel.estimate.identify.dataset import Dataset
from fifthwheel.estimate.identify.doubts import PriorTest, prior_tests
from fifthwheel.estimate.identify.one_stage import likelihood
from fifthwheel.estimate.identify.one_stage.gauss_newton import Minimum
from fifthwheel.estimate.identify.one_stage.posterior import ScaledPosterior
from fifthwheel.estimate.identify.one_stage.problem import Problem
from fifthwheel.estimate.identify.result.parts import ParameterHistory
from fifthwheel.estimate.identify.settings import OneStage
from fifthwheel.estimate.identify.unknowns.unknown import scaling
from fifthwheel.estimate.identify.verdict import Verdict

HISTORY_LENGTH = 200
"""Approximate number of rows in the history of the estimates."""
SUMS_PER_LAG = 16
"""Scores are kept as sums over this fraction of the correlation time."""


@dataclass(frozen=True, kw_only=True)
class LogLinearisation:
    """What one log contributes, by its own unknowns and those that logs share: k of them."""

    indices: Indices  # of the unknowns among all (k,)
    information: Array  # (k, k)
    gradient: Array  # (k,)
    score_covariance: Array  # (k, k)


@dataclass(frozen=True, kw_only=True)
class Linearisation:
    """What follows from the logs, linearised at a solution."""

    posterior: ScaledPosterior
    gradient: Array  # of the loss of the logs (k,), without the prior
    history: ParameterHistory  # how the estimates would have developed sample after sample
    tests: tuple[PriorTest, ...]  # of the prior of every uncertain number and sensor error, the largest statistic first
    logs: tuple[LogLinearisation, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class Solution:
    """The maximum of the posterior."""

    dataset: Dataset
    minimum: Minimum[Problem]
    uninformed: Mapping[str, Verdict]
    """Parameters that the logs hardly inform, each with NOT_EXCITED or NOT_IDENTIFIABLE."""

    @property
    def problem(self) -> Problem:
        """With the noise of its residuals."""
        return self.minimum.objective

    @property
    def settings(self) -> OneStage:
        """Of the identification."""
        return self.problem.settings

    @property
    def estimated(self) -> tuple[str, ...]:
        """Names of the estimated parameters."""
        return self.problem.setup.estimated

    @cached_property
    def linearisation(self) -> Linearisation:
        """The logs, linearised here."""
        return _linearise(self)

    @cached_property
    def lateral_accelerations(self) -> list[float]:
        """Largest lateral acceleration of the first unit that has a yaw rate in each log, m/s^2; NaN if none has."""
        values = [self.problem.values(self.minimum.z, i) for i in range(len(self.dataset.records))]
        return self.dataset.lateral_accelerations(self.settings.min_speed, values)


def _linearise(solution: Solution) -> Linearisation:
    problem, z, settings = solution.problem, solution.minimum.z, solution.settings
    k, prior = len(problem.names), problem.prior.expand(z)
    information, score_covariance, gradient = np.zeros((k, k)), np.zeros((k, k)), np.zeros(k)
    rows = [problem.names.index(name) for name in solution.estimated]
    length = max(sum(len(s.time) for log in problem.logs for s in log.segments) // HISTORY_LENGTH, 1)
    elapsed, time, values, sigmas = 0.0, [], [], []
    logs = [_nothing(problem, i) for i in range(len(problem.logs))]
    for i, j in problem.segments():
        segment = problem.logs[i].segments[j]
        lags = max(int(CORRELATION_TIME * segment.rate), 1)
        size = max(lags // SUMS_PER_LAG, 1)
        scores, samples = np.zeros((-(-len(segment.time) // size), k)), 0
        for block in problem.blocks(z, i, j):
            for piece in block.split(length):
                piece_gradient, piece_information = likelihood.gradient_and_information(piece, settings.outlier)
                information[np.ix_(piece.indices, piece.indices)] += piece_information
                gradient[piece.indices] += piece_gradient
                places = np.searchsorted(logs[i].indices, piece.indices)
                logs[i].gradient[places] += piece_gradient
                logs[i].information[np.ix_(places, places)] += piece_information
                P = np.linalg.inv(prior.hessian + information)
                values.append((z - P @ (prior.gradient + gradient))[rows])
                sigmas.append(np.sqrt(np.diag(P))[rows])
                time.append(elapsed + piece.time[-1] - segment.time[0])
            numbers = np.arange(samples, samples + len(block.time)) // size
            np.add.at(scores, np.ix_(numbers, block.indices), likelihood.scores(block, settings.outlier))
            samples += len(block.time)
        elapsed = time[-1]
        of_segment = long_run_covariance(scores, lags // size)
        score_covariance += of_segment
        logs[i].score_covariance[:] += of_segment[np.ix_(logs[i].indices, logs[i].indices)]
    scale = scaling([u for u in problem.unknowns if u.name in solution.estimated])
    p = scale.to_p(np.array(values))
    history = ParameterHistory(
        names=solution.estimated,
        time=np.array(time),
        values=p,
        sigma=np.array(sigmas) * np.abs(scale.slope(p)),
        starts=(0,),
    )
    posterior = ScaledPosterior.from_information(
        problem.names,
        information,
        score_covariance,
        nuisances=problem.nuisances,
        precision=prior.hessian,
        prior=problem.prior,
    )
    tested = [name for name, u in problem.unknowns_by_name.items() if u.estimated and not u.reported]
    mean, variance = problem.prior.mean, problem.prior.variance
    return Linearisation(
        posterior=posterior,
        gradient=gradient,
        history=history,
        tests=tuple(
            prior_tests(problem.names, z - mean, posterior.model_covariance, posterior.predictive, tested, variance)
        ),
        logs=tuple(logs),
    )


def _nothing(problem: Problem, log: int) -> LogLinearisation:
    """What no sample of a log contributes, to which the samples are added."""
    indices = np.unique(np.concatenate([problem.layout.unknowns[log], *problem.layout.initial_states[log]]))
    k = len(indices)
    zeros = {"information": np.zeros((k, k)), "gradient": np.zeros(k), "score_covariance": np.zeros((k, k))}
    return LogLinearisation(indices=indices, **zeros)
