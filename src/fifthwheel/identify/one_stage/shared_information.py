"""The information of one log on what logs of one vehicle share, so that logs combine without being read again.

The unknowns z of a log are those that other logs share (a: parameters, uncertain numbers, gains and delays of
sensors) and its own (b: offsets, initial states, banks). With the gradient g and the Fisher information H of the log
at its estimate z^, without the prior, and with the prior N(0, I) of b, the log contributes to the cost of a

    a' H_s a / 2 - v' a,      H_s = H_aa - K H_ba,      v = H_s a^ - (g_a - K (g_b + b^)),      K = H_ab (I + H_bb)^-1.

b is marginalised (Schur complement). The prior of a is not contained, so that v and H_s of several logs are added and
the prior counts once. The covariance of the sum of the scores M becomes [I, -K] M [I, -K]' + K K'.

Logs are linearised at different estimates. A gain of a sensor acts as a factor of a stiffness, so that the cost is
closer to its quadratic model in the logarithm of the gain: with gain = 1 + s z = exp(s u), the derivatives are scaled
by dz/du = gain.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fifthwheel._types import Array
from fifthwheel.channels import is_sensor_error
from fifthwheel.identify.one_stage.estimator import solve_one_stage
from fifthwheel.identify.one_stage.identification import build_identification
from fifthwheel.identify.one_stage.solution import Solution
from fifthwheel.identify.result import Identification
from fifthwheel.identify.settings import OneStage
from fifthwheel.identify.unknowns.unknown import Unknown
from fifthwheel.record import Record
from fifthwheel.vehicle import Vehicle
from fifthwheel.vehicle.parameters import FRICTION


@dataclass(frozen=True, kw_only=True)
class SharedInformation:
    """What one log contributes to the cost of n shared unknowns, z ~ N(0, I)."""

    names: tuple[str, ...]
    centre: Array
    """Prior mean (n,), SI; median of a logarithmic unknown."""
    scale: Array
    """Prior standard deviation (n,), SI; of the logarithm of a logarithmic unknown."""
    logarithmic: NDArray[np.bool_]
    """(n,): value = centre exp(scale z); the others: value = centre + scale z."""
    non_negative: NDArray[np.bool_]
    """(n,): z is not below 0, such as that of a play. A combination below 0 means that the unknown is 0."""
    vector: Array
    """v (n,)."""
    information: Array
    """H_s (n, n) of the shared unknowns."""
    score_covariance: Array
    """Long-run covariance (n, n) of the sum of the scores; equal to the information if the model is right."""


def identify_with_information(
    record: Record, vehicle: Vehicle, settings: OneStage
) -> tuple[Identification, SharedInformation]:
    """Identify a vehicle from one log in one stage; also give the log's information; arguments as in `identify`."""
    solution = solve_one_stage([record], vehicle, settings)
    return build_identification(solution), shared_information(solution)


def shared_information(solution: Solution) -> SharedInformation:
    """The information of the only log of a solution.

    The friction of its road is the log's own. So is a parameter that is not identifiable because the roll rate is not
    measured.
    """
    problem, z, linearisation = solution.problem, solution.minimum.z, solution.linearisation
    index = {name: i for i, name in enumerate(problem.names)}
    own_unknowns = {*problem.setup.without_roll_rate, FRICTION}
    unknowns = [u for u in problem.unknowns if not u.per_log and u.name not in own_unknowns]
    shared = [index[u.name] for u in unknowns]
    own = [i for i in range(len(z)) if i not in shared]
    H, M = linearisation.posterior.information, linearisation.score_covariance
    K = H[np.ix_(shared, own)] @ np.linalg.inv(np.eye(len(own)) + H[np.ix_(own, own)])
    gradient = linearisation.gradient[shared] - K @ (linearisation.gradient[own] + z[own])
    joint = H[shared] - K @ H[own]
    information = (joint[:, shared] + joint[:, shared].T) / 2
    rows = M[shared] - K @ M[own]
    scores = rows[:, shared] - rows[:, own] @ K.T + K @ K.T
    values = problem.values(z, 0)
    gains = np.array([is_sensor_error(u.name, "gain") for u in unknowns])
    gain = np.where(gains, [values[u.name] for u in unknowns], 1.0)
    scale = _column(unknowns, "scale")
    estimate = np.where(gains, np.log(gain) / scale, z[shared])
    information *= np.outer(gain, gain)
    return SharedInformation(
        names=tuple(u.name for u in unknowns),
        centre=_column(unknowns, "centre"),
        scale=scale,
        logarithmic=np.array([u.logarithmic for u in unknowns]) | gains,
        non_negative=np.array([u.lower == u.centre for u in unknowns]),
        vector=information @ estimate - gain * gradient,
        information=information,
        score_covariance=(scores + scores.T) / 2 * np.outer(gain, gain),
    )


def _column(unknowns: Sequence[Unknown], field: str) -> Array:
    return np.array([getattr(u, field) for u in unknowns])
