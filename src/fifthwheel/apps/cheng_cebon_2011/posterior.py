"""The posterior at the estimate of two stages, from the Fisher information of the logs on all unknowns together.

The dual filter runs once more with fixed parameters. For each sample and channel it gives an innovation e, its variance
s^2 and the gradient g of the prediction with respect to z. With the prior z ~ N(0, I):

    information        H = I + sum g g' / s^2            covariance     P = H^-1
    scores             sum over channels of g e / s^2    sandwich       P (I + M) P
    Hessian            H, with gradients as measured     next step      H^-1 (sum of the scores - z)
    roll bias score    b                                 bias           P b

M is the long-run covariance of the sum of the scores (Newey and West 1987). Where the innovations are white, M = H - I
and both covariances agree. b is the score that the yaw model collects on a vehicle that rolls.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from fifthwheel.apps.cheng_cebon_2011.problem import DualProblem
from fifthwheel.base.types import Array
from fifthwheel.data.channels import is_sensor_error
from fifthwheel.data.record import Record
from fifthwheel.estimate.filters.initial_state import steady_initial_state
from fifthwheel.estimate.filters.noise_model import CORRELATION_TIME, long_run_covariance
from fifthwheel.estimate.filters.step_rows import corrected_inputs
from fifthwheel.estimate.identify.dataset import LogData
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.simulation import free_response

SINGULAR = 1e14
"""Condition number of the information from which it counts as singular: the vehicle is unstable at these values."""


@dataclass(frozen=True, kw_only=True)
class TwoStagePosterior:
    """Covariances of all k unknowns in units of z, whose prior is N(0, I); the unknowns of log i are "name@i"."""

    names: tuple[str, ...]
    covariance: Array  # (k, k) P
    sandwich: Array  # (k, k) the same from autocorrelated scores
    bias: Array  # (k,) shift of each unknown by the missing roll; zero if the model has roll
    gradient: Array  # (k,) of the log posterior
    hessian: Array  # (k, k) of the negative log posterior (Gauss-Newton)
    unstable: bool  # the vehicle is unstable at these values; the covariances are those of the prior

    def excited(self, name: str, limit: float) -> bool:
        """Whether the logs bring the sigma of an unknown below `limit` times its prior sigma, if the model is right.

        True for an unknown that is not part of this posterior, and for all if the vehicle is unstable.
        """
        if self.unstable or name not in self.names:
            return True
        i = self.names.index(name)
        return bool(self.covariance[i, i] < limit**2)

    def next_step(self, fixed: Collection[str]) -> Array:
        """Change of each z (k,) by the next step of Gauss and Newton; 0 of those that are fixed."""
        free = np.flatnonzero([name not in fixed for name in self.names])
        step = np.zeros(len(self.names))
        step[free] = np.linalg.solve(self.hessian[np.ix_(free, free)], self.gradient[free])
        return step

    @property
    def sigma(self) -> Array:
        """Standard deviation of each z (k,): the larger of both covariances, and the bias."""
        return np.sqrt(np.maximum(np.diag(self.covariance), np.diag(self.sandwich)) + self.bias**2)


def evaluate_posterior(
    problem: DualProblem, logs: Sequence[LogData], values: Mapping[str, float], *, gated: bool = True
) -> TwoStagePosterior:
    """Posterior at the values of the unknowns that all logs share, SI; logs have their own errors and their noise.

    `gated=False` counts every measurement, even those that the gate rejects; before an estimation these may be most.
    """
    unknowns = problem.unknowns
    names = [u.name for u in unknowns if not u.per_log]
    names += [f"{u.name}@{i}" for i in range(len(logs)) for u in unknowns if u.per_log]
    k = len(names)
    information, score_covariance, bias_score = np.eye(k), np.eye(k), np.zeros(k)
    z, gradient, hessian = np.zeros(k), np.zeros(k), np.eye(k)
    for i, log in enumerate(logs):
        indices = [names.index(f"{u.name}@{i}" if u.per_log else u.name) for u in unknowns]
        fixed = _FixedFilter(problem=problem, log=log, values=problem.values(values, log))
        z[indices] = problem.z(fixed.values)
        for segment in log.segments:
            part = fixed.information(segment, gated=gated)
            lags = max(int(CORRELATION_TIME * segment.rate), 1)
            information[np.ix_(indices, indices)] += part.information
            score_covariance[np.ix_(indices, indices)] += long_run_covariance(part.scores, lags)
            gradient[indices] += part.gradient
            hessian[np.ix_(indices, indices)] += part.hessian
            if not problem.roll:
                bias_score[indices] += fixed.roll_bias_score(segment)
    unstable = not np.linalg.cond(information) < SINGULAR
    if unstable:
        information, score_covariance, bias_score = np.eye(k), np.eye(k), np.zeros(k)
    covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
    return TwoStagePosterior(
        names=tuple(names),
        covariance=covariance,
        sandwich=covariance @ score_covariance @ covariance,
        bias=covariance @ bias_score,
        gradient=gradient - z,
        hessian=hessian,
        unstable=unstable,
    )


class _Part(NamedTuple):
    """What a segment tells of n unknowns, from N samples."""

    scores: Array  # (N, n)
    information: Array  # (n, n)
    gradient: Array  # (n,) of the log likelihood, at the measured segment
    hessian: Array  # (n, n)


def _gram(gradients: Array, weight: Array) -> Array:
    """Sum (n, n) of g g' w over samples and channels, of gradients (M, m, n) and weights (M, m)."""
    rows = (np.sqrt(weight)[..., None] * gradients).reshape(-1, gradients.shape[-1])
    return np.asarray(rows.T @ rows)


@dataclass(frozen=True, kw_only=True)
class _FixedFilter:
    """The dual filter with fixed parameters over the segments of one log; n unknowns, m channels."""

    problem: DualProblem
    log: LogData
    values: dict[str, float]  # of the unknowns in this log, SI

    def run(self, segment: Record) -> tuple[Array, Array, Array]:
        """Innovations, weights 1 / s^2 (zero where rejected) and gradients: (M, m), (M, m), (M, m, n)."""
        problem, n = self.problem, len(self.problem.names)
        rows = problem.rows(segment, self.values)
        filtered = problem.run(self.log, rows, self.values, z=problem.z(self.values), Pz=np.zeros((n, n)))
        return filtered.innovation, filtered.accepted / filtered.innovation_variance, filtered.sensitivity

    def information(self, segment: Record, *, gated: bool) -> _Part:
        """What a segment tells of the unknowns.

        Scores and information have the gradients of the predicted segment. Along the measured segment they would
        contain the noise of the sensors, which looks like excitation: on a straight road there is nothing else.
        """
        innovation, weight, measured = self.run(segment)
        _, ungated_weight, predicted = self.run(self.predicted(segment, roll=self.problem.roll))
        if not gated:
            weight = ungated_weight
        scores, gradient = (np.einsum("km,kmn->kn", innovation * weight, each) for each in (predicted, measured))
        return _Part(
            scores=scores[(weight > 0).any(axis=1)],
            information=_gram(predicted, weight),
            gradient=gradient.sum(axis=0),
            hessian=_gram(measured, weight),
        )

    def roll_bias_score(self, segment: Record) -> Array:
        """Score (n,) that the yaw model collects on a vehicle that rolls.

        The difference of the scores on segments predicted with and without roll, both at the estimate and without
        noise.
        """
        scores = []
        for roll in (True, False):
            innovation, weight, gradient = self.run(self.predicted(segment, roll=roll))
            scores.append(np.einsum("km,kmn->n", innovation * weight, gradient))
        return np.asarray(scores[0] - scores[1])

    def predicted(self, segment: Record, *, roll: bool) -> Record:
        """The segment as the model predicts it at the estimate: without noise, the same samples missing."""
        parameters = set(self.problem.vehicle.parameters())
        vehicle = self.problem.vehicle.replace(
            {name: value for name, value in self.values.items() if name in parameters}
        )
        model = dynamics.model(vehicle, self.problem.outputs, roll=roll)
        inputs = {name: segment.input(name) for name in model.inputs}
        first = {name: float(v[0]) for name, v in inputs.items()}
        x0, _ = steady_initial_state(vehicle, first, self.values, roll=roll)
        values = dynamics.all_parameters(vehicle, model.outputs) | self.values
        values |= {name: 0.0 for name in values if is_sensor_error(name, "delay")}  # applied to the inputs
        corrected = corrected_inputs(segment, model.inputs, self.values)
        _, outputs = free_response(model, values, segment.time, corrected, x0)
        measured = {
            name: np.where(np.isfinite(segment.signals[name]), outputs[:, i], np.nan)
            for i, name in enumerate(model.outputs)
            if name in segment.signals
        }
        return replace(segment, signals=inputs | measured, reference={})
