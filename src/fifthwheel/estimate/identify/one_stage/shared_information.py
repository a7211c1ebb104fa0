"""The information of one log on what logs of one vehicle share, so that logs combine without being read again.

The unknowns z of a log are those that other logs share (a: parameters, uncertain numbers, gains and delays of
sensors) and its own (b: offsets, initial states, banks). With the gradient g and the Fisher information H of the log
at its estimate z^, without the prior, and with the prior N(0, I) of b, the log contributes to the cost of a

    a' H_s a / 2 - v' a,      H_s = H_aa - K H_ba,      v = H_s a^ - (g_a - K (g_b + b^)),      K = H_ab (I + H_bb)^-1.

b is marginalised (Schur complement). The prior of a is not contained, so that v and H_s of several logs are added and
the prior counts once. The covariance of the sum of the scores M becomes [I, -K] M [I, -K]' + K K'.

Logs are linearised at different estimates. A gain of a sensor acts as a factor of a stiffness, so that the cost is
closer to its quadratic model in the logarithm of the gain: with gain = c + s z = c exp(s u / c), the derivatives are
scaled by dz/du = gain / c.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fifthwheel.base.names import split_log
from fifthwheel.base.types import Array
from fifthwheel.data.channels import is_sensor_error
from fifthwheel.estimate.identify.doubts import Doubt, describe_doubt
from fifthwheel.estimate.identify.knowledge.information import (
    Labels,
    LogKnowledge,
    Occasion,
    SharedInformation,
    masses_of_load,
    origin,
    record_digest,
)
from fifthwheel.estimate.identify.knowledge.load import load_factors
from fifthwheel.estimate.identify.one_stage.solution import LogLinearisation, Solution
from fifthwheel.estimate.identify.setup import Setup
from fifthwheel.estimate.identify.unknowns.unknown import Unknown, scaling


def log_knowledge(solution: Solution, occasion: Occasion) -> list[LogKnowledge]:
    """The information of each log of a solution on the truck, without doubts."""
    labels = Labels.of(solution.dataset.vehicle, occasion, solution.estimated)
    return [
        LogKnowledge(
            **vars(labels) | {"name": record.name},
            date=occasion.date_of([record]),
            information=shared_information(solution, labels, i),
            digest=record_digest(record),
            masses=masses_of_load(solution.dataset.initial_vehicle),
        )
        for i, record in enumerate(solution.dataset.records)
    ]


def with_doubts(logs: Sequence[LogKnowledge], doubts: Sequence[Doubt]) -> list[LogKnowledge]:
    """The logs of a solution, each with the doubts that concern it."""
    return [
        replace(log, doubts=tuple(describe_doubt(doubt) for doubt in doubts if _concerns(doubt, i, log.name)))
        for i, log in enumerate(logs)
    ]


def _concerns(doubt: Doubt, log: int, name: str) -> bool:
    """Whether a doubt is one of a log, by its number and its name, or one of all logs."""
    logs = {split_log(cause.name)[1] for cause in doubt.causes} or {None}
    return doubt.log in (None, name) and not logs.isdisjoint({None, str(log)})


def shared_information(solution: Solution, labels: Labels, log: int = 0) -> SharedInformation:
    """The information of one log of a solution."""
    of_log, names = solution.linearisation.logs[log], solution.problem.names
    z = solution.minimum.z[of_log.indices]
    return marginal_information(solution.problem.setup, [names[i] for i in of_log.indices], z, of_log, labels)


def marginal_information(
    setup: Setup, names: Sequence[str], z: Array, log: LogLinearisation, labels: Labels
) -> SharedInformation:
    """The information of a log on what logs share.

    A parameter that is not identifiable because the roll rate is not measured is the log's own, and so is an unknown
    whose owner is the log. The log contributes `log` at the estimates z (k,) of its unknowns, with the names (k,).
    """
    index = {name: i for i, name in enumerate(names)}
    unknowns = [u for u in setup.unknowns if not u.per_log and u.name not in setup.without_roll_rate]
    unknowns = [u for u in unknowns if labels.owned(u.name).of("log") is None]
    shared = [index[u.name] for u in unknowns]
    left = [i for i in range(len(z)) if i not in shared]
    H, M = log.information, log.score_covariance
    K = H[np.ix_(shared, left)] @ np.linalg.inv(np.eye(len(left)) + H[np.ix_(left, left)])
    gradient = log.gradient[shared] - K @ (log.gradient[left] + z[left])
    joint = H[shared] - K @ H[left]
    information = (joint[:, shared] + joint[:, shared].T) / 2
    rows = M[shared] - K @ M[left]
    scores = rows[:, shared] - rows[:, left] @ K.T + K @ K.T
    gains = np.array([is_sensor_error(u.name, "gain") for u in unknowns])
    centre, given = _column(unknowns, "centre"), setup.vehicle.parameters()
    mean = np.where(gains, centre, 1.0)
    gain, scale = np.where(gains, scaling(unknowns).to_p(z[shared]) / mean, 1.0), _column(unknowns, "scale") / mean
    estimate = np.where(gains, np.log(gain) / scale, z[shared])
    information *= np.outer(gain, gain)
    return SharedInformation(
        names=tuple(u.name for u in unknowns),
        centre=centre,
        scale=scale,
        logarithmic=np.array([u.logarithmic for u in unknowns]) | gains,
        non_negative=np.array([u.lower == u.centre for u in unknowns]),
        vector=information @ estimate - gain * gradient,
        information=information,
        score_covariance=(scores + scores.T) / 2 * np.outer(gain, gain),
        origins=tuple(origin(u, given) for u in unknowns),
        factors=load_factors(setup.vehicle),
    )


def _column(unknowns: Sequence[Unknown], field: str) -> Array:
    return np.array([getattr(u, field) for u in unknowns])
